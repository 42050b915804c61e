# SPDX-License-Identifier: MIT
"""Worst-case stack of one estimator: the deepest path through the call graph that gcc leaves.

Routines of the compiler's library have no such graph; theirs is read off the disassembly, where the
sum over all of a routine's pushes is an upper bound.  A call through a pointer may go to any
function of the model that the linker kept: its straight-line kernels.  Recursion and a frame of
unknown size are errors, not guesses.
"""

import re
import subprocess
from dataclasses import dataclass, field
from pathlib import Path

from blw.build import BUILD, StepFailed
from blw.cost.programs import Program

#: How gcc names what a pointer points to.
_POINTER = "__indirect_call"
_NODE = re.compile(r'^node: \{ title: "([^"]+)" label: "([^"]*)"', re.MULTILINE)
_EDGE = re.compile(r'^edge: \{ sourcename: "([^"]+)" targetname: "([^"]+)"', re.MULTILINE)
_FRAME = re.compile(r"(\d+) bytes \((static|dynamic,bounded)\)")
_FUNCTION = re.compile(r"^([0-9a-f]+) <(\w+)>:\n((?:.+\n)*)", re.MULTILINE)
_PUSH = re.compile(r"\t(?:v?push|stmdb\tsp!,|str.*\[sp, #-).*")
_RESERVE = re.compile(r"\t(?:sub(?:\.w)?\tsp,(?: sp,)? #|addi\tsp,sp,-)(\d+)")
_CALL = re.compile(r"\t(?:b|bl|b\.w|b\.n|j|jal|jalr)\t\S*?[0-9a-f]+(?:\(ra\))? <(\w+)>")


@dataclass
class CallGraph:
    """Bytes of every function's frame, and whom it calls."""

    frames: dict[str, int] = field(default_factory=dict)
    calls: dict[str, set[str]] = field(default_factory=dict)

    def deepest(self, root: str, path: tuple[str, ...] = ()) -> int:
        """Bytes of the deepest path from root.  Raises StepFailed if no bound is known."""
        if root in path:
            raise StepFailed(f"recursion: {' -> '.join((*path, root))}")
        if root not in self.frames:
            raise StepFailed(f"the stack of {root} is not known")
        below = (self.deepest(callee, (*path, root)) for callee in self.calls.get(root, ()))
        return self.frames[root] + max(below, default=0)


def stack_bytes(program: Program, owner: str) -> int:
    """The most that init, reset and step of the module `owner` need."""
    symbols = _said(program, "nm")
    graph = CallGraph()
    replays = BUILD / program.preset / "port" / "replay" / "CMakeFiles"
    kernels = _add_compiled(graph, replays / f"blw_model_{program.model}.dir")
    _add_compiled(graph, BUILD / program.preset / "lib" / "CMakeFiles" / "blw.dir")
    linked = {line.split()[-1] for line in symbols.splitlines()}
    graph.frames[_POINTER] = 0
    graph.calls[_POINTER] = {name for name in kernels if name.rpartition(":")[2] in linked}
    _add_library(graph, _said(program, "objdump", "-d"), symbols)
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


def _add_library(graph: CallGraph, listing: str, symbols: str) -> None:
    """What is linked and has no node: routines of libgcc and libc.

    The disassembly names a routine once; its other names are symbols of the same address.
    """
    aliases: dict[str, list[str]] = {}
    for address, _, name in (line.split() for line in symbols.splitlines()):
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
