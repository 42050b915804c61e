# SPDX-License-Identifier: MIT
"""`bulwark bench` and `bulwark size`: what every method costs on a microcontroller."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import click
from tqdm import tqdm

from blw.atomic import write_files
from blw.cost import cases, contraction, document, kernels, measure, targets
from blw.design import json_text
from blw.errors import BulwarkError
from blw.methods import REGISTRY
from blw.options import suggestion

SIZES = {"flash_bytes": "flash", "ram_bytes": "RAM", "stack_bytes": "stack"}
WORK = {"instructions_typical": "typical", "instructions_mean_attacked": "attacked",
        "instructions_worst": "worst", "cycles_typical": "cycles"}

Names = tuple[str, ...]


def _shared_options(command: Callable[..., None]) -> Callable[..., None]:
    for option in reversed((
        click.option("--target", "target_names", multiple=True, metavar="TARGET",
                     help=f"One of {', '.join(targets.MEASURABLE)}; may be repeated.  "
                          f"Default: {', '.join(targets.DEFAULT)}."),
        click.option("--model", "model_names", multiple=True, metavar="MODEL",
                     help=f"One of {', '.join(cases.CASES)}; may be repeated.  Default: all."),
        click.option("--method", "methods", multiple=True, metavar="METHOD",
                     help="May be repeated.  Default: all that accept the model."),
        click.option("--small", "is_small", is_flag=True,
                     help="Built for size (-Os), models as `design --small` writes them."),
        click.option("--json", "as_json", is_flag=True, help="Print the figures as JSON."),
    )):
        command = option(command)
    return command


@click.command(short_help="Instructions, flash, RAM and stack per method.")
@_shared_options
@click.option("--write", "path", type=click.Path(path_type=Path, dir_okay=False),
              help="Also write the figures into this file, as docs/cost.md has them.")
def bench(as_json: bool, path: Path | None, **names: Any) -> None:
    """Measure executed instructions per step, flash, RAM and worst-case stack of every method.

    Typical is the median of 50 steps without attack, attacked the mean of 200 attacked steps, worst
    the most of all steps.  The programs run in QEMU, which counts exactly.  Cycles are those of a
    typical step by a model of the Cortex-M4F, see docs/cost.md.
    """
    plan = _plan(**names)
    rows = list(tqdm(measure.measure(plan), "measuring", len(plan.programs), leave=False,
                     disable=None))
    if path:
        content = document.text(rows, kernels.measure(plan, rows), contraction.measure(plan, rows),
                                measure.small(plan), plan.refused)
        write_files(path.parent, {path.name: content})
    _print(rows, plan, WORK | SIZES, as_json)


@click.command(short_help="Flash, RAM and stack per method.")
@_shared_options
def size(as_json: bool, **names: Any) -> None:
    """Tell flash, RAM and worst-case stack of every method, without running anything."""
    plan = _plan(**names)
    _print(list(measure.sizes(plan)), plan, SIZES, as_json)


def _plan(target_names: Names, model_names: Names, methods: Names,
          is_small: bool) -> measure.Bench:
    for method in methods:
        if method not in REGISTRY:
            raise BulwarkError(f"unknown method '{method}'; {suggestion(method, REGISTRY)}")
    return measure.plan(cases.named(model_names), targets.named(target_names), methods,
                        measure.SMALL if is_small else "")


def _print(rows: list[dict[str, Any]], plan: measure.Bench, columns: dict[str, str],
           as_json: bool) -> None:
    if as_json:
        click.echo(json_text({"rows": rows, "refused": plan.refused}), nl=False)
        return
    click.echo("\n".join(_table(rows, columns)))
    for one in plan.refused:
        click.echo(f"{one['model']}: {one['method']} refused: {one['reason']}")


def _table(rows: Iterable[dict[str, Any]], columns: dict[str, str]) -> Iterable[str]:
    yield (f"{'target':<11}{'model':<10}{'method':<10}"
           + "".join(f"{title:>11}" for title in columns.values()))
    for row in rows:
        yield (f"{row['target']:<11}{row['model']:<10}{row['method']:<10}"
               + "".join(f"{document.figure(row[key]):>11}" for key in columns))
