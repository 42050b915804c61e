# SPDX-License-Identifier: MIT
"""`bulwark run` and `bulwark replay`: the C library on simulated and on recorded measurements.

Both hand their work to blw_sim, the host build of the library; `run` designs the scenario's model
first.
"""

import subprocess
import tempfile
import tomllib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import click

from blw import pil
from blw.atomic import write_files
from blw.build import PRECISIONS, arguments, simulator
from blw.bus import LINKS, Place, run_on_bus
from blw.design import design_all, document, json_text
from blw.errors import BulwarkError
from blw.logs import convert
from blw.methods import REGISTRY
from blw.model import load
from blw.progress import steps

BAD_INPUT = 2
EXISTING_FILE = click.Path(path_type=Path, exists=True, dir_okay=False)
EVERY_METHOD = "all"
PIL = "pil"


def _shared_options(command: Callable[..., int]) -> Callable[..., int]:
    for option in reversed((
        click.option("--out", required=True, type=click.Path(path_type=Path, file_okay=False),
                     help="Folder for the results; made if missing."),
        click.option("--method", "methods", multiple=True, metavar="METHOD",
                     default=(EVERY_METHOD,), show_default=True,
                     help="Method to run beside kalman and oracle; may be repeated."),
        click.option("--seed", type=click.IntRange(min=0), help="Seed of the random numbers."),
        click.option("--precision", type=click.Choice(PRECISIONS), default="f32",
                     show_default=True, help="Numbers of the library: float or double."),
        click.option("--compare", is_flag=True,
                     help="Also the filters that joint is compared with in its paper."),
        click.option("--json", "as_json", is_flag=True, help="Print the figures as JSON."),
    )):
        command = option(command)
    return command


@click.command()
@click.argument("scenario", type=EXISTING_FILE)
@_shared_options
@click.option("--runs", type=click.IntRange(min=1), help="Number of runs, each with its own seed.")
@click.option("--transport", type=click.Choice(("inproc", PIL, *LINKS)), default="inproc",
              show_default=True,
              help="In one process; pil: also through firmware in QEMU; else plant, node and "
                   "attacker on a bus.")
@click.option("--link", metavar="LINK", help="The node's bus, if not the transport's usual one.")
@click.option("--sensor-link", metavar="LINK", help="The sensors' bus, beyond the attacker.")
def run(scenario: Path, transport: str, **options: Any) -> int:
    """Simulate SCENARIO (a TOML file) and write what every method made of it."""
    if transport == PIL:
        if options.pop("link") or options.pop("sensor_link"):
            raise BulwarkError("--link and --sensor-link do not go with --transport pil")
        return run_with_firmware(scenario, **options)
    return run_scenario(scenario, transport=transport, **options)


@click.command()
@click.argument("log", type=EXISTING_FILE)
@click.option("--design", required=True, type=EXISTING_FILE,
              help="NAME.json of the design command.")
@_shared_options
@click.option("--format", "log_format", type=click.Choice(("csv", "candump", "lcm")),
              default="csv", show_default=True, help="Format of the log.")
@click.option("--map", "log_map", type=EXISTING_FILE, metavar="MAP.toml",
              help="Columns of a foreign CSV, or signals of a foreign CAN log.")
@click.option("--dbc", "databases", type=EXISTING_FILE, multiple=True, metavar="FILE",
              help="DBC of the signals in the map; may be repeated.")
@click.option("--attack", type=EXISTING_FILE, metavar="ATTACK.toml",
              help="Attack to inject; an attacks.json works too.")
@click.option("--attack-id", metavar="ID", help="Only that attack of the file.")
def replay(log: Path, design: Path, log_map: Path | None, log_format: str,
           databases: tuple[Path, ...], precision: str, **options: Any) -> int:
    """Replay the recorded LOG through the methods of a design."""
    if log_format == "csv":
        if databases:
            raise BulwarkError("--dbc does not go with --format csv")
        return _replay_csv(log, precision, design=design, map=log_map, **options)
    steps_of_log = convert.read(log, log_format, design, log_map, databases)
    with tempfile.TemporaryDirectory(prefix="bulwark.") as folder:
        log = convert.write(steps_of_log, log, Path(folder))
        return _replay_csv(log, precision, design=design, **options)


def _replay_csv(log: Path, precision: str, **options: Any) -> int:
    return subprocess.call([simulator(precision), "replay", log,
                            *_words(format="csv", **options)])


def _words(methods: Sequence[str], as_json: bool = False, **options: Any) -> list[str]:
    """Options under their names on the simulator's command line."""
    return arguments({"method": tuple(methods), "json": as_json, **options})


def run_scenario(scenario: Path, out: Path, methods: Sequence[str] = (EVERY_METHOD,),
                 precision: str = "f32", **options: Any) -> int:
    """Design the scenario's model, simulate it, and write the results and the design into out.

    options: seed, runs, as_json, transport, ..., as on the command line.  Returns the status of
    the program behind it, which has said what was wrong if it is not 0.  Raises BulwarkError for a
    bad scenario or model.
    """
    transport = options.pop("transport", "inproc")
    links = (options.pop("link", None), options.pop("sensor_link", None))
    if transport == "inproc" and any(links):
        raise BulwarkError("--link and --sensor-link need a --transport")
    if transport != "inproc" and (options.get("runs") or options.get("compare")):
        raise BulwarkError("--runs and --compare do not go with --transport: a bus has one run")
    model_path, controller = _read_scenario(scenario)
    model = load(model_path)
    with steps("design") as progress:
        wanted = _wanted(methods, controller)
        text = json_text(document(design_all(model, wanted, progress)))
    name = f"{model.name}.json"
    with tempfile.TemporaryDirectory(prefix="bulwark.") as folder:
        (design,) = write_files(Path(folder), {name: text})
        if transport == "inproc":
            status = subprocess.call([simulator(precision), "run", scenario, *_words(
                design=design, out=out, methods=methods, **options)])
        else:
            status = run_on_bus(scenario, design, out, methods, _speaker(methods, controller),
                                Place.of(transport, *links), precision, options.get("seed"),
                                bool(options.get("as_json")))
    if status != BAD_INPUT:
        write_files(out / "design", {name: text})
    return status


def run_with_firmware(scenario: Path, out: Path, methods: Sequence[str], precision: str,
                      **options: Any) -> int:
    """As run_scenario for one method, then the same measurements through the example firmware.

    Returns 1 if an answer of the firmware is missing or differs in a bit.
    """
    named = [name for name in methods if name != EVERY_METHOD]
    if len(named) != 1 or precision != "f32" or options.get("runs"):
        raise BulwarkError(f"--transport {PIL} takes one --method, float, and one run")
    status = run_scenario(scenario, out, tuple(named), precision, **options)
    if status != 0:
        return status
    design = design_all(load(_read_scenario(scenario)[0]), named)
    outcome = pil.check(design, named[0], out)
    click.echo(f"firmware: {outcome.steps} steps, {outcome.sent} frames there and "
               f"{outcome.received} back, {outcome.lost} answers lost, {outcome.different} differ",
               err=True)
    return 0 if outcome.ok else 1


def _read_scenario(scenario: Path) -> tuple[Path, str]:
    """The scenario's model file and the method that its controller uses, if it names one.

    blw_sim, which reads the rest, complains about the rest.
    """
    try:
        content = tomllib.loads(scenario.read_text(encoding="utf-8"))
    except UnicodeDecodeError:
        raise BulwarkError(f"{scenario}: not a UTF-8 text file") from None
    except tomllib.TOMLDecodeError as error:
        raise BulwarkError(f"{scenario}: {error}") from None
    model = content.get("model")
    if not isinstance(model, str):
        raise BulwarkError(f"{scenario}: 'model' must name a model file")
    controller = content.get("controller")
    method = controller.get("method") if isinstance(controller, dict) else None
    return scenario.parent / model, method if isinstance(method, str) else ""


def _speaker(methods: Sequence[str], controller: str) -> str:
    """The method that answers the plant: the controller's, else the first that was named."""
    if controller in REGISTRY:
        return controller
    return "kalman" if EVERY_METHOD in methods else methods[0]


def _wanted(methods: Sequence[str], controller: str) -> list[str] | None:
    """The methods to design; None for all that accept the model."""
    if EVERY_METHOD in methods:
        return None
    return list(dict.fromkeys(["kalman", *methods] + [name for name in REGISTRY
                                                      if name == controller]))
