# SPDX-License-Identifier: MIT
"""Flash and RAM of one estimator, from the linker's map and the symbols of a replay program.

Flash is what the linker keeps of the library's code and of the model's tables.  The compiler's own
routines (arithmetic without an FPU, memcpy) are not in it: a firmware has them anyway.
"""

import re
import subprocess

from blw.cost.programs import Program

_SECTION = re.compile(r"^ \.(text|rodata|data\.rel\.ro)\S*\s+0x[0-9a-f]+\s+0x([0-9a-f]+) (\S+)$",
                      re.MULTILINE)
_STORAGE = ("estimator", "estimator_mem")


def flash_bytes(program: Program) -> int:
    """Code and tables of the estimator that is linked into the program."""
    return sum(size for _, size, owner in _sections(program)
               if any(f"lib{archive}.a(" in owner for archive in program.archives))


def table_bytes(program: Program) -> int:
    """The tables of the model alone."""
    return sum(size for kind, size, owner in _sections(program)
               if kind != "text" and f"lib{program.archives[1]}.a(" in owner)


def linked_objects(program: Program) -> set[str]:
    """The sources of the library of which the linker kept something."""
    member = re.compile(rf"lib{program.archives[0]}\.a\((\w+\.c)\.")
    owners = (owner for _, _, owner in _sections(program))
    return {found[1] for found in map(member.search, owners) if found}


def _sections(program: Program) -> list[tuple[str, int, str]]:
    """Kind, size and object file of every section that the linker kept."""
    text = program.map.read_text(encoding="utf-8").split("Linker script and memory map")[1]
    one_line = re.sub(r"^( \.\S+)\n +", r"\1 ", text, flags=re.MULTILINE)
    return [(kind, int(size, 16), owner) for kind, size, owner in _SECTION.findall(one_line)]


def ram_bytes(program: Program) -> int:
    """State and memory of the estimator."""
    listing = subprocess.run([program.target.tools + "nm", "-S", program.path], check=True,
                             capture_output=True, text=True).stdout
    rows = (line.split() for line in listing.splitlines())
    return sum(int(row[1], 16) for row in rows if row[-1] in _STORAGE)
