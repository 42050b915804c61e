# SPDX-License-Identifier: MIT
"""The replay programs of port/replay: built for a target, run in QEMU, and what they wrote."""

import os
import subprocess
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from blw.build import ROOT, StepFailed
from blw.cost.cases import FOLDER, Prepared
from blw.cost.targets import ICOUNT, TICKS_PER_INSTRUCTION, Target

OPTIMISATION = "-O3"
QEMU = ROOT / "port" / "qemu.sh"
REAL = "<f4"

#: Of the empty step that calibrates the counter: it loads BLW_OK and returns.
EMPTY_STEP = 2


@dataclass(frozen=True)
class Program:
    """One estimator on one target."""

    target: Target
    model: str
    method: str

    @property
    def name(self) -> str:
        return f"{self.model}.{self.method}"

    @property
    def elf(self) -> Path:
        return folder(self.target) / self.name

    @property
    def map(self) -> Path:
        return folder(self.target) / f"{self.name}.map"


def folder(target: Target) -> Path:
    """Where the programs of a target are built."""
    return FOLDER / target.name


def build(target: Target, programs: Sequence[Program]) -> None:
    """Build programs of one target.  Raises StepFailed."""
    where = folder(target)
    log = where.with_suffix(".log")
    where.mkdir(parents=True, exist_ok=True)
    # gcc leaves the call graph with the stack of every function beside the object files
    flags = f"{OPTIMISATION} -DNDEBUG -fcallgraph-info=su,da"
    configure = ["cmake", "-G", "Ninja", "-S", ROOT / "port" / "replay", "-B", where,
                 "--toolchain", target.toolchain_file, "-DCMAKE_BUILD_TYPE=Release",
                 f"-DCMAKE_C_FLAGS_RELEASE={flags}", f"-DBLW_CASES={FOLDER / 'cases'}"]
    make = ["ninja", "-C", where, f"-j{os.cpu_count()}", *(program.name for program in programs)]
    with log.open("w", encoding="utf-8") as stream:
        for command in (configure, make):
            if subprocess.call(command, stdout=stream, stderr=subprocess.STDOUT) != 0:
                raise StepFailed(f"target {target.name}: {command[0]} failed, see "
                                 f"{log.relative_to(ROOT)}")


def run(program: Program, prepared: Prepared) -> NDArray[np.void]:
    """Replay the log; what the program wrote, a record per step (port/replay/replay.c), with
    `instructions` instead of ticks.  Raises StepFailed."""
    with tempfile.TemporaryDirectory(prefix="bulwark.") as name:
        log, out = Path(name, "log"), Path(name, "out")
        log.write_bytes(prepared.log.packed(REAL))
        target = program.target
        done = subprocess.run([QEMU, target.qemu, target.machine, program.elf, log, out],
                              env=os.environ | {"BLW_QEMU_OPTIONS": ICOUNT}, capture_output=True,
                              text=True)
        if done.returncode != 0:
            raise StepFailed(f"{target.name}: {program.name}: status {done.returncode} "
                             + done.stderr.strip())
        return decode(out.read_bytes(), prepared)


def decode(data: bytes, prepared: Prepared) -> NDArray[np.void]:
    """Records from what a replay program wrote."""
    model = prepared.design.model
    layout = np.dtype([("ticks", "<u4"), ("status", "<i4"), ("x_hat", REAL, (model.n,)),
                       ("suspicion", REAL, (model.m,)), ("statistic", REAL), ("threshold", REAL),
                       ("bound", REAL), ("excluded", "<u8"), ("used", "<u8"),
                       ("iterations", "<u2"), ("outcome", "u1"), ("flags", "u1")])
    return np.frombuffer(data, layout, offset=4), int.from_bytes(data[:4], "little")


def instructions(records: NDArray[np.void], empty_ticks: int) -> NDArray[np.int64]:
    """Executed instructions of every step, from its first to its return, [steps]."""
    ticks = records["ticks"].astype(np.int64) - empty_ticks
    return np.rint(ticks / TICKS_PER_INSTRUCTION).astype(np.int64) + EMPTY_STEP
