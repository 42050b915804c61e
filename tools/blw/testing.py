# SPDX-License-Identifier: MIT
"""`bulwark test`: builds every preset and runs everything that CI runs."""

import os
import subprocess
import sys
import time
import xml.etree.ElementTree as xml
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from functools import partial
from pathlib import Path

import click

from blw import lint
from blw.build import BUILD, ROOT, StepFailed, build, configure
from blw.cost.targets import TARGETS
from blw.errors import BulwarkError
from blw.options import suggestion
from blw.tally import Tally

PRESETS = ("host-f32", "host-f64", "asan", "clang-f32")
SUITES = ("design", "program", "bus")
TARGET = "target"
LINT = "lint"
COVERAGE = "coverage"
MIN_BRANCHES_PERCENT = 98

#: Steps at a time: while one of them has work for a single core, the other fills the rest.
LANES = 2
#: Steps that the load of another one would disturb.
ALONE = ("bus",)

Step = Callable[[], Tally]


@click.command()
@click.argument("labels", nargs=-1, metavar="[LABEL]...")
def test(labels: tuple[str, ...]) -> int:
    """Run all tests, or those with one of the LABELs.

    Labels: design, program and target (the Python suites; target also runs the C tests in QEMU),
    lint, coverage, and those of the C tests: unit, reference, header, install, archive.
    """
    total = Tally()
    for tally in _tallies(_plan(labels)):
        total += tally
    click.echo(str(total))
    return 1 if total.failed else 0


def _tallies(steps: Mapping[str, Step]) -> Iterator[Tally]:
    """Run the steps, LANES of them at a time, those that want to be alone at the end."""
    pool = ThreadPoolExecutor(LANES)
    started = [pool.submit(_report, name, step) for name, step in steps.items()
               if name not in ALONE]
    try:
        for done in as_completed(started):
            yield done.result()
    finally:
        pool.shutdown(cancel_futures=True)  # else an interrupted run would start all the others
    for name in ALONE:
        if name in steps:
            yield _report(name, steps[name])


def _plan(labels: Sequence[str]) -> dict[str, Step]:
    """The steps that cover the labels, all steps without labels."""
    own = [*SUITES, TARGET, LINT, COVERAGE]
    c_labels = [label for label in labels if label not in own]
    if c_labels:
        _check_known(c_labels, own)
    steps: dict[str, Step] = {}
    if c_labels or not labels:
        steps |= {preset: partial(_ctest, preset, c_labels) for preset in PRESETS}
    for name, step in (*((suite, partial(_pytest, suite)) for suite in SUITES),
                       (LINT, lint.run), (COVERAGE, _coverage)):
        if name in labels or not labels:
            steps[name] = step
    if TARGET in labels or not labels:
        steps |= {name: partial(_on_target, name) for name in TARGETS}
        steps["target"] = partial(_pytest, TARGET)
    return steps


def _check_known(labels: Sequence[str], own: Sequence[str]) -> None:
    """Raise BulwarkError for the first label that no test has."""
    printed = subprocess.run(["ctest", "--test-dir", configure(PRESETS[0]), "--print-labels"],
                             check=True, capture_output=True, text=True).stdout
    known = [line.strip() for line in printed.splitlines() if line.startswith("  ")]
    for label in labels:
        if label not in known:
            raise BulwarkError(f"no test has the label '{label}'; "
                               + suggestion(label, [*known, *own]))


def _report(name: str, step: Step) -> Tally:
    """Run a step and print a line about it; a step that cannot be run has failed."""
    start = time.monotonic()
    try:
        tally = step()
    except StepFailed as error:
        click.echo(f"bulwark: {error.message}", err=True)
        tally = Tally(failed=1)
    click.echo(f"{name + ':':<12}{tally} ({time.monotonic() - start:.0f} s)")
    return tally


def _ctest(preset: str, labels: Sequence[str]) -> Tally:
    folder = build(preset)
    command = ["ctest", "--preset", preset, "-j", str(os.cpu_count())]
    if labels:
        command += ["--label-regex", f"^({'|'.join(labels)})$",
                    "--no-tests=ignore"]  # not every preset has tests of every label
    return _with_junit(command, folder / "ctest.xml", "--output-junit")


def _on_target(name: str) -> Tally:
    """The C tests in QEMU; skipped where the compiler or QEMU is missing."""
    missing = TARGETS[name].missing()
    if missing:
        click.echo(f"{name}: skipped: not installed: {', '.join(missing)}")
        return Tally(skipped=1)
    return _ctest(name, ())


def _pytest(suite: str) -> Tally:
    command = [sys.executable, "-m", "pytest", "--quiet", "-rs", "-n", str(os.cpu_count()),
               # A bus is set up once.  Elsewhere a worker has files of its own, whose fixtures it
               # makes once, until it runs out of them.
               "--dist", "loadgroup" if suite == "bus" else "worksteal",
               str(ROOT / "tests" / suite)]
    return _with_junit(command, BUILD / f"{suite}.xml", "--junitxml")


def _with_junit(command: list[str], result: Path, option: str) -> Tally:
    """Run a test runner that writes a JUnit file, and count what the file holds."""
    result.unlink(missing_ok=True)
    environment = {**os.environ, "HYPOTHESIS_STORAGE_DIRECTORY": str(BUILD / "hypothesis")}
    status = _call([*command, option, str(result)], environment)
    cases = xml.parse(result).iter("testcase") if result.is_file() else ()
    tally = Tally.of_cases(cases)
    if status != 0 and tally.failed == 0:  # it broke down outside of any test
        tally += Tally(failed=1)
    return tally


def _call(command: Sequence[str], environment: Mapping[str, str] | None = None) -> int:
    """Run a program and print what it said when it has ended, since others run at the same time;
    returns its status."""
    done = subprocess.run(command, cwd=ROOT, env=environment, check=False, text=True,
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    click.echo(done.stdout, nl=False)
    return done.returncode


def _coverage() -> Tally:
    """Branch coverage of lib/ by the C tests."""
    folder = build(COVERAGE)
    for counts in folder.rglob("*.gcda"):
        counts.unlink()
    tally = _ctest(COVERAGE, ())
    command = ["gcovr", "--root", str(ROOT), "--object-directory", str(folder), "--branches",
               "--exclude-unreachable-branches", "--filter", str(ROOT / "lib" / "src"),
               "--fail-under-branch", str(MIN_BRANCHES_PERCENT), str(folder / "lib")]
    covered = _call(command) == 0
    if not covered:
        click.echo(f"bulwark: less than {MIN_BRANCHES_PERCENT} % of the branches of lib/ are "
                   "covered", err=True)
    return tally + Tally.of(covered)
