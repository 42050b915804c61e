# SPDX-License-Identifier: MIT
"""The filters that `joint` is compared with, against NumPy, sample by sample."""

import dataclasses
import subprocess
from pathlib import Path

import numpy as np
import pytest
from sim_case import MODELS, SCENARIOS, numbers, summary

from blw.build import simulator
from blw.design import design_all, document, json_text
from blw.kalman import steady_state
from blw.model import Model, load

PAIRS = [["y1", ["y3", "y4"]], ["y2", ["y3", "y5"]]]
PAIR = (0, 2, 3)
STRONG = (2, 3, 4)
ETA = 1.5
FORGETTING = 0.98


@pytest.fixture(scope="module")
def grid() -> Model:
    return load(MODELS / "grid4.toml")


@pytest.fixture(scope="module")
def ran(grid: Model, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a run with --compare."""
    folder = tmp_path_factory.mktemp("compare")
    changed = dataclasses.replace(grid, methods={"joint": {"pairs": PAIRS, "eta": ETA}})
    design = folder / "grid4.json"
    design.write_text(json_text(document(design_all(changed, ["kalman", "joint"]))))
    command = [simulator("f32"), "run", SCENARIOS / "grid4_attack.toml", "--design", design,
               "--out", folder, "--compare"]
    subprocess.run(command, check=True, capture_output=True, timeout=300)
    return folder


@pytest.fixture(scope="module")
def samples(grid: Model, ran: Path) -> np.ndarray:
    """[T, m] y(1), y(2), ..."""
    return numbers(ran / "log.csv", grid.sensors)[1:]


def start(grid: Model) -> np.ndarray:
    """Covariance of the initial error, that of the steady state."""
    return steady_state(grid.A, grid.C, grid.W, grid.R).P


def augmented(grid: Model, sensors: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A, B Q B' and C of [x; theta], theta on the first sensor."""
    A, W = np.eye(grid.n + 1), np.zeros((grid.n + 1, grid.n + 1))
    A[:-1, :-1], W[:-1, :-1] = grid.A, grid.W
    theta = np.eye(len(sensors))[:, :1]
    return A, W, np.hstack([grid.C[list(sensors)], theta])


def kalman(A, C, W, R, P, y) -> np.ndarray:
    """[T, n] estimates of a Kalman filter that starts at 0 with covariance P."""
    x, out = np.zeros(len(A)), []
    for sample in y:
        x, P = A @ x, A @ P @ A.T + W
        K = P @ C.T @ np.linalg.inv(C @ P @ C.T + R)
        x, P = x + K @ (sample - C @ x), P - K @ C @ P
        out.append(x)
    return np.array(out)


def adaptive(A, C, W, R, P, S, forgetting, y) -> np.ndarray:
    """[T, n + 2] estimates of [x; theta; phi] by the filter of Q. Zhang, Automatica 93 (2018): a
    Kalman filter for X, recursive least squares with forgetting for the constant phi.

    y = C X + v, X(k) = A X(k-1) + Phi phi + w, Phi the last unit vector.  The least squares are
    those of the innovations on Omega, the response of the Kalman filter to phi.
    """
    Phi = np.eye(len(A))[:, -1]
    X, phi, Upsilon, out = np.zeros(len(A)), 0.0, np.zeros(len(A)), []
    for sample in y:
        P = A @ P @ A.T + W
        Sigma = C @ P @ C.T + R
        K = P @ C.T @ np.linalg.inv(Sigma)
        P = P - K @ C @ P
        Omega = C @ (A @ Upsilon + Phi)
        Upsilon = (np.eye(len(A)) - K @ C) @ (A @ Upsilon + Phi)
        Gamma = S * Omega @ np.linalg.inv(forgetting * Sigma + S * np.outer(Omega, Omega))
        S = (S - S * Gamma @ Omega) / forgetting
        predicted = A @ X + Phi * phi
        innovation = sample - C @ predicted
        X = predicted + K @ innovation + Upsilon * (Gamma @ innovation)
        phi = phi + Gamma @ innovation
        out.append([*X, phi])
    return np.array(out)


def test_adaptive_given_no_forgetting_is_the_kalman_filter_of_a_constant(grid, samples):
    """Zhang's minimum variance property, which the reference itself has to have."""
    A, W, C = augmented(grid, PAIR)
    y, R = samples[:, PAIR], grid.R[np.ix_(PAIR, PAIR)]
    P = np.diag([0.3, 0.2, 0.1, 0.4, 0.7])
    larger = np.block([[A, np.eye(5)[:, -1:]], [np.zeros((1, 5)), np.ones((1, 1))]])
    noise = np.pad(W, ((0, 1), (0, 1)))
    start_with_phi = np.pad(P, ((0, 1), (0, 1)))
    start_with_phi[-1, -1] = 2.0
    want = kalman(larger, np.hstack([C, np.zeros((3, 1))]), noise, R, start_with_phi, y)
    np.testing.assert_allclose(adaptive(A, C, W, R, P, 2.0, 1.0, y), want, atol=1e-9)


def test_adaptive_given_a_run_follows_its_reference(grid, ran, samples):
    A, W, C = augmented(grid, PAIR)
    P = np.pad(start(grid), ((0, 1), (0, 1)))
    P[-1, -1] = ETA
    want = adaptive(A, C, W, grid.R[np.ix_(PAIR, PAIR)], P, 2 * ETA, FORGETTING, samples[:, PAIR])
    got = numbers(ran / "adaptive.csv", grid.states)
    np.testing.assert_allclose(got, want[:, :4], atol=1e-6)


@pytest.mark.parametrize(("name", "variance"), [("augmented", 2 * ETA), ("augmented_blind", 0.0)])
def test_augmented_given_a_run_follows_its_reference(grid, ran, samples, name, variance):
    A, W, C = augmented(grid, PAIR)
    W[-1, -1] = variance
    P = np.pad(start(grid), ((0, 1), (0, 1)))
    P[-1, -1] = ETA
    want = kalman(A, C, W, grid.R[np.ix_(PAIR, PAIR)], P, samples[:, PAIR])
    np.testing.assert_allclose(numbers(ran / f"{name}.csv", grid.states), want[:, :4], atol=1e-6)


def test_strong_kalman_given_a_run_uses_the_strong_sensors_alone(grid, ran, samples):
    R = grid.R[np.ix_(STRONG, STRONG)]
    want = kalman(grid.A, grid.C[list(STRONG)], grid.W, R, start(grid), samples[:, STRONG])
    got = numbers(ran / "strong_kalman.csv", grid.states)
    np.testing.assert_allclose(got, want, atol=1e-6)


def test_central_kalman_given_a_run_adds_eta_to_the_weak_sensors(grid, ran, samples):
    R = grid.R + np.diag([ETA, ETA, 0, 0, 0])
    want = kalman(grid.A, grid.C, grid.W, R, start(grid), samples)
    got = numbers(ran / "central_kalman.csv", grid.states)
    np.testing.assert_allclose(got, want, atol=1e-6)


def test_compare_given_a_run_ranks_the_filters_as_the_paper_does(ran):
    methods = summary(ran)["methods"]
    assert list(methods) == ["kalman", "joint", "augmented", "augmented_blind", "adaptive",
                             "strong_kalman", "central_kalman", "oracle"]
    mse = {name: scores["mse"]["all"] for name, scores in methods.items()}
    assert mse["joint"] < mse["augmented"] < mse["augmented_blind"]
    assert mse["joint"] < mse["adaptive"] / 2
    assert mse["strong_kalman"] < 1.03 * mse["joint"]


def test_compare_given_a_design_without_joint_is_refused(blw_sim, tmp_path, refused):
    design = tmp_path / "design.json"
    design.write_text(json_text(document(design_all(load(MODELS / "grid4.toml"), ["kalman"]))))
    done = blw_sim("run", SCENARIOS / "grid4_attack.toml", "--design", design, "--out",
                   tmp_path / "out", "--compare")
    assert "joint" in refused(done)
    assert not (tmp_path / "out").exists()
