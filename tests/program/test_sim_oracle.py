# SPDX-License-Identifier: MIT
"""The oracle against a Kalman filter written here, and the figures against the files."""

import numpy as np
import pytest
from sim_case import columns, model_of, numbers, summary, write_design, write_scenario

ATTACKS = """
steps = 120
seed = 5
initial = "steady"
[[attack]]
sensor = "b"
kind = "bias"
value = 20.0
from = 40
to = 70
[[attack]]
sensor = "a"
kind = "drop"
probability = 0.4
from = 60
to = 90
"""


def steady(model: dict) -> np.ndarray:
    """P of the stationary filter, by iteration."""
    P, W = model["Q"].copy(), model["B"] @ model["Q"] @ model["B"].T
    for _ in range(5000):
        Pp = model["A"] @ P @ model["A"].T + W
        K = Pp @ model["C"].T @ np.linalg.inv(model["C"] @ Pp @ model["C"].T + model["R"])
        P = Pp - K @ model["C"] @ Pp
    return P


def filtered(model: dict, y: np.ndarray, u: np.ndarray, use: np.ndarray) -> np.ndarray:
    """x_hat [T, n] from the samples that are in use [T, m], with that submatrix of R."""
    A, C, R = model["A"], model["C"], model["R"]
    W = model["B"] @ model["Q"] @ model["B"].T
    x, P, out = model["x0"], steady(model), []
    for k in range(1, len(y)):
        x, P = A @ x + model["Bu"] @ u[k - 1], A @ P @ A.T + W
        rows = np.flatnonzero(use[k])
        K = P @ C[rows].T @ np.linalg.inv(C[rows] @ P @ C[rows].T + R[np.ix_(rows, rows)])
        x = x + K @ (y[k, rows] - model["offset"][rows] - C[rows] @ x)
        P = P - K @ C[rows] @ P
        out.append(x)
    return np.array(out)


@pytest.fixture
def case(blw_sim, tmp_path):
    design = write_design(tmp_path, "cart", ("kalman", "lasso"))
    done = blw_sim("run", write_scenario(tmp_path, ATTACKS), "--design", design,
                   "--out", tmp_path)
    assert done.returncode == 0, done.stderr
    return tmp_path, model_of(design)


def test_oracle_leaves_out_attacked_and_missing_samples(case):
    folder, model = case
    y = numbers(folder / "log.csv", model["sensors"])
    u = numbers(folder / "log.csv", model["inputs"])
    a = numbers(folder / "log.csv", [f"a:{name}" for name in model["sensors"]])
    expected = filtered(model, y, u, ~np.isnan(y) & ~(np.abs(a) > 0.0))
    got = numbers(folder / "oracle.csv", model["states"])
    np.testing.assert_allclose(got, expected, rtol=1e-9, atol=1e-9)


def test_oracle_takes_no_sample_out_of_range(blw_sim, tmp_path):
    design = write_design(tmp_path, "cart")
    model = model_of(design)
    y = np.tile([1.0, 1.0, 1.5], (6, 1))
    y[3, 2] = 1e5
    lines = [f"{k},{0.1 * k}," + ",".join(map(str, row)) + ",0" for k, row in enumerate(y)]
    (tmp_path / "log.csv").write_text("k,t_s,a,b,c,force_N\n" + "\n".join(lines) + "\n")
    done = blw_sim("replay", tmp_path / "log.csv", "--design", design, "--out", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    expected = filtered(model, y, np.zeros((6, 1)), np.abs(y) < 50.0)
    np.testing.assert_allclose(numbers(tmp_path / "out" / "oracle.csv", model["states"]), expected,
                               rtol=1e-9)
    status = columns(tmp_path / "out" / "kalman.csv")["status"]
    assert status == ["kalman", "kalman", "kalman+missing", "kalman", "kalman"]


def test_summary_agrees_with_the_files(case):
    folder, model = case
    x = numbers(folder / "log.csv", [f"x:{name}" for name in model["states"]])[1:]
    k = np.arange(1, len(x) + 1)
    phases = {"before": k < 40, "during": (k >= 40) & (k < 90), "after": k >= 90, "all": k > 0}
    told = summary(folder)
    oracle = numbers(folder / "oracle.csv", model["states"])
    for method in ("kalman", "lasso", "oracle"):
        figures = told["methods"][method]
        squares = (numbers(folder / f"{method}.csv", model["states"]) - x) ** 2
        for phase, steps in phases.items():
            mse = squares[steps].sum(axis=1).mean()
            best = ((oracle - x)[steps] ** 2).sum(axis=1).mean()
            assert figures["mse"][phase] == pytest.approx(mse, rel=1e-6)
            assert figures["rmse"][phase] == pytest.approx(np.sqrt(mse), rel=1e-6)
            assert figures["ratio_to_oracle"][phase] == pytest.approx(mse / best, rel=1e-6)
            assert figures["rmse_state"][phase] == pytest.approx(
                np.sqrt(squares[steps].mean(axis=0)), rel=1e-6)
    assert [(w["from_k"], w["to_k"], w["sensors"]) for w in told["attack_windows"]] == [
        (40, 90, ["a", "b"])]


def test_summary_counts_alarms_exclusions_and_iterations(case):
    folder, _ = case
    told = summary(folder)["methods"]["lasso"]
    track = columns(folder / "lasso.csv")
    k = np.arange(1, 121)
    alarm = np.array(track["statistic"], dtype=float) > np.array(track["threshold"], dtype=float)
    quiet = (k < 40) | (k >= 90)
    assert told["false_alarm_rate"] == pytest.approx(alarm[quiet].mean())
    assert told["detection_delay_steps"] == np.flatnonzero(alarm[39:89])[0]
    passed = np.array([word.startswith("kalman") for word in track["status"]])
    assert told["kalman_rate"]["all"] == pytest.approx(passed.mean())
    iterations, counts = np.unique(track["iterations"], return_counts=True)
    assert told["iterations"]["histogram"] == dict(zip(iterations.tolist(), counts.tolist()))
    assert told["missed_exclusions"] == {"count": 30, "of": 30, "rate": 1.0}
    assert told["wrong_exclusions"]["count"] == 0
    assert told["flags"]["missing"] == sum("missing" in word for word in track["status"])


def test_oracle_excludes_every_attacked_sample(case):
    told = summary(case[0])["methods"]["oracle"]
    assert told["missed_exclusions"]["count"] == told["wrong_exclusions"]["count"] == 0
    assert told["detection_delay_steps"] == 0
