# SPDX-License-Identifier: MIT
"""The replay programs of port/replay: built for a target, run in QEMU, and what they wrote."""

import os
import subprocess
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.lib.recfunctions import repack_fields
from numpy.typing import NDArray

from blw.build import BUILD, ROOT, StepFailed, build_programs
from blw.cost.cases import Prepared
from blw.cost.targets import NS_PER_INSTRUCTION, Target

QEMU = ROOT / "port" / "qemu.sh"

#: Of the empty step that calibrates the counter: it loads BLW_OK and returns.
EMPTY_STEP = 2


@dataclass(frozen=True)
class Program:
    """One estimator on one target, or on the host if target is None (of the preset given then)."""

    model: str
    method: str
    target: Target | None
    preset: str
    variant: str = ""

    @classmethod
    def on(cls, target: Target, model: str, method: str, variant: str = "") -> "Program":
        return cls(model, method, target, target.name, variant)

    @property
    def name(self) -> str:
        return f"{self.model}.{self.method}{self.variant}"

    @property
    def path(self) -> Path:
        return BUILD / self.preset / "port" / "replay" / self.name

    @property
    def archives(self) -> tuple[str, str]:
        """CMake's names of the library and of the model that are linked."""
        if not self.variant:
            return "blw", f"blw_model_{self.model}"
        library = f"blw_{self.variant[1:]}"
        return library, f"{library}_{self.model}"

    @property
    def map(self) -> Path:
        """What the linker says about it."""
        return self.path.with_name(f"{self.name}.map")

    @property
    def real(self) -> str:
        """NumPy's name of blw_real_t."""
        return "<f8" if self.preset.endswith("f64") else "<f4"


def build(programs: Sequence[Program]) -> None:
    """Build programs, a preset at a time.  Raises StepFailed."""
    for preset in dict.fromkeys(program.preset for program in programs):
        build_programs(preset, [program.name for program in programs if program.preset == preset])


@dataclass(frozen=True, eq=False)
class Replay:
    """What a replay program wrote: a record per step (port/replay/replay.c), and the ticks that the
    counter needs for itself around an empty step."""

    steps: NDArray[np.void]
    empty_ticks: int

    def outputs(self) -> NDArray[np.void]:
        """All output words of the estimator, that is, the records without the ticks."""
        names = [name for name in self.steps.dtype.names if name != "ticks"]
        return repack_fields(self.steps[names])

    def instructions(self, target: Target) -> NDArray[np.int64]:
        """Executed by every step, from its first to its return, [steps]."""
        ticks = self.steps["ticks"].astype(np.int64) - self.empty_ticks
        executed = np.rint(ticks * target.tick_ns / NS_PER_INSTRUCTION)
        return executed.astype(np.int64) + EMPTY_STEP


def run(program: Program, prepared: Prepared, options: str = "") -> Replay:
    """Replay the log of the case, with further options of QEMU.  Raises StepFailed."""
    target = program.target
    environment = os.environ | {"BLW_QEMU_OPTIONS": options}
    emulator = [QEMU, target.qemu, target.machine] if target else []
    with tempfile.TemporaryDirectory(prefix="bulwark.") as name:
        log, out = Path(name, "log"), Path(name, "out")
        log.write_bytes(prepared.log.packed(program.real))
        done = subprocess.run([*emulator, program.path, log, out], capture_output=True, text=True,
                              env=environment)
        if done.returncode != 0:
            raise StepFailed(f"{program.preset}: {program.name}: status {done.returncode} "
                             + done.stderr.strip())
        return _decode(out.read_bytes(), program.real, prepared)


def _decode(data: bytes, real: str, prepared: Prepared) -> Replay:
    model = prepared.design.model
    layout = np.dtype([("ticks", "<u4"), ("status", "<i4"), ("x_hat", real, (model.n,)),
                       ("suspicion", real, (model.m,)), ("statistic", real), ("threshold", real),
                       ("bound", real), ("excluded", "<u8"), ("used", "<u8"),
                       ("iterations", "<u2"), ("outcome", "u1"), ("flags", "u1")])
    return Replay(np.frombuffer(data, layout, offset=4), int.from_bytes(data[:4], "little"))
