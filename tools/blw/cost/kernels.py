# SPDX-License-Identifier: MIT
"""What one call of the dense kernels takes, by following steps of the programs that call them."""

from dataclasses import dataclass
from typing import Any

from blw.cost import cycles
from blw.cost.measure import Bench


@dataclass(frozen=True)
class Kernel:
    """A function that calls no other; terms: its multiply-adds, where it is one dense product."""

    model: str
    method: str
    function: str
    what: str
    terms: int | None = None


KERNELS = (
    Kernel("liu5", "kalman", "kalman_step", "Kalman step with input"),
    Kernel("liu5", "lasso", "lasso_jordan_step", "local filters of all sensors, with input"),
    Kernel("liu5", "lasso", "lasso_l1_fast_certify", "certificate of nu = 0, and x_hat"),
    Kernel("liu5", "lasso", "lasso_l1_fast_symv", "W v, N = 15", 15 * 15),
    Kernel("random6", "lasso", "blw_la_symv", "S v, N = 48, by loops", 48 * 48),
)


def measure(bench: Bench, rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """For every kernel that the bench has on the target of the cycle model: "kernel", and per call
    "instructions" and "cycles"."""
    typical = {(row["model"], row["method"]): row["instructions_typical"] for row in rows
               if row["target"] == cycles.TARGET}
    traces = {(program.model, program.method): cycles.follow(
        program, bench.prepared[program.model], typical[program.model, program.method])
        for program in bench.programs
        if program.target.name == cycles.TARGET
        and any((program.model, program.method) == (one.model, one.method) for one in KERNELS)}
    return [_per_call(one, traces[one.model, one.method]) for one in KERNELS
            if (one.model, one.method) in traces]


def _per_call(kernel: Kernel, trace: cycles.Trace) -> dict[str, Any]:
    tally = trace.functions[kernel.function]
    return {"kernel": kernel, "instructions": tally.instructions / tally.entries,
            "cycles": tally.cycles / tally.entries}
