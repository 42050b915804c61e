# SPDX-License-Identifier: MIT
"""What happened on a real bus: every transport's cases run once, and the tests look at the reports.
"""

import json
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

from blw.build import ROOT, bus, simulator

HERE = Path(__file__).parent
NO_SUCH_BUS = 77
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
ATTACK = """[[attack]]
sensor = "cart2"
{what}
from   = 100
to     = 200
"""


@dataclass
class Recorded:
    """The reports of one transport, and the folder with what was written."""

    transport: str
    out: Path
    cases: dict[str, dict]


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
    for name, attack in (("benign", ""), ("bias", ATTACK.format(what='kind = "bias"\nvalue = 5.0')),
                         ("drop", ATTACK.format(what='kind = "drop"'))):
        scenario = folder / f"{name}.toml"
        scenario.write_text(BENIGN + attack)
        done = call([simulator("f32"), "run", scenario, "--design", made.design, "--method",
                     "guard", "--out", made.inproc / name])
        assert done.returncode == 0, done.stderr
    return made


@pytest.fixture(scope="session", params=("lcm", "can", "canfd"))
def recorded(request: pytest.FixtureRequest, prepared: Prepared,
             tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    transport = request.param
    out = tmp_path_factory.mktemp(transport)
    frames = os.environ.get("BULWARK_FRAMES", "10000")
    within = ([HERE / "in_netns.sh"] if transport == "lcm"
              else [HERE / "in_uml.sh", "-t", "800", "--"])
    done = call([*within, "/usr/bin/env", "python3", HERE / "cases.py", bus("f32"), prepared.design,
                 prepared.other, prepared.scenarios, out, transport, frames])
    if done.returncode == NO_SUCH_BUS:
        pytest.skip(done.stderr.strip())
    assert done.returncode == 0, done.stdout + done.stderr
    return Recorded(transport, out, json.loads(done.stdout.splitlines()[-1]))
