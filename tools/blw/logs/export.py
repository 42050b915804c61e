# SPDX-License-Identifier: MIT
"""`bulwark export`: what run or replay wrote, as a candump log, an LCM event log or MCAP."""

import os
import tempfile
from collections.abc import Callable
from pathlib import Path

import click

from blw.errors import BulwarkError
from blw.report.data import Recording, Track, load

FILE_NAMES = {"candump": "run.log", "lcm": "run.lcm", "mcap": "run.mcap"}
YARDSTICKS = ("kalman", "oracle")


@click.command("export", short_help="A run as a candump, LCM or MCAP log.")
@click.argument("directory", metavar="DIR", type=click.Path(path_type=Path, exists=True,
                                                            file_okay=False))
@click.option("--format", "log_format", required=True, type=click.Choice(tuple(FILE_NAMES)),
              help="candump: text, one frame a line; lcm: for lcm-logplayer; mcap: for Foxglove, "
                   "Lichtblick, PlotJuggler.")
@click.option("--out", type=click.Path(path_type=Path, dir_okay=False),
              help="File to write; default: run.log, run.lcm or run.mcap in DIR.")
@click.option("--method", metavar="METHOD",
              help="Whose estimates go on the bus; default: the first that is no yardstick.  "
                   "MCAP holds all.")
def export(directory: Path, log_format: str, out: Path | None, method: str | None) -> None:
    """Write the run or replay in DIR as a log for other tools."""
    recording = load(directory)
    track = choose(recording, method)
    out = out or directory / FILE_NAMES[log_format]
    atomically(out, lambda path: _writer(log_format)(recording, track, path))
    click.echo(f"wrote {out}")


def choose(recording: Recording, method: str | None) -> Track:
    """The track of a method, or of the first that is more than a yardstick."""
    names = list(recording.tracks)
    if method is not None and method not in names:
        raise BulwarkError(f"{recording.directory}: has no method '{method}'; there are: "
                           + ", ".join(names))
    chosen = [name for name in names if name not in YARDSTICKS] or names
    if not chosen:
        raise BulwarkError(f"{recording.directory}: has no estimates")
    return recording.tracks[method or chosen[0]]


def atomically(out: Path, write: Callable[[Path], None]) -> None:
    """Let write make a file under a temporary name, then rename it to out."""
    out.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=f".{out.name}.", dir=out.parent) as folder:
        path = Path(folder) / out.name
        write(path)
        os.replace(path, out)


def _writer(log_format: str) -> Callable[[Recording, Track, Path], None]:
    """Each format brings a library of its own."""
    if log_format == "mcap":
        from blw.logs import to_mcap
        return to_mcap.write
    if log_format == "lcm":
        from blw.logs import to_lcm
        return to_lcm.write
    from blw.logs import to_candump
    return to_candump.write
