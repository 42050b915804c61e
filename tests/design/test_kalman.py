# SPDX-License-Identifier: MIT
"""Steady-state Kalman filter and the refusals that come with it."""

from pathlib import Path

import numpy as np
import pytest

from blw import kalman, model
from blw.errors import DesignError

MODELS = Path(__file__).resolve().parents[2] / "host_sim" / "models"
NAMES = ["liu5", "pendulum", "grid4", "torsion", "drone5", "drone6"]

# [L] section VI, as printed.
LIU_P_TRACE = 0.8317
LIU_EIGENVALUES = [0.1061, 0.1925, -0.2848]


def load(name: str) -> tuple[model.Model, kalman.Kalman]:
    plant = model.load(MODELS / f"{name}.toml")
    return plant, kalman.steady_state(plant.A, plant.C, plant.W, plant.R)


@pytest.mark.parametrize("name", NAMES)
def test_steady_state_given_shipped_model_satisfies_the_riccati_equation(name):
    plant, found = load(name)
    S = plant.C @ found.Pp @ plant.C.T + plant.R
    np.testing.assert_allclose(found.K @ S, found.Pp @ plant.C.T,
                               atol=1e-12 * np.abs(found.Pp).max())
    np.testing.assert_allclose(plant.A @ found.P @ plant.A.T + plant.W, found.Pp,
                               atol=1e-11 * np.abs(found.Pp).max())
    np.testing.assert_array_equal(found.P, found.P.T)
    assert np.abs(np.linalg.eigvals(found.Acl)).max() < 1


def test_steady_state_given_paper_example_has_the_printed_numbers():
    _, found = load("liu5")
    assert np.trace(found.P) == pytest.approx(LIU_P_TRACE, abs=5e-5)
    np.testing.assert_allclose(sorted(np.linalg.eigvals(found.Acl).real),
                               sorted(LIU_EIGENVALUES), atol=5e-5)


def test_steady_state_given_the_pendulum_has_the_published_trace():
    plant, found = load("pendulum")
    assert np.trace(found.P) == pytest.approx(0.0511, abs=5e-5)
    without = kalman.steady_state(plant.A, plant.C[:3], plant.W, plant.R[:3, :3])
    assert np.trace(without.P) == pytest.approx(0.859, abs=5e-4)


def test_steady_state_given_scalar_random_walk_has_the_golden_gain():
    found = kalman.steady_state([[1.0]], [[1.0]], [[1.0]], [[1.0]])
    assert found.K[0, 0] == pytest.approx((np.sqrt(5) - 1) / 2, abs=1e-14)


def test_steady_state_given_ill_conditioned_modes_in_any_units_finds_the_solution():
    rng = np.random.default_rng(3)
    for _ in range(300):
        angle, T = rng.uniform(0.05, 1.5), rng.standard_normal((3, 3))
        J = np.diag([np.cos(angle), np.cos(angle), 0.6])
        J[0, 1], J[1, 0] = -np.sin(angle), np.sin(angle)
        units = 10.0 ** rng.uniform(-4, 4, 3)
        T *= units[:, None]
        A, C = 0.94 * T @ J @ np.linalg.inv(T), rng.standard_normal((5, 3)) / units
        W, R = np.diag(units**2 * 10.0 ** rng.uniform(-3, 0, 3)), np.diag(rng.uniform(1.0, 9.0, 5))
        found = kalman.steady_state(A, C, W, R)
        error = A @ found.P @ A.T + W - found.Pp
        size = np.sqrt(np.diag(found.Pp))
        assert np.abs(error / np.outer(size, size)).max() <= 1e-6


def test_steady_state_given_a_mode_without_noise_has_no_negative_variance():
    A, C = np.array([[0.901, 1.0], [0.0, 0.001]]), np.array([[-1.67, -2.41], [-1.69, -0.53]])
    found = kalman.steady_state(A, C, np.diag([0.036, 0.0]), np.diag([0.26, 3.5]))
    assert np.diag(found.Pp).min() >= 0.0


def test_steady_state_given_correlated_R_minimises_the_trace():
    rng = np.random.default_rng(1)
    A = np.array([[0.9, 0.2], [0.0, 1.0]])
    C = rng.standard_normal((3, 2))
    L = rng.standard_normal((3, 3))
    R = L @ L.T + 0.1 * np.eye(3)
    found = kalman.steady_state(A, C, np.eye(2), R)
    for _ in range(20):
        K = found.K + 1e-2 * rng.standard_normal(found.K.shape)
        keep = np.eye(2) - K @ C
        assert np.trace(keep @ found.Pp @ keep.T + K @ R @ K.T) > np.trace(found.P)


def test_steady_state_given_unobservable_stable_mode_keeps_the_model():
    found = kalman.steady_state(np.diag([0.5, 1.0]), [[0.0, 1.0]], np.eye(2), [[1.0]])
    assert found.K[0, 0] == pytest.approx(0.0, abs=1e-12)
    assert kalman.unobservable_modes(np.diag([0.5, 1.0]), np.array([[0.0, 1.0]])) == [0.5]


def rotated(A: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A in other coordinates, and the change of coordinates."""
    T = np.linalg.qr(np.random.default_rng(3).standard_normal(A.shape))[0]
    return T @ A @ T.T, T


@pytest.mark.parametrize("A, c, mode", [
    (np.diag([1.0, 0.5]), [0.0, 1.0], r"mode 1 "),
    (np.diag([-2.0, 0.5]), [0.0, 1.0], r"mode -2 "),
    (np.array([[1.0, 1.0], [0.0, 1.0]]), [0.0, 1.0], r"mode 1 "),
    (np.array([[0.0, -1.1, 0], [1.1, 0.0, 0], [0, 0, 0.5]]), [0.0, 0.0, 1.0],
     r"mode .*\+- 1\.1i"),
])
def test_steady_state_given_undetectable_mode_names_it(A, c, mode):
    turned, T = rotated(A)
    C = np.array([c]) @ T.T
    with pytest.raises(DesignError, match="no sensor sees the " + mode + ".*not detectable"):
        kalman.steady_state(turned, C, np.eye(len(A)), [[1.0]])


def test_steady_state_given_marginal_mode_without_noise_names_it():
    A, T = rotated(np.diag([1.0, 0.5]))
    W = T @ np.diag([0.0, 1.0]) @ T.T
    with pytest.raises(DesignError, match="no noise reaches the mode 1 .*not stabilisable"):
        kalman.steady_state(A, np.eye(2), W, np.eye(2))


@pytest.mark.parametrize("R, message", [
    ([[1.0, 0.0], [0.0, 0.0]], "sensor 2 has the variance 0"),
    ([[1.0, 1.0], [1.0, 1.0]], "R is not positive definite: the smallest eigenvalue"),
    ([[1.0, 2.0], [2.0, 1.0]], "R is not positive definite: the smallest eigenvalue"),
])
def test_steady_state_given_R_not_positive_definite_refuses(R, message):
    with pytest.raises(DesignError, match=message):
        kalman.steady_state([[0.5]], [[1.0], [1.0]], [[1.0]], R)


@pytest.mark.parametrize(("A", "message"), [
    ([[1e30, 0.0], [0.0, 0.5]], r"a mode that grows 1e\+30 times in a step, at most 6.7e\+07"),
    ([[0.9, 1e30], [0.01, 0.985]], r"a mode that grows 1e\+14 times in a step"),
    ([[0.9, 1e30], [0.0, 0.985]], r"the entries of A reach from 0.9 to 1e\+30: choose units"),
])
def test_steady_state_given_A_beyond_double_precision_refuses(recwarn, A, message):
    C = [[1.0, 0.0], [0.9, 0.1], [0.0, 1.0]]
    with pytest.raises(DesignError, match=message):
        kalman.steady_state(A, C, 0.01 * np.eye(2), 0.1 * np.eye(3))
    assert not recwarn.list


def test_steady_state_given_indefinite_W_refuses():
    with pytest.raises(DesignError, match="B Q B' is not positive semidefinite"):
        kalman.steady_state(np.eye(2) / 2, np.eye(2), np.diag([1.0, -1.0]), np.eye(2))


def test_design_given_model_makes_the_gain_table():
    plant, found = load("liu5")
    designed = kalman.design(plant, found, kalman.Options())
    assert designed.tables.method == "kalman"
    assert designed.mem == (3, 5)
    np.testing.assert_array_equal(designed.tables.to_json()["K"], found.K.ravel())
    np.testing.assert_allclose(designed.info["sigma"], np.sqrt(np.diag(found.P)))
