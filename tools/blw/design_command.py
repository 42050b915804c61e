# SPDX-License-Identifier: MIT
"""`bulwark design`: a model file to NAME.json and the C sources of its tables."""

from pathlib import Path
from typing import Any

import click

from blw import dbc, kalman
from blw.analysis.observability import sparse_index
from blw.atomic import write_files
from blw.design import Design, design_all, document, json_text, small
from blw.emit_c import files
from blw.errors import DesignError
from blw.kalman import mode_text
from blw.model import Model, load
from blw.modes import modes_of
from blw.progress import steps


@click.command(short_help="A model to tables: NAME.json, NAME_model.h and .c, NAME.dbc.")
@click.argument("model", type=click.Path(path_type=Path))
@click.option("--out", required=True, type=click.Path(path_type=Path, file_okay=False),
              help="Folder for NAME.json, NAME_model.h, NAME_model.c, NAME.dbc; made if missing.")
@click.option("--method", "methods", multiple=True, metavar="METHOD",
              help="Method to design beside kalman; may be repeated.  Default: all that accept "
                   "the model.")
@click.option("--small", "is_small", is_flag=True,
              help="Leave straight-line code out of NAME_model.c: less flash, more instructions, "
                   "the same bits.")
@click.option("--json", "as_json", is_flag=True, help="Print the figures as JSON.")
def design(model: Path, out: Path, methods: tuple[str, ...], is_small: bool,
           as_json: bool) -> None:
    """Compute the tables of MODEL (a TOML file) for the library and the simulator."""
    with steps("design") as progress:
        # the simulator shows every method beside the Kalman filter
        wanted = list(dict.fromkeys((kalman.NAME, *methods))) if methods else None
        result = design_all(load(model), wanted, progress)
    if not result.methods:
        reasons = "; ".join(f"{name}: {reason}" for name, reason in result.refused.items())
        raise DesignError(f"{model}: no method accepts this model: {reasons}")
    text = json_text(document(result))
    name = result.model.name
    written = write_files(out, {f"{name}.json": text,
                                **files(small(result) if is_small else result),
                                f"{name}.dbc": dbc.text(result.model)})
    summary = _summary(result, written)
    click.echo(json_text(summary) if as_json else _text(result, written), nl=not as_json)


def _warnings(model: Model) -> list[str]:
    """Why no method can do what is asked of it, if so; `analyze` tells more."""
    if model.p == 0:
        return []
    try:
        strong = [model.sensors.index(name) for name in model.strong]
        index = sparse_index(modes_of(model.A, model.C).modes, model.units, strong)
    except DesignError as error:
        return [f"whether p = {model.p} is too many is not known: {error}"]
    if index.upper >= 2 * model.p or index.weakest is None:
        return []
    what = "groups" if model.groups else "sensors"
    return [f"p = {model.p}, but the state follows from the {what} with at most "
            f"{max(0, index.upper // 2)} of them attacked: too few see the mode "
            f"{mode_text(index.weakest)}; see bulwark analyze"]


def _summary(result: Design, written: list[Path]) -> dict[str, Any]:
    model = result.model
    return {"name": model.name, "model_sha256": model.sha256,
            "n": model.n, "m": model.m, "l": model.l, "p": model.p,
            "methods": {name: designed.info for name, designed in result.methods.items()},
            "refused": result.refused,
            "warnings": _warnings(model),
            "files": [str(path) for path in written]}


def _text(result: Design, written: list[Path]) -> str:
    model = result.model
    lines = [f"{model.name}: n = {model.n}, m = {model.m}, l = {model.l}, p = {model.p}"]
    for name, designed in result.methods.items():
        figures = ", ".join(f"{key} {_figure(value)}" for key, value in designed.info.items()
                            if isinstance(value, (int, float, str)))
        lines.append(f"  {name:<10} {figures}")
    for name, reason in result.refused.items():
        lines.append(f"  {name:<10} refused: {reason}")
    lines += [f"warning: {warning}" for warning in _warnings(model)]
    lines += [f"wrote {path}" for path in written]
    return "\n".join(lines)


def _figure(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)
