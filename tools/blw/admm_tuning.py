# SPDX-License-Identifier: MIT
"""Penalty and iteration bound of ADMM for the reduced l1 fusion, tuned on simulated attacks.

    nu = M (l0 + rho (t - u)),   M = (S + rho I)^-1,   l0 = S zeta                             (1)
    v  = alpha nu + (1 - alpha) t + u,   t = soft(v, c / rho) group by group,   u = v - t      (2)

alpha = 1.6, cold start t = u = 0.  The state nu is shifted by zeta on the device (tau = zeta - nu);
that changes no iterate.  What counts is the error of x_hat in benign standard deviations.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from blw.l1 import Groups, Reduced, thresholds

Array = NDArray[np.float64]

RHOS = (0.003, 0.01, 0.03, 0.1, 0.3, 1.0)
ALPHA = 1.6

#: The bound is the worst simulated count times this.
_MARGIN = 1.5
_MAX_PASSES = 4000
_WINDOW = 50
#: Multiply-adds that one penalty may cost.
_WORK = 4e9
_TINY = 1e-300
_SAMPLES = 48
#: Attack sizes in benign standard deviations of the local states.
_SIZES = (5.0, 30.0, 100.0)
_SEED = 20210304


@dataclass(frozen=True, eq=False)
class Problem:
    """One fusion problem in scaled coordinates, and the local filters that feed it."""

    reduced: Reduced
    groups: Groups
    F: Array  #: [n x N] unscaled
    gamma: float
    response: Array  #: [m x r] unscaled stationary answer to a constant bias of 1 on each sensor


@dataclass(frozen=True)
class Tuned:
    """Outcome of the tuning."""

    rho: float
    iterations: int  #: bound: worst simulated count with a margin
    worst: int  #: worst simulated count
    converged: bool  #: False: the tolerance was not reached within the passes tried


def attacked_samples(problem: Problem) -> Array:
    """zeta [N x k], scaled: benign noise plus one constantly biased sensor each."""
    generator = np.random.default_rng(_SEED)
    m, r = problem.response.shape
    W, scale = problem.reduced.W, problem.reduced.scale
    zeta = np.linalg.cholesky(W) @ generator.standard_normal((m * r, _SAMPLES))
    for k in range(_SAMPLES):
        rows = slice((k % m) * r, (k % m) * r + r)
        shape = scale[rows] * problem.response[k % m]
        deviation = np.sqrt(np.trace(W[rows, rows]) / (shape @ shape))
        zeta[rows, k] += _SIZES[(k // m) % len(_SIZES)] * deviation * shape
    return zeta


def iterates(reduced: Reduced, groups: Groups, c: Array, l0: Array, rho: float) -> Iterator[Array]:
    """t [N x k] after every pass of (1), (2) from a cold start, for l0 = S zeta [N x k] and
    thresholds c [g]; endless."""
    S = reduced.S
    limit = c[:, None] / rho
    M = np.linalg.inv(S + rho * np.eye(S.shape[0]))
    offset, gain = M @ l0, rho * M
    t, u = np.zeros_like(l0), np.zeros_like(l0)
    while True:
        nu = offset + gain @ (t - u)
        v = ALPHA * nu + (1.0 - ALPHA) * t + u
        keep = np.maximum(0.0, 1.0 - limit / np.maximum(groups.norms(v), _TINY))
        t = groups.spread(keep) * v
        u = v - t
        yield t


def trajectory(
    problem: Problem, zeta: Array, rho: float, passes: int, settled: Array | None = None
) -> Array:
    """x_hat [passes x n x k] after every pass of (1), (2) from a cold start.

    Ends early when no x_hat moved by more than settled [n] within _WINDOW passes.
    """
    c = thresholds(problem.reduced, problem.groups, problem.gamma)
    F = problem.F / problem.reduced.scale
    found = np.empty((passes, F.shape[0], zeta.shape[1]))
    run = iterates(problem.reduced, problem.groups, c, problem.reduced.S @ zeta, rho)
    for index, t in enumerate(islice(run, passes)):
        found[index] = F @ (zeta - t)
        if settled is not None and index % _WINDOW == _WINDOW - 1 and index > _WINDOW:
            if np.all(np.abs(found[index] - found[index - _WINDOW]) <= settled[:, None]):
                return found[: index + 1]
    return found


def tune(problem: Problem, sigma: Array, tolerance: float) -> Tuned:
    """rho with the smallest worst count of passes to `tolerance` standard deviations sigma [n].

    The first penalties that settle give the solution and limit the passes granted to the others.
    """
    zeta = attacked_samples(problem)
    passes = int(np.clip(_WORK / (zeta.shape[0] ** 2 * zeta.shape[1]), 4 * _WINDOW, _MAX_PASSES))
    settled = 1e-3 * tolerance * sigma
    solution, converged, runs = None, False, {}
    for rho in RHOS:
        runs[rho] = run = trajectory(problem, zeta, rho, passes, settled)
        if len(run) < passes or solution is None:
            converged = len(run) < passes
            solution, passes = run[-1], len(run)
    counts = {rho: _worst_count(run, solution, sigma, tolerance) for rho, run in runs.items()}
    rho = min(counts, key=counts.__getitem__)
    return Tuned(rho, min(65535, int(np.ceil(_MARGIN * counts[rho]))), counts[rho], converged)


def _worst_count(
    run: Array, solution: Array, sigma: Array, tolerance: float
) -> int:
    """Passes after which every sample stays within tolerance of the solution."""
    error = np.max(np.abs(run - solution) / sigma[:, None], axis=(1, 2))
    outside = np.flatnonzero(error > tolerance)
    return int(outside[-1]) + 2 if outside.size else 1


def advice(tuned: Tuned, N: int, d: int) -> str:
    """One line: what ADMM costs here, and when it is the wrong engine."""
    admm = tuned.iterations * N * N
    pivots = 2 * N * 2 * (N * d - d * (d - 1) // 2)
    ratio = admm / pivots
    text = f"{tuned.iterations} passes of {N * N} multiply-adds, {ratio:.1f} times 2 N pivots"
    if not tuned.converged:
        return text + "; the tolerance was not reached in simulation: use active_set"
    return text + ("; active_set is cheaper here" if ratio > 2.0 else "")
