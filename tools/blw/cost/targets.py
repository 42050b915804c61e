# SPDX-License-Identifier: MIT
"""The microcontrollers that costs are measured for, as QEMU has them."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from blw.build import ROOT
from blw.errors import BulwarkError
from blw.options import suggestion

#: With this option every instruction takes 2^7 ns of the emulated time, which the 25 MHz of the
#: MPS2 boards' timers turn into 3.2 ticks.
ICOUNT = "-icount shift=7"
TICKS_PER_INSTRUCTION = 3.2


@dataclass(frozen=True)
class Target:
    """One core; machine is the QEMU machine that has it, or a core with all its instructions."""

    name: str
    title: str
    toolchain: str
    machine: str
    qemu: str = "qemu-system-arm"
    tools: str = "arm-none-eabi-"

    @property
    def toolchain_file(self) -> Path:
        return ROOT / "port" / "cmake" / f"{self.toolchain}.cmake"


TARGETS = {target.name: target for target in (
    Target("m0p", "Cortex-M0+", "cortex-m0plus", "mps2-an385"),
    Target("m4f", "Cortex-M4F", "cortex-m4f", "mps2-an386"),
    Target("m7", "Cortex-M7", "cortex-m7", "mps2-an500"),
)}


def named(names: Sequence[str]) -> list[Target]:
    """The targets with these names, all without names.  Raises BulwarkError for an unknown one."""
    for name in names:
        if name not in TARGETS:
            raise BulwarkError(f"unknown target '{name}'; {suggestion(name, TARGETS)}")
    return [TARGETS[name] for name in names or TARGETS]
