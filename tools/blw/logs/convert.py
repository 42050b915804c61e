# SPDX-License-Identifier: MIT
"""Logs in any format as Bulwark's CSV, which is the only one that blw_sim reads."""

from collections.abc import Sequence
from pathlib import Path

import click

from blw.errors import BulwarkError
from blw.logs.steps import Steps, names_of


def read(log: Path, log_format: str, design: Path, signal_map: Path | None,
         databases: Sequence[Path]) -> Steps:
    """A log of the format "candump" or "lcm" on the grid of a design.  Raises BulwarkError."""
    names = names_of(design)
    if log_format == "lcm":
        from blw.logs import lcm_log  # lcm and its types only where they are needed

        _refuse_unused(log_format, signal_map, databases)
        return lcm_log.read(log, names)
    from blw.logs import candump
    from blw.logs import signal_map as maps

    if signal_map is None:
        _refuse_unused("candump without --map", None, databases)
        return candump.read_own(log, names)
    return candump.read_foreign(log, maps.load(signal_map, databases, names), names)


def write(steps: Steps, log: Path, folder: Path) -> Path:
    """The CSV of a log under its own name in folder; says what was left out."""
    for reason, count in sorted(steps.dropped.items()):
        click.echo(f"bulwark: {log}: left out {count} frames {reason}", err=True)
    path = folder / log.name
    path.write_text(steps.text(), encoding="utf-8")
    return path


def _refuse_unused(what: str, signal_map: Path | None, databases: Sequence[Path]) -> None:
    if signal_map is not None:
        raise BulwarkError(f"--map does not go with --format {what}")
    if databases:
        raise BulwarkError(f"--dbc does not go with --format {what}")
