# SPDX-License-Identifier: MIT
"""`bulwark demo`: the main job in one command, from a model file to a report."""

from pathlib import Path

import click

from blw.build import BUILD, PRECISIONS, ROOT
from blw.simulate import run_scenario

SCENARIO = ROOT / "host_sim" / "scenarios" / "pendulum_loop.toml"


@click.command()
@click.option("--out", default=BUILD / "demo", show_default="build/demo",
              type=click.Path(path_type=Path, file_okay=False), help="Folder for the results.")
@click.option("--precision", type=click.Choice(PRECISIONS), default="f32", show_default=True,
              help="Numbers of the library: float or double.")
@click.option("--json", "as_json", is_flag=True, help="Print the figures as JSON.")
def demo(out: Path, precision: str, as_json: bool) -> int:
    """Design the shipped plant, simulate all methods under attack, and write the report."""
    status = run_scenario(SCENARIO, out, precision=precision, as_json=as_json)
    if status == 0:
        click.echo(f"report: {_write_report(out)}", err=as_json)
    return status


def _write_report(folder: Path) -> Path:
    from blw.report.data import load  # matplotlib takes its time: only once it is needed
    from blw.report.page import write

    return write(load(folder))[-1]
