# SPDX-License-Identifier: MIT
"""The command `report`."""
from __future__ import annotations

import json
from pathlib import Path

import click

from blw.report.data import load
from blw.report.figures import as_json
from blw.report.page import write


@click.command()
@click.argument("directory", metavar="DIR", type=click.Path(path_type=Path))
@click.option("--json", "as_json_text", is_flag=True, help="Print the figures as JSON.")
def report(directory: Path, as_json_text: bool) -> None:
    """Write DIR/report.html, one self-contained page, and DIR/*.png from what `run` or `replay`
    left in DIR."""
    recording = load(directory)
    written = write(recording)
    if as_json_text:
        click.echo(json.dumps(as_json(recording), indent=2))
    else:
        click.echo(f"{written[-1]}  ({len(written) - 1} plots beside it)")
