# SPDX-License-Identifier: MIT
"""Configures and builds the CMake presets that the other commands need.

Quiet where nothing is to be done; a progress bar on a terminal; all that CMake and ninja say is in
build/<preset>.log.
"""

import fcntl
import os
import re
import subprocess
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click
from tqdm import tqdm

ROOT = Path(__file__).resolve().parents[2]
BUILD = ROOT / "build"
PRESETS = ROOT / "CMakePresets.json"
PRECISIONS = ("f32", "f64")

_STATUS = re.compile(r"^\[(\d+)/(\d+)\]")
_SHOWN_LINES = 40


class StepFailed(click.ClickException):
    """A build or a test that failed; the command line prints the message and exits with 1."""

    exit_code = 1


def simulator(precision: str) -> Path:
    """The simulator of one precision ("f32" or "f64"), built if it is missing or out of date.

    Raises StepFailed if it cannot be built.
    """
    return _program("blw_sim", precision)


def bus(precision: str) -> Path:
    """The program of plant, node and attacker on a bus; as simulator()."""
    return _program("blw_bus", precision)


def arguments(options: dict[str, Any]) -> list[str]:
    """Options of the simulator or of the program on the bus: those that were given.

    A tuple becomes one word with commas; what is None or False was not given.
    """
    given: list[str] = []
    for key, value in options.items():
        option = "--" + key.replace("_", "-")
        if value is True:
            given.append(option)
        elif isinstance(value, tuple):
            given += [option, ",".join(value)]
        elif value is not None and value is not False:
            given += [option, str(value)]
    return given


def _program(name: str, precision: str) -> Path:
    preset = f"host-{precision}"
    build_programs(preset, [name])
    return BUILD / preset / "host_sim" / name


def build(preset: str) -> Path:
    """Configure a preset with its tests and build everything; returns its folder.

    Raises StepFailed.
    """
    folder = configure(preset)
    with _turn(preset):
        _make(preset, "all")
    return folder


def build_programs(preset: str, targets: Sequence[str]) -> None:
    """Build some programs of a preset, without its tests if those were not wanted so far.

    Raises StepFailed.
    """
    with _turn(preset):
        if not _is_configured(preset):
            _configure(preset, tests=_has_tests(preset))
        _make(preset, *targets)


def configure(preset: str) -> Path:
    """Configure a preset with its tests; returns its folder.  Raises StepFailed."""
    with _turn(preset):
        _configure(preset, tests=True)
    return BUILD / preset


def log_path(preset: str) -> Path:
    """Where the output of configuring and building a preset goes."""
    return BUILD / f"{preset}.log"


@contextmanager
def _turn(preset: str) -> Iterator[None]:
    """Builds of one preset wait for each other."""
    BUILD.mkdir(exist_ok=True)
    with (BUILD / f".{preset}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def _is_configured(preset: str) -> bool:
    """As CMakePresets.json tells; whatever else changed, ninja configures it again itself."""
    made = BUILD / preset / "build.ninja"
    return made.is_file() and made.stat().st_mtime > PRESETS.stat().st_mtime


def _has_tests(preset: str) -> bool:
    """The preset was configured with its tests."""
    cache = BUILD / preset / "CMakeCache.txt"
    return cache.is_file() and "BLW_TESTS:BOOL=ON" in cache.read_text(encoding="utf-8")


def _configure(preset: str, tests: bool) -> None:
    switch = f"-DBLW_TESTS={'ON' if tests else 'OFF'}"
    with log_path(preset).open("w", encoding="utf-8") as log:
        cmake = _start(["cmake", "--preset", preset, switch], stdout=log, stderr=subprocess.STDOUT)
    if cmake.wait() != 0:
        _fail(preset, "CMake could not configure it")


def _make(preset: str, *targets: str) -> None:
    command = ["ninja", "-C", str(BUILD / preset), f"-j{os.cpu_count()}", *targets]
    ninja = _start(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    with (
        log_path(preset).open("a", encoding="utf-8") as log,
        tqdm(desc=f"building {preset}", total=0, disable=None, leave=False) as bar,
    ):
        for line in ninja.stdout:
            log.write(line)
            status = _STATUS.match(line)
            if status:
                bar.total = int(status[2])
                bar.update(int(status[1]) - bar.n)
    if ninja.wait() != 0:
        _fail(preset, "it does not build")


def _start(command: list[str], **streams) -> subprocess.Popen:
    environment = {**os.environ, "NINJA_STATUS": "[%f/%t] "}
    try:
        return subprocess.Popen(command, cwd=ROOT, env=environment, **streams)
    except FileNotFoundError:
        raise StepFailed(f"{command[0]} is not installed; see tools/bulwark doctor") from None


def _fail(preset: str, what: str) -> None:
    log = log_path(preset)
    lines = log.read_text(encoding="utf-8", errors="replace").splitlines()
    click.echo("\n".join(lines[-_SHOWN_LINES:]), err=True)
    raise StepFailed(f"preset {preset}: {what}, see {log.relative_to(ROOT)}")
