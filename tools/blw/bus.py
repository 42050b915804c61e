# SPDX-License-Identifier: MIT
"""`bulwark plant`, `node` and `attack`: the parts of a run as processes on LCM or CAN.

Also what `bulwark run --transport` does with them: start all three, each as soon as the one before
is on the bus, and end them together.
"""

import subprocess
import tomllib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click

from blw.atomic import write_files
from blw.build import PRECISIONS, arguments, bus
from blw.errors import BulwarkError

EXISTING_FILE = click.Path(path_type=Path, exists=True, dir_okay=False)
FOLDER = click.Path(path_type=Path, file_okay=False)
FAULTS = ("babble", "crc", "stale", "early", "duplicate", "sync", "garbage")
PATIENCE_S = 60

#: Transport -> the node's link and, beyond an attacker, the sensors'.
LINKS = {
    "lcm": ("lcm:udpm://239.255.76.67:7667?ttl=0", "lcm:udpm://239.255.76.67:7668?ttl=0"),
    "can": ("can:vcan0", "can:vcan1"),
    "canfd": ("canfd:vcan0", "canfd:vcan1"),
}


def _options(*more: Callable) -> Callable[[Callable[..., int]], Callable[..., int]]:
    shared = (
        click.option("--design", required=True, type=EXISTING_FILE,
                     help="NAME.json of the design command."),
        click.option("--link", required=True, metavar="LINK",
                     help="can:IF, canfd:IF, slcan:PLACE, lcm:URL or replay:FILE."),
        click.option("--seed", type=click.IntRange(min=0), help="Seed of the random numbers."),
        click.option("--idle-s", type=click.IntRange(min=0),
                     help="Give up after so long a silence; 0: never."),
        click.option("--precision", type=click.Choice(PRECISIONS), default="f32",
                     show_default=True, help="Numbers of the library: float or double."),
    )

    def decorate(command: Callable[..., int]) -> Callable[..., int]:
        for option in reversed((*shared, *more)):
            command = option(command)
        return command

    return decorate


def _results() -> tuple[Callable, Callable]:
    return (click.option("--out", required=True, type=FOLDER,
                         help="Folder for the results; made if missing."),
            click.option("--json", is_flag=True, help="Print the figures as JSON."))


@click.command()
@click.argument("scenario", type=EXISTING_FILE)
@_options(*_results(),
          click.option("--pace-us", type=click.IntRange(min=0),
                       help="Time between steps; without it, wait for the node's answer."),
          click.option("--patience-ms", type=click.IntRange(min=1), help="For an answer."))
def plant(scenario: Path, precision: str, **options: Any) -> int:
    """Simulate the plant of SCENARIO and its sensors on a bus."""
    return subprocess.call([bus(precision), "plant", scenario, *arguments(options)])


@click.command()
@_options(*_results(),
          click.option("--method", multiple=True, metavar="METHOD", default=("all",),
                       show_default=True, help="Method beside kalman; may be repeated."),
          click.option("--speaker", metavar="METHOD", help="The method that sends."),
          click.option("--mute", is_flag=True, help="Send nothing."),
          click.option("--fusion", is_flag=True,
                       help="Take what sensor nodes send for samples; one method."),
          click.option("--sensor", metavar="SENSOR",
                       help="Be the sensor node: its local filter, no more; one method."),
          click.option("--period-us", type=click.IntRange(min=1),
                       help="Own clock: go on without a sync after that time."),
          click.option("--deadline-us", type=click.IntRange(min=1),
                       help="From the sync to the step at the latest."),
          click.option("--settle-us", type=click.IntRange(min=0),
                       help="Wait for contradictions that long when all is there."),
          click.option("--quarantine", type=click.IntRange(0, 65535),
                       help="Steps for which a contradicting sensor is rejected."),
          click.option("--max-gap", type=click.IntRange(0, 65535),
                       help="Steps made up for blindly after a loss of contact."))
def node(precision: str, **options: Any) -> int:
    """Estimate from what is heard on a bus, one node per method."""
    return subprocess.call([bus(precision), "node", *arguments(options)])


@click.command()
@click.argument("scenario", type=EXISTING_FILE)
@_options(click.option("--sensor-link", metavar="LINK",
                       help="The plant's side, to be a gateway; without it, an intruder."),
          click.option("--fault", type=click.Choice(FAULTS), help="Disturb instead of attacking."))
def attack(scenario: Path, precision: str, **options: Any) -> int:
    """Carry out the attacks of SCENARIO on a bus."""
    return subprocess.call([bus(precision), "attack", scenario, *arguments(options)])


@dataclass(frozen=True)
class Place:
    """Where a run takes place."""

    link: str
    sensor_link: str

    @staticmethod
    def of(transport: str, link: str | None, sensor_link: str | None) -> "Place":
        """Of a transport, with what the user wants otherwise."""
        usual = LINKS[transport]
        return Place(link or usual[0], sensor_link or usual[1])


def run_on_bus(scenario: Path, design: Path, out: Path, methods: Sequence[str], speaker: str,
               place: Place, precision: str, seed: int | None, as_json: bool) -> int:
    """One run of a scenario as processes; writes what the run in one process writes, and more.

    The node writes the results; node.json, plant.json and attack.json tell what each met on the
    bus.  Returns the exit status.
    """
    program = bus(precision)
    attacked = bool(tomllib.loads(scenario.read_text(encoding="utf-8")).get("attack"))
    common = arguments({"design": design, "seed": seed})
    plant_out = out / "plant"
    (plant_out / "log.csv").unlink(missing_ok=True)
    commands = {"node": ["--link", place.link, "--out", out, "--method", ",".join(methods),
                         "--scenario", scenario, "--log", plant_out / "log.csv", *common,
                         *arguments({"speaker": speaker or None, "json": as_json})]}
    if attacked:
        commands["attack"] = [scenario, "--link", place.link, "--sensor-link", place.sensor_link,
                              *common]
    commands["plant"] = [scenario, "--link", place.sensor_link if attacked else place.link,
                         "--out", plant_out, *common]
    parts: dict[str, subprocess.Popen] = {}
    try:
        for name, words in commands.items():
            parts[name] = _start([program, name, *words])
            if not _is_listening(parts[name]):
                return _end(parts, name)
        return _finish(parts, out)
    finally:
        for part in parts.values():
            if part.poll() is None:
                part.terminate()
            part.wait()


def _start(command: Sequence[Any]) -> subprocess.Popen:
    return subprocess.Popen([str(word) for word in command], stdout=subprocess.PIPE, text=True)


def _is_listening(part: subprocess.Popen) -> bool:
    return "listening" in part.stdout.readline()


def _end(parts: dict[str, subprocess.Popen], name: str) -> int:
    """The status of a part that did not get onto the bus; it has said why."""
    return parts[name].wait() or 1


def _finish(parts: dict[str, subprocess.Popen], out: Path) -> int:
    """Wait for all; the first status that is not 0, the plant's first."""
    statuses = [parts["plant"].wait()]
    for name in ("node", "attack"):
        if name not in parts:
            continue
        try:
            said, _ = parts[name].communicate(timeout=PATIENCE_S)
        except subprocess.TimeoutExpired:
            raise BulwarkError(f"the {name} on the bus did not end with the plant") from None
        statuses.append(parts[name].returncode)
        if name == "node":
            click.echo(said, nl=False)
        elif said:
            write_files(out, {"attack.json": said})
    return next((status for status in statuses if status != 0), 0)
