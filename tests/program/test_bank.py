# SPDX-License-Identifier: MIT
"""Method `bank` on the whole chain: design tool, C library and simulator."""

import csv
import json
import subprocess

import numpy as np
import pytest
from sim_case import MODELS, SCENARIOS, columns, numbers, summary, write_design

from blw.build import simulator
from blw.model import load


def write_log(path, model, y):
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["k", "t_s", *model.sensors])
        writer.writerow([0, 0.0, *[""] * model.m])
        writer.writerows([k + 1, (k + 1) * model.dt_s, *row] for k, row in enumerate(y))


def replayed(folder, design, model, y, precision):
    """x_hat [steps, n]"""
    log = folder / "log.csv"
    write_log(log, model, y)
    subprocess.run([simulator(precision), "replay", log, "--design", design, "--method", "bank",
                    "--out", folder / "out"], check=True, capture_output=True, timeout=300)
    return numbers(folder / "out" / "bank.csv", model.states)[-len(y):]


def test_run_given_ghost_and_aligned_innovations_stays_below_the_stated_level(blw_sim, tmp_path):
    design = write_design(tmp_path, "drone5", ["kalman", "bank"])
    done = blw_sim("run", SCENARIOS / "drone5_ghost.toml", "--design", design, "--method", "bank",
                   "--out", tmp_path)
    assert done.returncode == 0, done.stderr
    info = json.loads(design.read_text())["methods"]["bank"]["info"]
    mse = {name: scores["mse"]["during"] for name, scores in summary(tmp_path)["methods"].items()}
    assert mse["bank"] < info["guarantee"] < mse["kalman"]
    excluded = columns(tmp_path / "bank.csv")["excluded"]
    assert np.mean(["y3" in names for names in excluded[310:400]]) > 0.95


@pytest.mark.parametrize(("precision", "tolerance"), [("f32", 1e-5), ("f64", 1e-9)])
def test_replay_given_golden_samples_yields_the_estimate_of_one_set(tmp_path, shared, precision,
                                                                    tolerance):
    golden = json.loads((shared / "golden" / "bank_drone5.json").read_text())
    model = load(MODELS / "drone5.toml")
    design = write_design(tmp_path, "drone5", ["kalman", "bank"])
    y = np.array(golden["y"])
    x = replayed(tmp_path, design, model, y, precision)
    distance = np.abs(np.array(golden["xhat_filt"]) - x).max(axis=2)
    best = int(np.argmin(golden["gls"]["Popt_filt"]))
    assert distance[best, :100].max() < tolerance
    assert distance.min(axis=0).max() < tolerance
