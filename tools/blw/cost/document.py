# SPDX-License-Identifier: MIT
"""docs/cost.md: the cost table as a document."""

from collections.abc import Iterable, Sequence
from typing import Any

from blw.cost.cases import BENIGN_STEPS, CASES, SETTLING_STEPS
from blw.cost.cycles import BUDGET, FOLLOWED, REFILL
from blw.cost.targets import TARGETS
from blw.methods import REGISTRY

COLUMNS = {"instructions_typical": "typical", "instructions_mean_attacked": "attacked",
           "instructions_worst": "worst", "cycles_typical": "cycles",
           "flash_bytes": "flash", "ram_bytes": "RAM", "stack_bytes": "stack"}

HEAD = f"""# What a step costs

Made by `tools/bulwark bench --write docs/cost.md`; the tests make it again and compare every line.

Executed instructions of one step, from the first of `blw_<method>_step` to its return: the median
of {BENIGN_STEPS} steps without attack, the mean of 200 attacked steps, the most of all. The logs
are those of `host_sim/scenarios/<model>_cost.toml`, which the simulator makes alike every time;
the first {SETTLING_STEPS} steps serve to settle, a multiple of them where a method warms up for
longer. QEMU counts exactly (`-icount shift=7` and a timer of the board; what an empty step
takes is subtracted), so every run gives the same numbers. float32, gcc -O3, `-ffp-contract=off`.
The Cortex-M0+ has no FPU: its instructions include the compiler's arithmetic.

Cycles are those of the typical step on a Cortex-M4F, by a model. QEMU says which instructions a
step executes, and each takes what Arm's Technical Reference Manual says (DDI 0439, tables 3-1 and
7-1), in memory without wait states: 1 for arithmetic, vadd and vmul; 2 for a load or store, 1 right
behind another one; 1 + n for n words of push, pop and their kin; 3 for a fused or chained multiply
and add; 14 for vdiv and vsqrt, 12 for an integer division; {1 + REFILL} for a branch that is taken
(P = {REFILL}); 1 more where an instruction consumes the result of the FPU arithmetic right before
it. Per row up to {FOLLOWED} steps are followed, at most {BUDGET:,} instructions; their cycles per
instruction times the typical instructions are the figure. Real flash has wait states and a cache:
instructions are the gate, cycles tell what to expect. A dash: no such model of the core, or a step
beyond that bound.

Flash is the code of the library that the linker keeps for this one method, and its tables and
straight-line kernels; the compiler's own routines are not in it. RAM is state and memory of one
estimator. Stack is the deepest path through the call graph of init, reset and step, without
interrupts. All in bytes. The library has no `.data` and no `.bss`.
"""


KERNELS_HEAD = """## Kernels
Of the steps above, one call of what is dense in them: Cortex-M4F, straight-line code for exact
sizes unless it says loops. The Kalman step and the certificate include their checks.

| model | kernel | | instructions | cycles | per multiply-add |
|---|---|---|---:|---:|---:|"""


CONTRACTION = """## With contraction
What a compiler would make of the same step if it might contract a product and a sum into one
rounding (`-ffp-contract=fast`): fewer instructions, but other bits on every target and, since a
fused multiply-add takes three cycles and a vmul and a vadd one each, more modelled cycles.
Cortex-M4F, liu5, per step. `guard_multiply` is the dense symmetric product l = S e of guard,
N = 15, its unit diagonal left out.

| | instructions | contracted | cycles | contracted |
|---|---:|---:|---:|---:|"""


SMALL = """## Built for size
The library with -Os, and a model that `tools/bulwark design --small` wrote: without straight-line
code. The bits are the same. {title}, {model}; `tools/bulwark bench --small` tells it of the others.
"""


def text(rows: Sequence[dict[str, Any]], calls: Sequence[dict[str, Any]],
         contracted: Sequence[dict[str, Any]], small: Sequence[dict[str, Any]],
         refused: Sequence[dict[str, str]]) -> str:
    """The document.  calls, contracted: as kernels.measure() and contraction.measure() return them;
    small: rows, too."""
    lines = [HEAD]
    for target in dict.fromkeys(row["target"] for row in rows):
        own = [row for row in rows if row["target"] == target]
        lines += [f"## {TARGETS[target].title}", *table(own)]
    if small:
        title = TARGETS[small[0]["target"]].title
        lines += [SMALL.format(title=title, model=small[0]["model"]), *table(small)]
    if calls:
        lines += [KERNELS_HEAD, *map(_kernel_line, calls), ""]
    if contracted:
        lines += [CONTRACTION, *map(_contracted_line, contracted), ""]
    lines += ["## Refused", *(f"- {one['model']}, `{one['method']}`: {one['reason']}"
                              for one in refused), ""]
    return "\n".join([*lines, *_options()])


def line(row: dict[str, Any], columns: Iterable[str] = COLUMNS) -> str:
    """A row of the table."""
    figures = " | ".join(figure(row[key]) for key in columns)
    return f"| {row['model']} | `{row['method']}` | {figures} |"


def figure(number: float | None) -> str:
    """A number of a row, or a dash."""
    return "-" if number is None else f"{number:,.0f}"


def _contracted_line(row: dict[str, Any]) -> str:
    figures = " | ".join(map(figure, row["instructions"] + row["cycles"]))
    return f"| `{row['what']}` | {figures} |"


def _kernel_line(row: dict[str, Any]) -> str:
    kernel = row["kernel"]
    each = f"{row['instructions'] / kernel.terms:.2f}" if kernel.terms else ""
    figures = " | ".join(figure(row[key]) for key in ("instructions", "cycles"))
    return f"| {kernel.model} | `{kernel.function}` | {kernel.what} | {figures} | {each} |"


def table(rows: Sequence[dict[str, Any]]) -> list[str]:
    """Head, one line a row, and an empty one."""
    columns = [key for key in COLUMNS if any(row[key] is not None for row in rows)]
    return [*_table_head(columns), *(line(row, columns) for row in rows), ""]


def _table_head(columns: Sequence[str]) -> list[str]:
    return ["| model | method | " + " | ".join(COLUMNS[key] for key in columns) + " |",
            "|---|---|" + "---:|" * len(columns)]


def _options() -> Iterable[str]:
    yield "## Models"
    for name, case in CASES.items():
        given = ", ".join(f"`{method}.{key} = {value}`" for method in REGISTRY
                          for key, value in case.options.get(method, {}).items())
        yield f"- {name}: `host_sim/models/{name}.toml`" + (f", with {given}" if given else "")
    yield ""
