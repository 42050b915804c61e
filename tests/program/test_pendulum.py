# SPDX-License-Identifier: MIT
"""[N] section IV: the model from its physical parameters, figures 2 to 4, the closed loop."""

import csv
import sys
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg

from blw import kalman, model
from blw.build import ROOT

sys.path.insert(0, str(ROOT / "docs"))
import pendulum_figures  # noqa: E402  the script that prints the tables of docs/canonical.md

MODELS = ROOT / "host_sim" / "models"
SCENARIOS = ROOT / "host_sim" / "scenarios"
ATTACKED = slice(100, 310)
STEPS = 6000


def test_physical_model_is_the_published_one():
    physical = model.load(MODELS / "pendulum_physical.toml")
    published = model.load(MODELS / "pendulum.toml")
    assert np.abs(physical.A - published.A).max() < 1e-12
    assert np.abs(physical.Bu - published.Bu).max() < 1e-12
    assert np.sort(np.linalg.eigvals(physical.A).real) == pytest.approx(
        [0.642, 1.0, 1.0, 1.557], abs=5e-4)


def test_lqr_gain_is_the_published_one():
    plant = model.load(MODELS / "pendulum_physical.toml")
    A, B = plant.A, plant.Bu
    X = scipy.linalg.solve_discrete_are(A, B, np.eye(4), np.eye(1))
    gain = np.linalg.solve(np.eye(1) + B.T @ X @ B, B.T @ X @ A)[0]
    assert gain == pytest.approx([-0.604, -1.678, -39.514, -9.721], abs=6e-4)


def traces() -> tuple[kalman.Kalman, float, float, float]:
    """The Kalman filter of the pendulum, and tr P with all sensors, without the angle sensor, and
    with the attack's variance in its R."""
    plant = model.load(MODELS / "pendulum.toml")
    A, C, W, R = plant.A, plant.C, plant.W, plant.R
    known = R + np.diag([0, 0, 0, attack_variance()])
    found = [kalman.steady_state(A, C, W, R),
             kalman.steady_state(A, C[:3], W, R[:3, :3]),
             kalman.steady_state(A, C, W, known)]
    return found[0], *(float(np.trace(one.P)) for one in found)


def attack_variance() -> float:
    return pendulum_figures.QUARTER_TURN**2 / 3.0


def test_no_linear_filter_comes_near_the_oracle_line_of_figure_3():
    _, full, without, knowing = traces()
    assert full == pytest.approx(0.0511, abs=5e-5)
    assert without == pytest.approx(0.859, abs=5e-4)
    assert knowing / full == pytest.approx(15.7, abs=0.05)


def test_kalman_under_the_attack_has_the_error_of_the_lyapunov_equation():
    gains, full, *_ = traces()
    pushed = attack_variance() * np.outer(gains.K[:, 3], gains.K[:, 3])
    exact = full + np.trace(scipy.linalg.solve_discrete_lyapunov(gains.Acl, pushed))
    assert exact == pytest.approx(11.3, abs=0.1)


@pytest.mark.parametrize(("gamma", "size", "expected", "tolerance"), [
    (5.0, 0.0, 1.08, 0.1),
    (50.0, 0.0, 1.0, 0.1),
    (1.0, pendulum_figures.QUARTER_TURN, 28.0, 0.25),
    (5.0, pendulum_figures.QUARTER_TURN, 158.0, 0.25),
    (50.0, pendulum_figures.QUARTER_TURN, 242.0, 0.25),
])
def test_figure_3_is_reproduced_inside_its_monte_carlo_error(gamma, size, expected, tolerance):
    found = pendulum_figures.mean_square_errors(gamma, size, STEPS, variant="printed")
    assert found["canonical"] == pytest.approx(expected, rel=tolerance)


def angles(bulwark, folder: Path, scenario: str, method: str) -> np.ndarray:
    done = bulwark("run", SCENARIOS / scenario, "--out", folder, "--method", method)
    assert done.returncode == 0, done.stderr
    with (folder / "log.csv").open(newline="") as file:
        return np.abs([float(row["x:angle_rad"]) for row in csv.DictReader(file)])


def test_pendulum_stays_up_with_a_secure_estimate_in_the_loop(bulwark, tmp_path):
    angle = angles(bulwark, tmp_path, "pendulum_loop.toml", "canonical")
    assert angle.max() < 0.8


def test_pendulum_is_thrown_over_with_kalman_in_the_loop(bulwark, tmp_path):
    angle = angles(bulwark, tmp_path, "pendulum_thrown.toml", "canonical")
    assert angle[:100].max() < 0.3
    assert angle[ATTACKED].max() > np.pi / 2
