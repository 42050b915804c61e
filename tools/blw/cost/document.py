# SPDX-License-Identifier: MIT
"""docs/cost.md: the cost table as a document."""

from collections.abc import Iterable, Sequence
from typing import Any

from blw.cost.cases import BENIGN_STEPS, CASES, SETTLING_STEPS
from blw.cost.targets import TARGETS
from blw.methods import REGISTRY

COLUMNS = {"instructions_typical": "typical", "instructions_mean_attacked": "attacked",
           "instructions_worst": "worst", "flash_bytes": "flash", "ram_bytes": "RAM",
           "stack_bytes": "stack"}

HEAD = f"""# What a step costs

Made by `tools/bulwark bench --write docs/cost.md`; the tests hold a part of it against a new
measurement.

Executed instructions of one step, from the first of `blw_<method>_step` to its return: the median
of {BENIGN_STEPS} steps without attack, the mean of 200 attacked steps, the most of all. The logs
are those of `host_sim/scenarios/<model>_cost.toml`, which the simulator makes alike every time;
the first {SETTLING_STEPS} steps serve to settle. QEMU counts exactly (`-icount shift=7` and a timer
of the board; what an empty step takes is subtracted), so every run gives the same numbers. float32,
gcc -O3, `-ffp-contract=off`. The Cortex-M0+ has no FPU: its instructions include the compiler's
arithmetic.

Flash is the code of the library that the linker keeps for this one method, and its tables and
straight-line kernels; the compiler's own routines are not in it. RAM is state and memory of one
estimator. Stack is the deepest path through the call graph of init, reset and step, without
interrupts. All in bytes. The library has no `.data` and no `.bss`.
"""


def text(rows: Sequence[dict[str, Any]], refused: Sequence[dict[str, str]]) -> str:
    """The document."""
    lines = [HEAD]
    for target in dict.fromkeys(row["target"] for row in rows):
        own = [row for row in rows if row["target"] == target]
        lines += [f"## {TARGETS[target].title}", *_table_head(), *map(line, own), ""]
    lines += ["## Refused", *(f"- {one['model']}, `{one['method']}`: {one['reason']}"
                              for one in refused), ""]
    return "\n".join([*lines, *_options()])


def line(row: dict[str, Any]) -> str:
    """A row of the table."""
    figures = " | ".join(f"{row[key]:,.0f}" for key in COLUMNS)
    return f"| {row['model']} | `{row['method']}` | {figures} |"


def _table_head() -> list[str]:
    return ["| model | method | " + " | ".join(COLUMNS.values()) + " |",
            "|---|---|" + "---:|" * len(COLUMNS)]


def _options() -> Iterable[str]:
    yield "## Models"
    for name, case in CASES.items():
        given = ", ".join(f"`{method}.{key} = {value}`" for method in REGISTRY
                          for key, value in case.options.get(method, {}).items())
        yield f"- {name}: `host_sim/models/{name}.toml`" + (f", with {given}" if given else "")
    yield ""
