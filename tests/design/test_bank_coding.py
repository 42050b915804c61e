# SPDX-License-Identifier: MIT
"""[B] section VI: sparse observability is the distance of a code, shown for random systems."""

from itertools import combinations

import numpy as np
import pytest
from golden import MODELS

from blw.bank_coding import coding_distance
from blw.model import load, parse


def system(A, C):
    n, m = len(A), len(C)
    return parse({"name": "code", "dt_s": 1.0, "attack": {"p": 0},
                  "plant": {"A": np.asarray(A).tolist(), "C": np.asarray(C).tolist(),
                            "Q": [1.0] * n, "R": [1.0] * m}}, "code")


def symbols(model, x):
    """[m, n]: what every sensor shows of the initial state x over n steps."""
    rows = []
    for _ in range(model.n):
        rows.append(model.C @ x)
        x = model.A @ x
    return np.array(rows).T


def smallest_theta(model):
    """By the ranks of all observability matrices."""
    def observable(chosen):
        rows = [model.C[list(chosen)] @ np.linalg.matrix_power(model.A, j) for j in range(model.n)]
        return np.linalg.matrix_rank(np.vstack(rows), tol=1e-8) == model.n

    for theta in range(1, model.m + 1):
        if all(observable(chosen) for chosen in combinations(range(model.m), theta)):
            return theta
    return model.m + 1


def random_system(generator, derogatory):
    """Modes that random sensors do not see, behind a random change of coordinates."""
    n, m = 4, 6
    modes = np.array([0.9, 0.9, -0.5, 0.3]) if derogatory else np.array([0.9, 0.6, -0.5, 0.3])
    rotation = np.array([[0.6, -0.7], [0.7, 0.6]])
    A = np.diag(modes)
    if not derogatory and generator.random() < 0.5:
        A[:2, :2] = rotation
    C = generator.standard_normal((m, n)) * (generator.random((m, n)) < 0.7)
    C[0] = generator.standard_normal(n)
    T = np.linalg.qr(generator.standard_normal((n, n)))[0]
    return system(T @ A @ T.T, C @ T.T)


@pytest.mark.parametrize("derogatory", [False, True])
@pytest.mark.parametrize("seed", range(12))
def test_any_two_states_differ_in_at_least_m_minus_theta_plus_1_sensors(seed, derogatory):
    generator = np.random.default_rng(seed)
    model = random_system(generator, derogatory)
    code, theta = coding_distance(model), smallest_theta(model)
    assert code.theta == theta
    assert code.distance == model.m - theta + 1
    assert code.correctable == max(0, (code.distance - 1) // 2)
    values, vectors = np.linalg.eig(model.A)
    differences = [*generator.standard_normal((20, model.n)), *vectors.real.T, *vectors.imag.T]
    for x in differences:
        if np.abs(x).max() > 1e-6:
            shown = np.abs(symbols(model, x)).max(axis=1) > 1e-8
            assert shown.sum() >= code.distance


def test_the_distance_is_attained_by_the_mode_it_names():
    model = load(MODELS / "pendulum.toml")
    code = coding_distance(model)
    assert (code.distance, code.theta, code.correctable) == (3, 2, 1)
    assert code.mode == pytest.approx(1.0)
    assert code.sensors == ("cart1", "cart2", "cart3")
    values, vectors = np.linalg.eig(model.A)
    x = vectors[:, np.argmin(np.abs(values - 1.0))].real
    shown = np.abs(symbols(model, x)).max(axis=1) > 1e-7
    assert shown.tolist() == [True, True, True, False]


def test_a_mode_that_no_sensor_sees_leaves_no_distance():
    code = coding_distance(system(np.diag([0.5, 0.7]), [[1.0, 0.0], [2.0, 0.0]]))
    assert (code.distance, code.theta, code.correctable) == (0, 3, 0)
    assert code.sensors == ()
