# SPDX-License-Identifier: MIT
"""`bulwark analyze`: how many lying sensors a model survives, with which method, at what cost."""

from pathlib import Path

import click

from blw.design import json_text
from blw.model import load
from blw.progress import steps


@click.command(short_help="Which methods are safe for a model, and why.")
@click.argument("model", type=click.Path(path_type=Path))
@click.option("--method", "methods", multiple=True, metavar="METHOD",
              help="Method to look at; may be repeated.  Default: all.")
@click.option("--json", "as_json", is_flag=True, help="Print the figures as JSON.")
def analyze(model: Path, methods: tuple[str, ...], as_json: bool) -> None:
    """Tell how many lying sensors MODEL (a TOML file) survives, method by method."""
    from blw.analysis.analyse import analyse  # scipy's optimisers take their time: only when used
    from blw.analysis.text import report

    loaded = load(model)
    with steps("analyze") as progress:
        result = analyse(loaded, methods or None, progress)
    click.echo(json_text(result) if as_json else report(result), nl=not as_json)
