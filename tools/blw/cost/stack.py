# SPDX-License-Identifier: MIT
"""Worst-case stack of one estimator: the deepest path through the call graph that gcc leaves.

Routines of the compiler's library have no such graph; theirs is read off the disassembly, where the
sum over all of a routine's pushes is an upper bound.  A call through a pointer may go to any
straight-line kernel of the model that the linker kept, and to any function of the const objects
<name>_ops in which modules offer themselves to each other; not back to where it comes from, nor to
what calls that by name, since the library has no recursion, nor to its own file, where calls have
names.  Recursion and a frame of unknown size are errors, not guesses.
"""

import re
import subprocess
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

from blw.build import BUILD, StepFailed
from blw.cost.programs import Program
from blw.cost.sizes import linked_objects

#: How gcc names what a pointer points to.
_POINTER = "__indirect_call"
_NODE = re.compile(r'^node: \{ title: "([^"]+)" label: "([^"]*)"', re.MULTILINE)
_EDGE = re.compile(r'^edge: \{ sourcename: "([^"]+)" targetname: "([^"]+)"', re.MULTILINE)
_FRAME = re.compile(r"(\d+) bytes \((static|dynamic,bounded)\)")
_FUNCTION = re.compile(r"^([0-9a-f]+) <(\w+)>:\n((?:.+\n)*)", re.MULTILINE)
_PUSH = re.compile(r"\t(?:v?push|stmdb\tsp!,|str.*\[sp, #-).*")
_RESERVE = re.compile(r"\t(?:sub(?:\.w)?\tsp,(?: sp,)? #|addi\tsp,sp,-)(\d+)")
_OPS = re.compile(r"^([0-9a-f]+) ([0-9a-f]+) [rRtT] (blw_\w+_ops)$", re.MULTILINE)
_DUMP = re.compile(r"^ [0-9a-f]+ ((?:[0-9a-f]+ )+) ", re.MULTILINE)
_CALL = re.compile(r"\t(?:b|bl|b\.w|b\.n|j|jal|jalr)\t\S*?[0-9a-f]+(?:\(ra\))? <(\w+)>")


@dataclass
class CallGraph:
    """Bytes of every function's frame, and whom it calls."""

    frames: dict[str, int] = field(default_factory=dict)
    calls: dict[str, set[str]] = field(default_factory=dict)

    def named(self) -> set[str]:
        """Everything that is called, and has no frame."""
        return set().union(*self.calls.values()) - self.frames.keys()

    def forget(self, names: Iterable[str]) -> None:
        """Nobody calls these: gcc lists all routines of its library that an operation may need, the
        linker keeps those that are called."""
        gone = set(names)
        for callees in self.calls.values():
            callees -= gone

    def deepest(self, root: str, path: tuple[str, ...] = ()) -> int:
        """Bytes of the deepest path from root.  Raises StepFailed if no bound is known."""
        if root in path and root != _POINTER:
            raise StepFailed(f"recursion: {' -> '.join((*path, root))}")
        if root not in self.frames:
            raise StepFailed(f"the stack of {root} is not known")
        callees = self.calls.get(root, set())
        if root == _POINTER:
            callees = {name for name in callees.difference(path)
                       if not _share_file(name, path[-1]) and self.reached(name).isdisjoint(path)}
        below = (self.deepest(callee, (*path, root)) for callee in callees)
        return self.frames[root] + max(below, default=0)

    def reached(self, root: str) -> set[str]:
        """What root calls by name, directly or not."""
        found: set[str] = set()
        waiting = [root]
        while waiting:
            new = self.calls.get(waiting.pop(), set()) - found - {_POINTER}
            found |= new
            waiting += new
        return found


def _share_file(one: str, other: str) -> bool:
    """Both are static functions of one source: gcc calls them FILE:NAME."""
    return ":" in one and one.partition(":")[0] == other.partition(":")[0]


def stack_bytes(program: Program, owner: str) -> int:
    """The most that init, reset and step of the module `owner` need."""
    symbols = _said(program, "nm", "-S")
    graph = CallGraph()
    replays = BUILD / program.preset / "port" / "replay" / "CMakeFiles"
    whole, model = (f"{archive}.dir" for archive in program.archives)
    folder = replays if program.variant else BUILD / program.preset / "lib" / "CMakeFiles"
    kernels = _add_compiled(graph, replays / model)
    library = _add_compiled(graph, folder / whole)
    linked = {line.split()[-1] for line in symbols.splitlines()}
    graph.frames[_POINTER] = 0
    graph.calls[_POINTER] = {name for name in kernels if name.rpartition(":")[2] in linked}
    graph.calls[_POINTER] |= _offered(program, symbols, library, f"blw_{owner}_ops")
    _add_library(graph, _said(program, "objdump", "-d"), symbols)
    graph.forget(name for name in graph.named() if name not in linked)
    return max(graph.deepest(f"blw_{owner}_{verb}") for verb in ("init", "reset", "step"))


def _add_compiled(graph: CallGraph, folder: Path) -> set[str]:
    """What gcc says about the sources of one CMake target; returns their functions."""
    names: set[str] = set()
    for path in folder.rglob("*.ci"):
        text = path.read_text(encoding="utf-8")
        for name, label in _NODE.findall(text):
            frame = _FRAME.search(label)
            if frame:
                graph.frames[name] = int(frame[1])
                names.add(name)
        for caller, callee in _EDGE.findall(text):
            graph.calls.setdefault(caller, set()).add(callee)
    return names


def _offered(program: Program, symbols: str, library: set[str], own: str) -> set[str]:
    """The library's functions that linked objects <name>_ops point to, but not those of `own`:
    through that one a firmware calls the estimator, and nobody inside it does."""
    names = {line.split()[0]: line.split()[-1] for line in symbols.splitlines()}
    linked = linked_objects(program)
    found: set[str] = set()
    for address, size, name in _OPS.findall(symbols):
        if name != own:
            short = {names.get(word) for word in _words(program, int(address, 16), int(size, 16))}
            found |= {node for node in library if node.rpartition(":")[2] in short
                      and (":" not in node or Path(node.partition(":")[0]).name in linked)}
    return found


def _words(program: Program, address: int, size: int) -> set[str]:
    """The addresses of functions in an object, as nm writes them."""
    dump = _said(program, "objdump", "-s", f"--start-address={address}",
                 f"--stop-address={address + size}")
    data = bytes.fromhex("".join(_DUMP.findall(dump)).replace(" ", ""))
    width = 8 if "elf64" in dump else 4
    numbers = (int.from_bytes(data[at:at + width], "little") for at in range(0, size, width))
    thumb = program.target.tools.startswith("arm")  # the lowest bit of an address says so
    return {f"{number & ~1 if thumb else number:0{2 * width}x}" for number in numbers}


def _add_library(graph: CallGraph, listing: str, symbols: str) -> None:
    """What is linked and has no node: routines of libgcc and libc.

    The disassembly names a routine once; its other names are symbols of the same address.
    """
    aliases: dict[str, list[str]] = {}
    for address, *_, name in (line.split() for line in symbols.splitlines()):
        aliases.setdefault(address, []).append(name)
    for address, shown, body in _FUNCTION.findall(listing):
        calls = {callee for callee in _CALL.findall(body) if callee != shown}
        for name in {shown, *aliases[address]} - graph.frames.keys():
            graph.frames[name] = _pushed(body)
            graph.calls[name] = calls


def _said(program: Program, tool: str, *options: str) -> str:
    return subprocess.run([program.target.tools + tool, *options, program.path], check=True,
                          capture_output=True, text=True).stdout


def _pushed(body: str) -> int:
    total = 0
    for line in body.splitlines():
        reserve = _RESERVE.search(line)
        if reserve:
            total += int(reserve[1])
        elif _PUSH.search(line):
            total += _register_bytes(line)
    return total


def _register_bytes(line: str) -> int:
    """Of Arm's "push {r4-r7, lr}", "stmdb sp!, {...}", "vpush {d8-d9}", "str.w r4, [sp, #-8]!"."""
    listed = re.search(r"\{(.*)\}", line)
    if not listed:
        return int(re.search(r"#-(\d+)", line)[1])
    count = 0
    for part in listed[1].split(","):
        first, _, last = part.strip().partition("-")
        count += int(last[1:]) - int(first[1:]) + 1 if last else 1
    return count * (8 if "{d" in line else 4)
