# SPDX-License-Identifier: MIT
"""What a step would take if the compiler were allowed to contract products and sums: fewer
instructions, other bits, and more modelled cycles."""

from dataclasses import replace
from typing import Any

from blw.cost import cycles, programs
from blw.cost.cases import Prepared
from blw.cost.measure import Bench
from blw.cost.programs import Program

MODEL = "liu5"
VARIANT = ".contracted"

#: The dense symmetric product of guard's step, straight-line: l = S e with N = 15.
KERNEL = ("guard", "guard_multiply")


def measure(bench: Bench, rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """For every method of the model that the bench has on the target of the cycle model:
    "what", and per step "instructions" and "cycles", both [as shipped, contracted]."""
    pairs = [(program, replace(program, variant=VARIANT)) for program in bench.programs
             if (program.target.name, program.model) == (cycles.TARGET, MODEL)]
    programs.build([contracted for _, contracted in pairs])
    typical = {row["method"]: row["instructions_typical"] for row in rows
               if (row["target"], row["model"]) == (cycles.TARGET, MODEL)}
    found = []
    for pair in pairs:
        found += _compared(pair, bench.prepared[MODEL], typical[pair[0].method])
    return found


def _compared(pair: tuple[Program, Program], prepared: Prepared, typical: int,
              ) -> list[dict[str, Any]]:
    traces = [cycles.follow(program, prepared, typical) for program in pair]
    wanted = {pair[0].method: [trace.total for trace in traces]}
    if pair[0].method == KERNEL[0]:
        wanted[KERNEL[1]] = [trace.functions[KERNEL[1]] for trace in traces]
    return [{"what": what,
             "instructions": [tally.instructions / trace.steps
                              for tally, trace in zip(tallies, traces, strict=True)],
             "cycles": [tally.cycles / trace.steps
                        for tally, trace in zip(tallies, traces, strict=True)]}
            for what, tallies in wanted.items()]
