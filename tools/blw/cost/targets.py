# SPDX-License-Identifier: MIT
"""The microcontrollers that the library is built for, as QEMU has them."""

import shutil
from collections.abc import Sequence
from dataclasses import dataclass

from blw.errors import BulwarkError
from blw.options import suggestion

#: With this option every instruction takes 2^7 ns of the emulated time.
ICOUNT = "-icount shift=7"
NS_PER_INSTRUCTION = 128
MPS2_TICK_NS = 40
RISCV_TICK_NS = 1

_RISCV32, _RISCV64 = "qemu-system-riscv32", "qemu-system-riscv64"


@dataclass(frozen=True)
class Target:
    """One core.  name is that of its preset in CMakePresets.json.

    machine  QEMU machine with that core, or with a core that has all of its instructions
    tick_ns  of the counter (port/target/counter.h), None if the machine has none
    """

    name: str
    title: str
    machine: str
    tick_ns: int | None = None
    qemu: str = "qemu-system-arm"

    @property
    def tools(self) -> str:
        """Prefix of the compiler and its tools."""
        return "arm-none-eabi-" if self.qemu.endswith("arm") else "riscv64-unknown-elf-"

    @property
    def is_double(self) -> bool:
        return self.name.endswith("-f64")

    def missing(self) -> list[str]:
        """Programs that this machine would need to build and run for the target."""
        return [name for name in (self.tools + "gcc", self.qemu) if shutil.which(name) is None]


TARGETS = {target.name: target for target in (
    Target("m0p", "Cortex-M0+", "mps2-an385", MPS2_TICK_NS),
    Target("m3", "Cortex-M3", "mps2-an385", MPS2_TICK_NS),
    Target("m4f", "Cortex-M4F", "mps2-an386", MPS2_TICK_NS),
    Target("m7", "Cortex-M7", "mps2-an500", MPS2_TICK_NS),
    Target("m7-f64", "Cortex-M7, double", "mps2-an500", MPS2_TICK_NS),
    Target("m33", "Cortex-M33", "mps2-an505"),
    Target("m55", "Cortex-M55", "mps3-an547"),
    Target("rv32imac", "RV32IMAC", "virt", RISCV_TICK_NS, _RISCV32),
    Target("rv32imafc", "RV32IMAFC", "virt", RISCV_TICK_NS, _RISCV32),
    Target("rv64gc", "RV64GC", "virt", RISCV_TICK_NS, _RISCV64),
    Target("rv64gc-f64", "RV64GC, double", "virt", RISCV_TICK_NS, _RISCV64),
)}
MEASURABLE = [name for name, target in TARGETS.items() if target.tick_ns]
DEFAULT = ("m0p", "m4f", "m7")


def named(names: Sequence[str]) -> list[Target]:
    """The targets with these names, the default ones without names, of those that can count.

    Raises BulwarkError for any other name."""
    for name in names:
        if name not in MEASURABLE:
            raise BulwarkError(f"unknown target '{name}'; {suggestion(name, MEASURABLE)}")
    return [TARGETS[name] for name in names or DEFAULT]
