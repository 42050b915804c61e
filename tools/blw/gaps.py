# SPDX-License-Identifier: MIT
"""Filters with constant gains for sensors that send in a share q of the steps (docs/recorded.md).

A sample counts w = 1/q times, so that in the mean it is one in every step.  That it comes or not is
noise: with g_i = 1 in a share q_i of the steps and the innovation e of the covariance S,

    w_i g_i e_i = e_i + (w_i g_i - 1) e_i,    cov = S + D o S,    D_ii = w_i - 1              (1)

and D_ij = TOGETHER sqrt(D_ii D_jj): of two sensors nobody knows whether they send together.  So the
best constant gains are those of a Kalman filter whose sensors have the noise

    R_gaps = R + D o (C Pp C' + R)                                                              (2)

with its own predicted covariance Pp, a fixed point; and its P is that of the estimate with gaps.
A gain K on the samples that come, whatever it is, makes the error

    P = E[(I - K G C) (A P A' + W) (I - K G C)'] + E[K G R G K'],   E[G X G] = cov(g) o X + q q' o X
                                                                                                (3)
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from blw.errors import DesignError
from blw.kalman import Kalman, steady_state
from blw.model import Model

#: Correlation of the gaps of two sensors.  0 is worse where the gaps are common, 1 where they are
#: independent or periodic, 0.5 good in all three (docs/recorded.md, docs/gap_figures.py).
TOGETHER = 0.5

ROUNDS = 300
SETTLED = 1e-11      # relative change of R_gaps
ENDLESS = 1e6        # times what it was after one round: it has no fixed point

Array = NDArray[np.float64]


def averaged(model: Model) -> tuple[Model, Kalman]:
    """The model with R_gaps in place of R, and its filter; both as they are if rate is 1.

    Raises DesignError as steady() does.
    """
    kalman, R = steady(model.A, model.C, model.W, model.R, model.weight)
    return replace(model, R=R), kalman


def cautious(model: Model, kalman: Kalman) -> tuple[Model, Kalman]:
    """For methods that count every sample once: the model and its filter as they are, or those of
    averaged() where their gains, not multiplied by model.weight, leave the smaller error.

    Raises DesignError as steady() does.
    """
    if np.all(model.rate == 1.0):
        return model, kalman
    careful = averaged(model)
    units = 1.0 / np.sqrt(np.diag(model.C @ kalman.Pp @ model.C.T + model.R))
    seen = units[:, None] * model.C

    def error(K: Array) -> float:
        P = covariance(model.A, model.C, model.W, model.R, model.rate, K)
        return np.inf if P is None else float(np.trace(seen @ P @ seen.T))

    return (model, kalman) if error(kalman.K) <= error(careful[1].K) else careful


def covariance(A: Array, C: Array, W: Array, R: Array, rate: Array, K: Array) -> Array | None:
    """P [n, n] of (3) with the gain K [n, m] on samples; None if it has no limit."""
    n = len(A)
    V = _spread(rate * (1.0 - rate))
    mean = np.eye(n) - K @ (rate[:, None] * C)
    moved = np.einsum("ai,ib->iab", K, C @ A)
    operator = np.kron(mean @ A, mean @ A)
    operator += np.einsum("ij,iab,jcd->acbd", V, moved, moved, optimize=True).reshape(n * n, n * n)
    if not np.abs(np.linalg.eigvals(operator)).max() < 1.0:
        return None
    fresh = mean @ W @ mean.T
    fresh += K @ (V * (C @ W @ C.T) + (V + np.outer(rate, rate)) * R) @ K.T
    return np.linalg.solve(np.eye(n * n) - operator, fresh.ravel()).reshape(n, n)


def steady(A: Array, C: Array, W: Array, R: Array, weight: Array) -> tuple[Kalman, Array]:
    """The filter for samples that count weight [m] times, its K yet to be multiplied by them, and
    R_gaps [m, m] of (2).

    A [n, n], C [m, n], W [n, n], R [m, m] of single samples.  Raises DesignError as
    kalman.steady_state() does, and if the sensors send too seldom for any constant gain.
    """
    last, least = R, None
    for _ in range(ROUNDS):
        found = steady_state(A, C, W, last)
        R_gaps = noise(C, found.Pp, R, weight)
        if np.abs(np.diag(R_gaps - last)).max() <= SETTLED * np.diag(R_gaps).max():
            return found, R_gaps
        least = np.diag(R_gaps) if least is None else least
        if (np.diag(R_gaps) > ENDLESS * least).any():
            break
        last = R_gaps
    raise DesignError("the sensors send too seldom: with constant gains the error grows without "
                      "limit")


def noise(C: Array, Pp: Array, R: Array, weight: Array) -> Array:
    """[m, m] R_gaps of (2) about a filter with the predicted covariance Pp [n, n]."""
    return R + _spread(weight - 1.0) * (C @ Pp @ C.T + R)


def _spread(variances: Array) -> Array:
    """[m, m] the covariance with these variances [m] and the correlation TOGETHER."""
    root = np.sqrt(variances)
    D = TOGETHER * np.outer(root, root)
    np.fill_diagonal(D, variances)
    return D
