# SPDX-License-Identifier: MIT
"""Modelled cycles of a step on a Cortex-M4F: every executed instruction, and what it takes.

QEMU counts instructions, not cycles.  Here it also tells which ones it executes, and each takes
what Arm's Cortex-M4 Technical Reference Manual says (DDI 0439: table 3-1, and table 7-1 for the
FPU), in memory without wait states:

  1       arithmetic, moves, comparisons, vadd, vsub, vmul, a branch that is not taken
  2       a load or store; 1 right behind another one, because neighbours are pipelined
  1 + n   push, pop, ldm, stm, vldm, vstm, ldrd of n registers
  3       vfma, vmla and their kin
  14      vdiv, vsqrt;  up to 12 for sdiv and udiv
  1 + P   a branch that is taken; P = 2, of the manual's 1 to 3, to fill the pipeline again
  + 1     where an instruction consumes the result of the FPU arithmetic right before it

An instruction in an it block counts as if its condition held.
"""

import re
import subprocess
import tempfile
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path

from blw.cost import programs
from blw.cost.cases import Log, Prepared, owner
from blw.cost.programs import Program

#: The one target that the model is of.
TARGET = "m4f"
REFILL = 2
DIVISION = {"vdiv": 14, "vsqrt": 14, "sdiv": 12, "udiv": 12}
TRACE = "-d in_asm,exec,nochain -D"

#: Executed instructions that a trace may have.
BUDGET = 1_000_000

#: Steps without attack that are followed, if the budget allows.
FOLLOWED = 10

#: Of port/replay, from where the step is called.
CALLERS = ("main", "replay", "replay_step")

_FUNCTION = re.compile(r"^[0-9a-f]+ <(\w+)>:$")
_LINE = re.compile(r"^ +([0-9a-f]+):\t(\S+)(?:\t([^@;]*))?")
_FLOAT = re.compile(r"v(?:add|sub|n?mul|div|sqrt|fn?m[as]|n?ml[as])")
_MULTIPLY_ADD = re.compile(r"v(?:fn?m[as]|n?ml[as])")
_MANY = re.compile(r"push|pop|v?ldm|v?stm|vpush|vpop|ldrd|strd")
_MEMORY = re.compile(r"v?ldr|v?str")
_REGISTER = re.compile(r"\b[rsd]\d+\b")


@dataclass(frozen=True)
class Instruction:
    """What the model has to know of one.

    cycles   without a neighbour's influence
    memory   a single load or store
    written  the register that FPU arithmetic writes, "" otherwise
    read     registers whose contents it consumes in its first cycle
    """

    function: str
    size: int
    cycles: int
    memory: bool
    written: str
    read: frozenset[str]


@dataclass(frozen=True, eq=False)
class Block:
    """Instructions that QEMU translated at once and executes from the first to the last."""

    addresses: tuple[int, ...]


@dataclass
class Tally:
    """Executed instructions, and their modelled cycles; of a function also how often it was come
    into from another one, which are its calls if it makes none itself."""

    instructions: int = 0
    cycles: int = 0
    entries: int = 0


@dataclass
class Trace:
    """Of the steps that were followed, so many: in all, and per function."""

    steps: int = 0
    total: Tally = field(default_factory=Tally)
    functions: dict[str, Tally] = field(default_factory=dict)

    @property
    def cycles_per_instruction(self) -> float:
        return self.total.cycles / self.total.instructions


def typical_cycles(program: Program, prepared: Prepared, typical: int) -> int | None:
    """Modelled cycles of a step of so many instructions; None if the model is not of this target or
    a single step exceeds the budget.  Raises StepFailed."""
    if program.target.name != TARGET or typical > BUDGET:
        return None
    return round(typical * follow(program, prepared, typical).cycles_per_instruction)


def follow(program: Program, prepared: Prepared, typical: int) -> Trace:
    """The first FOLLOWED steps after the log has settled, or the last ones before that the budget
    allows, where a step is typically so many instructions.  Raises StepFailed."""
    last = min(prepared.settling + FOLLOWED, BUDGET // typical)
    owner_step = f"blw_{owner(prepared.design, program.method)}_step"
    code = disassemble(program)
    log = prepared.log
    shorter = replace(prepared, log=Log(log.u[:last], log.y[:last], log.valid[:last]))
    with tempfile.TemporaryDirectory(prefix="bulwark.") as folder:
        path = Path(folder, "trace")
        programs.run(program, shorter, f"{TRACE} {path}")
        with path.open(encoding="ascii", errors="replace") as stream:
            steps = list(_steps(_executed(stream), code, owner_step))
    return _sum(map(_unfolded, steps[-FOLLOWED:]), code)


def disassemble(program: Program) -> dict[int, Instruction]:
    """The program's instructions by address."""
    listing = subprocess.run(
        [program.target.tools + "objdump", "-d", "--no-show-raw-insn", program.path], check=True,
        capture_output=True, text=True).stdout
    found: list[tuple[int, str, str, str]] = []
    function = ""
    for line in listing.splitlines():
        begins = _FUNCTION.match(line)
        if begins:
            function = begins[1]
        one = _LINE.match(line)
        if one:
            found.append((int(one[1], 16), one[2], one[3] or "", function))
    last = (found[-1][0] + 4, "", "", "")
    return {here[0]: instruction(*here[1:], size=after[0] - here[0])
            for here, after in pairwise([*found, last])}


def instruction(mnemonic: str, operands: str, function: str = "", size: int = 4) -> Instruction:
    """The model of one line of a disassembly."""
    name = mnemonic.partition(".")[0]
    registers = _REGISTER.findall(operands)
    arithmetic = _FLOAT.match(name) is not None
    added = _MULTIPLY_ADD.match(name) is not None
    return Instruction(
        function, size, _cycles(name, operands, added),
        memory=_MEMORY.match(name) is not None and _MANY.match(name) is None,
        written=registers[0] if arithmetic and registers else "",
        read=frozenset(registers if _consumes_all(name) else registers[1:]))


def _consumes_all(name: str) -> bool:
    """The first operand is read, too: stores and comparisons.  (The addend of a multiply-add is
    consumed a cycle later.)"""
    return name.startswith(("vstr", "vcmp"))


def _cycles(name: str, operands: str, multiply_add: bool) -> int:
    if multiply_add:
        return 3
    for prefix, cycles in DIVISION.items():
        if name.startswith(prefix):
            return cycles
    if _MANY.match(name):
        return 1 + (_listed(operands) if "{" in operands else 2)
    return 2 if _MEMORY.match(name) else 1


def _listed(operands: str) -> int:
    """Words of "{r4, r6-r8, lr}" and of "{d8-d9}"."""
    count = 0
    for part in re.search(r"\{(.*)\}", operands)[1].split(","):
        first, _, last = part.strip().partition("-")
        count += int(last[1:]) - int(first[1:]) + 1 if last else 1
    return count * (2 if "{d" in operands else 1)


def _executed(stream: Iterable[str]) -> Iterator[Block]:
    """The blocks of a trace, one after the other; it lists each before it is executed first.

    "IN: function", "0x00000048:  b508  push {r3, lr}" and more such lines, "" and then
    "Trace 0: 0x7f... [flags/pc/...] function", or later "Stopped" if it did not come to that.
    """
    listed: dict[int, Block] = {}
    latest: Block | None = None
    addresses: list[int] = []
    for line in stream:
        if line.startswith("Trace"):
            if latest:
                yield latest
            latest = listed[int(line.split("/", 2)[1], 16)]
        elif line.startswith("0x"):
            addresses.append(int(line.partition(":")[0], 16))
        elif line.startswith("Stopped"):
            latest = None
        elif addresses:
            listed[addresses[0]] = Block(tuple(addresses))
            addresses = []
    if latest:
        yield latest


def _steps(blocks: Iterable[Block], code: dict[int, Instruction], step: str,
           ) -> Iterator[Counter[tuple[Block, Block]]]:
    """Per step, how often one block followed another; from the first of the step to the one after
    its return, which is not of the library."""
    pairs: Counter[tuple[Block, Block]] | None = None
    before = None
    entry = next(at for at, one in code.items() if one.function == step)
    for block in blocks:
        first = block.addresses[0]
        if pairs is not None:
            pairs[before, block] += 1
            if code[first].function in CALLERS:
                yield pairs
                pairs = None
        elif first == entry:
            pairs = Counter()
        before = block


def _unfolded(blocks: Counter[tuple[Block, Block]]) -> Counter[tuple[int, int]]:
    """How often one instruction followed another."""
    pairs: Counter[tuple[int, int]] = Counter()
    for (block, after), times in blocks.items():
        for pair in pairwise((*block.addresses, after.addresses[0])):
            pairs[pair] += times
    return pairs


def _sum(steps: Iterable[Counter[tuple[int, int]]], code: dict[int, Instruction]) -> Trace:
    steps = list(steps)
    trace = Trace(len(steps))
    pairs = sum(steps, Counter())
    stalls: Counter[str] = Counter()
    for (at, after), times in pairs.items():
        here, there = code[at], code[after]
        taken = after != at + here.size
        if there.function not in CALLERS:
            stalls[there.function] += times * (bool(here.written and here.written in there.read)
                                               - int(here.memory and there.memory))
        for tally in (trace.total, trace.functions.setdefault(here.function, Tally())):
            tally.instructions += times
            tally.cycles += times * (here.cycles + (REFILL if taken else 0))
        if there.function not in {here.function, *CALLERS}:
            trace.functions.setdefault(there.function, Tally()).entries += times
    for function, cycles in stalls.items():
        trace.total.cycles += cycles
        trace.functions[function].cycles += cycles
    return trace
