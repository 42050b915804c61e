# SPDX-License-Identifier: MIT
"""`bulwark joint`: what the compensation factor does, and the figures of [J] as tables."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from blw import joint, joint_analysis, joint_figures, kalman, options
from blw.errors import BulwarkError
from blw.model import Model, load


@click.group("joint")
def joint_group() -> None:
    """Tables about the method `joint`."""


@joint_group.command()
@click.argument("model_path", metavar="MODEL", type=click.Path(path_type=Path))
@click.option("--size", type=click.FloatRange(min=0.0, min_open=True),
              help="Standard deviation of the attack; default: ten times that of the noise.")
@click.option("--eta", "etas", type=click.FloatRange(min=0.0, min_open=True), multiple=True,
              help="A compensation factor to try; may be repeated.  Default: powers of ten.")
@click.option("--json", "as_json", is_flag=True, help="Print the figures as JSON.")
def sweep(model_path: Path, size: float | None, etas: tuple[float, ...], as_json: bool) -> None:
    """Errors of state and attack estimate against eta for an attack of one size on MODEL."""
    result = sweep_model(model_path, size, etas)
    click.echo(json.dumps(result, indent=2) if as_json else _sweep_text(result))


def sweep_model(model_path: Path, size: float | None, etas: Sequence[float]) -> dict[str, Any]:
    """The sweep and the verdict of the design.  Raises BulwarkError naming the file."""
    model = load(model_path)
    parsed = options.parse(joint.Options, model.methods.get(joint.NAME, {}),
                           f"{model_path}: method.joint")
    try:
        return _sweep_loaded(model, parsed, size, etas)
    except BulwarkError as error:
        raise type(error)(f"{model_path}: {error}") from None


def _sweep_loaded(model: Model, parsed: joint.Options, size: float | None,
                  etas: Sequence[float]) -> dict[str, Any]:
    filtered = kalman.steady_state(model.A, model.C, model.W, model.R)
    pairs, _ = joint.resolve_pairs(model, parsed)
    size = size or parsed.attack_size or joint_analysis.default_size(model, pairs)
    P0 = filtered.P if model.P0 is None else model.P0
    rows = joint_analysis.sweep(model, pairs, P0,
                                etas or joint_analysis.decades(model, pairs, size), size,
                                parsed.variant == "printed")
    return {"model": model.name, "attack_size": size, "rows": rows,
            "sensors": [model.sensors[pair.weak] for pair in pairs],
            "verdict": joint.design(model, filtered, parsed).info["verdict"]}


def _sweep_text(result: dict[str, Any]) -> str:
    names = ", ".join(result["sensors"])
    lines = [f"{result['model']}: mean squared errors, attack of size {result['attack_size']:.4g}",
             f"{'eta':>10} {'state':>10} {'state':>10}  attack estimate on {names}",
             f"{'':>10} {'no attack':>10} {'white':>10}  no attack | white | one sample"]
    for row in result["rows"]:
        groups = (row["theta_benign"], row["theta_white"], row["theta_pulse"])
        thetas = " | ".join(" ".join(f"{value:9.4g}" for value in group) for group in groups)
        lines.append(f"{row['eta']:10.4g} {row['state_benign']:10.4g} {row['state_white']:10.4g}  "
                     f"{thetas}")
    return "\n".join([*lines, result["verdict"]])


@joint_group.command()
@click.option("--json", "as_json", is_flag=True, help="Print the figures as JSON.")
def figures(as_json: bool) -> None:
    """Figures 2 to 5 of [J]: the four-bus grid, computed and simulated."""
    result = joint_figures.figures()
    click.echo(json.dumps(result, indent=2) if as_json else joint_figures.text(result))
