# SPDX-License-Identifier: MIT
"""Fusion of [D] (24) and exact removal of sensors, for every set that may be excluded.

With P = L L' and the QR decomposition L^-1 Phi = [Q1 Q2] [R1; 0],

    Psi = R1^-1 Q1' L^-1,   N = Q2' L^-1:   x_hat = Psi z,   w = N z ~ N(0, I),   g = |w|^2     (1)

with d = mu - n degrees of freedom; N is made upper trapezoidal by rotating its rows.  Leaving the
sensors e out of (24) is the same as estimating an unknown offset of their z.  With N_i = Q_i R_i
(thin) for every sensor and an orthonormal basis [Q_a Q_b' ...] of the columns of N_e built up
sensor by sensor,

    t_a = Q_a' w,   t_b = T Q_b' w + X t,   ...   g_J = |w|^2 - |t|^2                          (2)
    x_J = Psi z - sum_i Y_i s_i,   Y_i = Psi_i R_i^-1,   s_b = T' t_b,   t += X' t_b, ...       (3)

Neither depends on z_e, which the device sets to the prediction.  The sets form a tree: a set's
parent lacks its last sensor, and T, X belong to the set.
"""

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import matrix_balance, solve_triangular

from blw.decentral_filters import LocalFilters
from blw.errors import DesignError
from blw.kalman import modes, unseen
from blw.model import Model

Array = NDArray[np.float64]

#: Smallest singular value of a stack of orthonormal bases below which a direction is unseen.
_UNSEEN = 1e-9


@dataclass(frozen=True, eq=False)
class Fusion:
    """(1): Psi [n, mu], N [d, mu] upper trapezoidal; per sensor N_i = Q_i R_i, Q [d, mu_i],
    R [mu_i, mu_i] upper triangular, and Y [n, mu_i]."""

    Psi: Array
    N: Array
    Q: list[Array]
    R: list[Array]
    Y: list[Array]

    def rows(self, first: Array, i: int) -> int:
        """Rows of Q_i that are not zero: N is trapezoidal."""
        return min(int(first[i + 1]), len(self.N))


@dataclass(frozen=True, eq=False)
class Node:
    """One set of sensors to leave out: its parent lacks `sensors[-1]`.

    T [mu_b, mu_b] lower triangular and X [mu_b, rows of the parent] of (2); for a set of one
    sensor T = I.  trace_P is that of x_J.
    """

    sensors: tuple[int, ...]
    parent: int
    T: Array
    X: Array
    trace_P: float


def fuse(filters: LocalFilters) -> Fusion:
    """(1) and the factors of N_i.  Raises DesignError if P is not positive definite or mu = n."""
    mu, n = filters.Phi.shape
    if mu <= n:
        raise DesignError(f"{mu} local states for {n} states: no redundancy to test")
    L = cholesky(filters)
    whitened = solve_triangular(L, filters.Phi, lower=True)
    Q, R = np.linalg.qr(whitened, mode="complete")
    left = solve_triangular(L.T, Q).T
    Psi = solve_triangular(R[:n], left[:n])
    N = np.linalg.qr(left[n:], mode="r")
    factors = [np.linalg.qr(N[:, filters.rows(i)]) for i in range(len(filters.S))]
    Y = [solve_triangular(factor.R.T, Psi[:, filters.rows(i)].T, lower=True).T
         for i, factor in enumerate(factors)]
    return Fusion(Psi, N, [factor.Q for factor in factors], [factor.R for factor in factors], Y)


def cholesky(filters: LocalFilters) -> Array:
    """L of P = L L' [mu, mu].  Raises DesignError naming the sensor whose state has no error."""
    scale = np.sqrt(np.diag(filters.P))
    if not np.all(scale > 0.0):
        row = int(np.argmin(scale))
        sensor = int(np.searchsorted(filters.first, row, side="right"))
        raise DesignError(f"no noise reaches a local state of sensor {sensor}: the covariance of "
                          "the local estimates is singular; give B Q B' a part in it")
    try:
        L = np.linalg.cholesky(filters.P / np.outer(scale, scale))
    except np.linalg.LinAlgError:
        raise DesignError("the covariance P of the stacked local estimates is not positive "
                          "definite in double precision: two sensors tell the same, or some mode "
                          "has no process noise") from None
    return scale[:, None] * L


def excluded_sets(model: Model, filters: LocalFilters) -> tuple[list[tuple[int, ...]], int]:
    """All sets of up to p units (sensors, or groups that fall together), closed under parents.

    Returns them sorted by size, the empty set first, and the number of rows of the largest.
    A unit alone is listed for p = 0 too, for a sensor that falls silent.  Sets without which the
    others do not see the whole state are left out.
    """
    units = [tuple(sorted(unit)) for unit in model.units]
    bases = balanced_bases(model, filters)
    found = {()}
    for size in range(1, max(model.p, 1) + 1):
        for chosen in combinations(units, size):
            members = tuple(sorted(sum(chosen, ())))
            if observes(bases, members):
                found.update(members[:length] for length in range(1, len(members) + 1))
    ordered = sorted(found, key=lambda sensors: (len(sensors), sensors))
    return ordered, max(sum(int(filters.mu[i]) for i in sensors) for sensors in ordered)


def candidates(model: Model) -> list[tuple[int, ...]]:
    """The sets that the search compares: exactly p units are left out."""
    if model.p == 0:
        return []
    units = [tuple(sorted(unit)) for unit in model.units]
    return sorted({tuple(sorted(sum(chosen, ()))) for chosen in combinations(units, model.p)})


def check_redundancy(model: Model, filters: LocalFilters) -> None:
    """[D] Assumption 3: without any 2p units the others still observe the whole state.

    Raises DesignError naming sensors and mode.
    """
    bases = balanced_bases(model, filters)
    if not observes(bases, ()):
        raise DesignError(f"(A, C) is not observable: {_unseen_mode(model, ())}")
    units = model.units
    for chosen in combinations(units, min(2 * model.p, len(units))):
        gone = tuple(sum(chosen, []))
        if not observes(bases, gone):
            names = ", ".join(model.sensors[i] for i in sorted(gone))
            raise DesignError(f"p = {model.p} needs the state to be observable without any "
                              f"{2 * model.p} sensors or groups, but without {names} "
                              f"{_unseen_mode(model, gone)}")


def balanced_bases(model: Model, filters: LocalFilters) -> list[Array]:
    """Orthonormal bases [mu_i, n] of the observable subspaces in coordinates that balance A."""
    scale = matrix_balance(model.A, permute=False, separate=True)[1][0]
    return [np.linalg.qr((filters.Phi[filters.rows(i)] * scale).T)[0].T for i in range(model.m)]


def observes(bases: list[Array], gone: tuple[int, ...]) -> bool:
    """Whether the sensors that are not gone see the whole state."""
    left = [basis for i, basis in enumerate(bases) if i not in gone]
    if not left:
        return False
    stacked = np.vstack(left)
    information = np.linalg.svd(stacked, compute_uv=False)
    return len(information) == stacked.shape[1] and bool(information[-1] > _UNSEEN)


def removal_tree(filters: LocalFilters, fusion: Fusion,
                 sets: list[tuple[int, ...]]) -> list[Node]:
    """T and X of (2) for every set, in the order of `sets`: parents first."""
    n, d = filters.Phi.shape[1], len(fusion.N)
    cov = fusion.Psi @ filters.P @ fusion.Psi.T
    nodes = [Node((), 0, np.zeros((0, 0)), np.zeros((0, 0)), float(np.trace(cov)))]
    place = {(): 0}
    bases = {(): (np.zeros((d, 0)), np.zeros((n, 0)))}  # [Q_a Q_b' ...] and what t does to x_hat
    for sensors in sets[1:]:
        parent = place[sensors[:-1]]
        before, moves = bases[sensors[:-1]]
        Q, Y = fusion.Q[sensors[-1]], fusion.Y[sensors[-1]]
        G = before.T @ Q
        rest, R = np.linalg.qr(Q - before @ G) if before.size else (Q, np.eye(Q.shape[1]))
        T = np.tril(np.linalg.inv(R.T))
        X = -T @ G.T
        move = Y @ T.T + moves @ X.T
        bases[sensors] = np.column_stack([before, rest]), np.column_stack([moves, move])
        place[sensors] = len(nodes)
        nodes.append(Node(sensors, parent, T, X,
                          nodes[parent].trace_P + float(np.sum(move**2))))
    return nodes


def _unseen_mode(model: Model, gone: tuple[int, ...]) -> str:
    left = np.array([model.C[i] for i in range(model.m) if i not in gone])
    if not len(left):
        return "no sensor is left"
    for z in modes(model.A):
        if unseen(model.A, left, z):
            value = f"{z.real:.6g}" if z.imag == 0 else f"{z.real:.6g} +- {z.imag:.6g}i"
            return f"no sensor sees the mode {value}"
    return "a direction of the state cannot be told from rounding"
