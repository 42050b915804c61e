# SPDX-License-Identifier: MIT
"""What happened on a real bus: every transport's cases run once, and the tests look at the reports.
"""

import json
import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import pytest

from blw.build import ROOT, bus, simulator

HERE = Path(__file__).parent
NO_SUCH_BUS = 77
#: Transport -> what has such a bus; SLCAN needs no more than sockets.
IN_UML = (HERE / "in_uml.sh", "-t", "800", "--")
WITHIN = {"lcm": (HERE / "in_netns.sh",), "can": IN_UML, "canfd": IN_UML}
MODEL = ROOT / "host_sim" / "models" / "pendulum_physical.toml"
OTHER_MODEL = ROOT / "host_sim" / "models" / "pendulum.toml"
ENVIRONMENT = os.environ | {"PYTHONPATH": str(ROOT / "tools")}

BENIGN = f"""model = "{MODEL}"
steps = 400
[controller]
kind   = "feedback"
method = "truth"
gain   = [[-0.604, -1.678, -39.514, -9.721]]
"""
#: Steps of the run that the stock tools record and play: all of it fits into a socket's buffer, so
#: a machine that stands still loses none of it.
BRIEF = 25
ATTACK = """[[attack]]
sensor = "cart2"
{what}
from   = 100
to     = 200
"""
#: Scenario -> attack on its sensor.
ATTACKS = {"benign": "", "bias": 'kind = "bias"\nvalue = 5.0', "drop": 'kind = "drop"',
           "replay": 'kind = "replay"\nvalue = 6.0', "delay": 'kind = "delay"\nvalue = 0.3'}


@dataclass
class Recorded:
    """The reports of one transport, and the folder with what was written."""

    transport: str
    out: Path
    run: subprocess.CompletedProcess

    def case(self, name: str) -> dict:
        """What one case reported."""
        return json.loads(self.run.stdout.splitlines()[-1])[name]


@dataclass
class Prepared:
    """What all transports share: design, scenarios, and the same runs in one process."""

    design: Path
    other: Path
    scenarios: Path
    inproc: Path


def call(command: list[object]) -> subprocess.CompletedProcess:
    """Run a program to its end."""
    return subprocess.run([str(word) for word in command], capture_output=True, text=True,
                          env=ENVIRONMENT, timeout=900, check=False)


@pytest.fixture(scope="session")
def prepared(tmp_path_factory: pytest.TempPathFactory) -> Prepared:
    folder = tmp_path_factory.mktemp("bus")
    for model in (MODEL, OTHER_MODEL):
        wanted = ("guard", "lasso", "canonical") if model == MODEL else ("guard",)
        done = call([sys.executable, "-m", "blw", "design", model, "--out", folder,
                     *(word for method in wanted for word in ("--method", method))])
        assert done.returncode == 0, done.stderr
    (folder / "short.toml").write_text(BENIGN.replace("steps = 400", "steps = 120"))
    made = Prepared(folder / f"{MODEL.stem}.json", folder / f"{OTHER_MODEL.stem}.json", folder,
                    folder / "inproc")
    (folder / "brief.toml").write_text(BENIGN.replace("steps = 400", f"steps = {BRIEF}"))
    for name, what in ATTACKS.items():
        (folder / f"{name}.toml").write_text(BENIGN + (ATTACK.format(what=what) if what else ""))
    for name in ("brief", *ATTACKS):
        done = call([simulator("f32"), "run", folder / f"{name}.toml", "--design", made.design,
                     "--method", "guard", "--out", made.inproc / name])
        assert done.returncode == 0, done.stderr
    for log_format, transport in (("candump", "can"), ("lcm", "lcm")):
        done = call([sys.executable, "-m", "blw", "export", made.inproc / "brief", "--format",
                     log_format, "--out", folder / f"exported.{transport}"])
        assert done.returncode == 0, done.stderr
    return made


def on(*transports: str) -> pytest.MarkDecorator:
    """Parametrise a test by transport; the tests of one transport share a worker and its record."""
    return pytest.mark.parametrize(
        "transport", [pytest.param(name, marks=pytest.mark.xdist_group(name))
                      for name in transports])


@pytest.fixture(scope="session")
def record(prepared: Prepared, tmp_path_factory: pytest.TempPathFactory,
           worker_id: str) -> Callable[[str], Recorded]:
    """The record of a transport, made when it is first asked for; by one worker only."""
    base = tmp_path_factory.getbasetemp()
    of_all_workers = base if worker_id == "master" else base.parent

    @cache
    def made(transport: str) -> Recorded:
        (of_all_workers / f"{transport}.made").mkdir()  # fails where the tests are not grouped
        out = tmp_path_factory.mktemp(transport)
        frames = os.environ.get("BULWARK_FRAMES", "10000")
        return Recorded(transport, out, call([
            *WITHIN.get(transport, ()), "/usr/bin/env", "python3", HERE / "cases.py", bus("f32"),
            prepared.design, prepared.other, prepared.scenarios, out, transport, frames]))

    return made


@pytest.fixture
def recorded(record: Callable[[str], Recorded], transport: str) -> Recorded:
    """The record of the test's transport; skips where the kernel has no such bus."""
    found = record(transport)
    if found.run.returncode == NO_SUCH_BUS:
        pytest.skip(found.run.stderr.strip())
    assert found.run.returncode == 0, found.run.stdout + found.run.stderr
    return found
