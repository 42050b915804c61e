# SPDX-License-Identifier: MIT
"""Rows of the cost table: sizes and stack of every estimator, and instructions of its steps."""

import os
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import dataclass, replace
from multiprocessing import get_context
from typing import Any

import numpy as np

from blw.build import StepFailed
from blw.cost import programs
from blw.cost.cases import BENIGN_STEPS, Case, Prepared, owner, prepare
from blw.cost.cycles import typical_cycles
from blw.cost.programs import Program
from blw.cost.sizes import flash_bytes, ram_bytes
from blw.cost.stack import stack_bytes
from blw.cost.targets import ICOUNT, Target

#: Built for size and without straight-line code; of this core and model the document tells it.
SMALL = ".small"
SMALL_EXAMPLE = ("m4f", "liu5")


@dataclass(frozen=True, eq=False)
class Bench:
    """What is to be measured: programs per target, and the refusals."""

    prepared: dict[str, Prepared]
    programs: list[Program]
    refused: list[dict[str, str]]


def plan(cases: Sequence[Case], targets: Sequence[Target], methods: Sequence[str],
         variant: str = "") -> Bench:
    """Design the cases and build the programs of all targets; without methods, of every one that
    accepts the model.  variant: as port/replay/CMakeLists.txt has them, behind a dot."""
    prepared = _prepared(cases)
    refused = [{"model": name, "method": method, "reason": reason}
               for name, one in prepared.items() for method, reason in one.design.refused.items()
               if not methods or method in methods]
    wanted = [Program.on(target, name, method, variant) for target in targets
              for name, one in prepared.items() for method in one.design.methods
              if not methods or method in methods]
    programs.build(wanted)
    return Bench(prepared, wanted, refused)


def _prepared(cases: Sequence[Case]) -> dict[str, Prepared]:
    """By name; several cases are designed at the same time."""
    names = [case.name for case in cases]
    if len(cases) == 1:
        return dict(zip(names, map(prepare, cases), strict=True))
    with ProcessPoolExecutor(os.cpu_count(), get_context("forkserver")) as pool:
        return dict(zip(names, pool.map(prepare, cases), strict=True))


def small(bench: Bench) -> list[dict[str, Any]]:
    """Rows of one model on one core, as they are if built for size."""
    wanted = [replace(program, variant=SMALL) for program in bench.programs
              if (program.target.name, program.model) == SMALL_EXAMPLE]
    programs.build(wanted)
    return list(measure(replace(bench, programs=wanted)))


def sizes(bench: Bench) -> Iterator[dict[str, Any]]:
    """One row per program: sizes and stack only."""
    for program in bench.programs:
        yield _sizes(program, bench.prepared[program.model])


def measure(bench: Bench) -> Iterator[dict[str, Any]]:
    """One row per program, in the order of the plan; some programs run at the same time."""
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        yield from pool.map(lambda program: _row(program, bench.prepared[program.model]),
                            bench.programs)


def _sizes(program: Program, prepared: Prepared) -> dict[str, Any]:
    row = {"method": program.method, "model": program.model, "target": program.target.name,
           "flash_bytes": flash_bytes(program), "ram_bytes": ram_bytes(program),
           "stack_bytes": stack_bytes(program, owner(prepared.design, program.method))}
    options = prepared.case.options.get(program.method)
    return {**row, "options": dict(options)} if options else row


def _row(program: Program, unsettled: Prepared) -> dict[str, Any]:
    prepared = unsettled.settled_for(program.method)
    replay = programs.run(program, prepared, ICOUNT)
    if np.any(replay.steps["status"] != 0) or len(replay.steps) != len(prepared.log.y):
        raise StepFailed(f"{program.target.name}: {program.name}: a step was refused")
    counts = replay.instructions(program.target)
    start, attack = prepared.settling, prepared.settling + BENIGN_STEPS
    benign, attacked = counts[start:attack], counts[attack:]
    typical = int(np.median(benign))
    return {**_sizes(program, prepared),
            "instructions_typical": typical,
            "instructions_mean_attacked": round(float(attacked.mean()), 1),
            "instructions_worst": int(counts.max()),
            "cycles_typical": typical_cycles(program, prepared, typical)}
