# SPDX-License-Identifier: MIT
"""Plants for the tests of guard, and samples of them."""

import golden
import numpy as np
import scipy.linalg

from blw import kalman, model


def seeded(n, m, seed, eigenvalues=None):
    """A random plant; eigenvalues: a real matrix that A is similar to."""
    generator = np.random.default_rng(seed)
    if eigenvalues is None:
        return golden.random_plant(n, m, seed)
    basis = np.linalg.qr(generator.standard_normal((n, n)))[0]
    return golden.build("seeded", {
        "A": basis @ eigenvalues @ basis.T, "Bu": generator.standard_normal((n, 1)),
        "C": generator.standard_normal((m, n)), "Q": 0.1 * np.eye(n), "R": 0.2 * np.eye(m)})


def delays():
    """Two states and a delay line of three behind the first: A is singular and defective."""
    A = np.zeros((5, 5))
    A[:2, :2] = [[1.0, 0.1], [0.0, 1.0]]
    A[2, 0] = A[3, 2] = A[4, 3] = 1.0
    C = np.array([[1.0, 0, 0, 0, 0], [0, 0, 1, 0, 0], [0, 0, 0, 0, 1], [1, 0, 0, 0, 0]])
    return golden.build("delays", {"A": A, "Bu": [[0.0], [1.0], [0.0], [0.0], [0.0]], "C": C,
                                   "B": np.eye(5)[:, :2], "Q": 0.01 * np.eye(2),
                                   "R": 0.1 * np.eye(4)})


def stable():
    return seeded(4, 4, 3, np.diag([0.8, 0.5, 0.2, -0.3]))


def shared():
    """A stable mode 0.95 that no noise moves: a pole of A - K C A equals an eigenvalue of A."""
    return golden.build("shared", {
        "A": [[1.0, 0.0], [0.0, 0.95]], "Bu": [[1.0], [0.0]],
        "C": [[1.0, 1.0], [1.0, 0.5], [1.0, -1.0]],
        "B": [[1.0], [0.0]], "Q": [[0.1]], "R": np.eye(3)})


PLANTS = {
    "random": lambda: seeded(4, 5, 1),
    "derogatory": lambda: golden.two_axes(0.0),
    "nearly derogatory": lambda: golden.two_axes(1e-9),
    "singular": lambda: seeded(5, 6, 2, np.diag([1.0, 0.97, 0.0, 0.0, 0.4])),
    "delays": delays,
    "stable": stable,
    "shared": shared,
    "complex": lambda: seeded(4, 5, 4, scipy.linalg.block_diag(
        0.99 * np.array([[0.8, 0.6], [-0.6, 0.8]]), np.array([[1.0, 1.0], [0.0, 1.0]]))),
    "two sensors": lambda: seeded(2, 2, 6, np.diag([1.0, 0.5])),
    "large": lambda: seeded(20, 40, 7),
}


def simulate(plant, steps, seed, feedback=None):
    """y [steps, m], u [steps, l], x [steps, n] from x(0) = 0; u = -feedback x."""
    generator = np.random.default_rng(seed)
    root = scipy.linalg.cholesky(plant.Q + 1e-300 * np.eye(len(plant.Q)), lower=True)
    R_root = np.linalg.cholesky(plant.R)
    x, rows = np.zeros(plant.n), []
    for _ in range(steps):
        u = -(np.zeros((plant.l, plant.n)) if feedback is None else feedback) @ x
        x = plant.A @ x + plant.Bu @ u + plant.B @ root @ generator.standard_normal(len(plant.Q))
        y = plant.C @ x + plant.offset + R_root @ generator.standard_normal(plant.m)
        rows.append((y, u, x))
    return tuple(np.array(column) for column in zip(*rows))


def liu5():
    return *golden.shipped("liu5"), [[0.0, 0.0, -2.0]]


def pendulum():
    return *golden.shipped("pendulum"), [[-0.604, -1.678, -39.514, -9.721]]


def trace_without(plant, sensors):
    """tr P of the Kalman filter without these sensors."""
    rest = [i for i in range(plant.m) if i not in sensors]
    return np.trace(kalman.steady_state(plant.A, plant.C[rest], plant.W,
                                        plant.R[np.ix_(rest, rest)]).P)


def colluding_plant():
    """n = 4, m = 8: any four sensors see everything, fewer need not."""
    generator = np.random.default_rng(12)
    A = scipy.linalg.block_diag([[1.0, 0.1], [0.0, 1.0]], [[0.98, 0.15], [-0.15, 0.98]])
    plant = {"A": A.tolist(), "Bu": np.zeros((4, 1)).tolist(),
             "C": generator.standard_normal((8, 4)).tolist(), "Q": [0.01] * 4, "R": [0.1] * 8}
    made = model.parse({"name": "pair", "dt_s": 0.1, "plant": plant, "attack": {"p": 2}}, "pair")
    return made, kalman.steady_state(made.A, made.C, made.W, made.R)
