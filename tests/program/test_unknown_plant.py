# SPDX-License-Identifier: MIT
"""A plant that nothing was made for goes through design, simulation, replay and report."""

import json
from pathlib import Path

from conftest import Run
from test_design import UNKNOWN

SCENARIO = """
model = "rig.toml"
steps = 600
[controller]
kind = "feedback"
method = "lasso"
gain = [[0.0, 0.05, 0.0, 0.0, 0.3], [0.0, 0.0, 0.0, 0.1, 0.3]]
[[attack]]
sensors = ["y2", "y5"]
kind = "bias"
value = 5.0
from = 200
to = 400
"""


def test_five_states_seven_sensors_two_inputs(tmp_path: Path, bulwark: Run) -> None:
    (tmp_path / "rig.toml").write_text(UNKNOWN + "[method.lasso]\nrecovery_probability = 0.5\n")
    (tmp_path / "scenario.toml").write_text(SCENARIO)
    ran, replayed = tmp_path / "ran", tmp_path / "replayed"
    for words in (
        ("run", tmp_path / "scenario.toml", "--out", ran, "--method", "lasso"),
        ("replay", ran / "log.csv", "--design", ran / "design" / "rig.json", "--method", "lasso",
         "--out", replayed),
        ("report", replayed),
    ):
        done = bulwark(*words)
        assert done.returncode == 0, done.stderr
    assert (replayed / "lasso.csv").read_bytes() == (ran / "lasso.csv").read_bytes()
    assert (replayed / "report.html").stat().st_size > 100_000
    told = json.loads((ran / "summary.json").read_text())["methods"]
    assert told["lasso"]["mse"]["before"] < 1.5 * told["oracle"]["mse"]["before"]
    assert told["lasso"]["outcomes"]["bound"] == 0
