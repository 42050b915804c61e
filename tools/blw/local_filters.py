# SPDX-License-Identifier: MIT
"""Local filters of [L]: one bank of r states per sensor whose weighted sum is the Kalman estimate.

    zeta_i(k+1) = J zeta_i(k) + b y_i(k+1) + D_i u(k),    D_i = G_i Bu - b C_i Bu              (1)
    J G_i = G_i A - b C_i A                                                      [L] (20)      (2)
    F_i J = Acl F_i,   F_i b = K_i                                               [L] (13)      (3)
    W = J~ W J~' + N Q N' + R (x) b b',   N_i = (G_i - b C_i) B                  [L] (29)      (4)

J is the real Jordan form of Acl = A - K C A, one chain per distinct eigenvalue; stacked over the
sensors G is [m r x n], F [n x m r], W [m r x m r].  Without attack zeta - G x ~ N(0, W).
"""

from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from blw import jordan_form
from blw.errors import DesignError
from blw.jordan_form import JordanForm
from blw.kalman import Kalman
from blw.model import Model

Array = NDArray[np.float64]

#: Distances below which eigenvalues may be treated as one chain; the best conditioned W wins.
TOLERANCES = (1e-10, 1e-8, 1e-6, 1e-5, 1e-4, 1e-3)

#: More of them, tried only where cond(W) stays above COND_COARSE: eigenvalues this far apart belong
#: to modes of their own as long as the arithmetic can tell them apart.
COARSE_TOLERANCES = (3e-3, 1e-2)
COND_COARSE = 1e12

#: Above this condition number of the equilibrated W its Cholesky factor is noise.
COND_LIMIT = 1e13

#: A and Acl share an eigenvalue if two of them are closer than this: G would be of size 1/gap.
_SHARED = 1e-9


@dataclass(frozen=True, eq=False)
class LocalFilters:
    """The filters (1) and the covariance (4) of their errors."""

    form: JordanForm
    G: Array
    F: Array
    W: Array
    D: Array  #: [m r x l]
    cond_W: float

    @property
    def r(self) -> int:
        return self.form.r


def local_filters(model: Model, kalman: Kalman) -> LocalFilters:
    """Local filters of `model` around the steady-state Kalman filter.

    Raises DesignError if A and Acl share an eigenvalue or W cannot be inverted in double precision.
    """
    _refuse_shared_eigenvalue(model, kalman)
    best = _best(model, kalman, TOLERANCES)
    if best is None or best.cond_W > COND_COARSE:
        best = _best(model, kalman, COARSE_TOLERANCES, best)
    if best is None:
        raise DesignError("A - K C A has no numerically stable Jordan form; use guard")
    _refuse_ill_conditioned(best)
    return best


def _best(
    model: Model, kalman: Kalman, tolerances: tuple[float, ...], best: LocalFilters | None = None
) -> LocalFilters | None:
    """The filters with the smallest cond(W) among `best` and those with the given tolerances."""
    tried = set()
    for tolerance in tolerances:
        try:
            form = jordan_form.jordan_form(kalman.Acl, tolerance)
            clusters = tuple(block.multiplicity for block in form.blocks)
            if clusters in tried:
                continue
            candidate = filters_for(model, kalman, form)
        except np.linalg.LinAlgError:
            continue
        tried.add(clusters)
        best = candidate if best is None or candidate.cond_W < best.cond_W else best
    return best


def filters_for(model: Model, kalman: Kalman, form: JordanForm) -> LocalFilters:
    """Local filters in the given Jordan form of Acl, however conditioned.

    Raises numpy.linalg.LinAlgError if they cannot be computed at all.
    """
    G = measured_part(form, model.A, model.C)
    F = fusion(form, kalman.K)
    W = error_covariance(form, G, model)
    D = (G - np.kron(model.C, form.b[:, None])) @ model.Bu
    cond_W = float(np.linalg.cond(W))
    return LocalFilters(form, G, F, W, D, cond_W if np.isfinite(cond_W) else np.inf)


def measured_part(form: JordanForm, A: Array, C: Array) -> Array:
    """G [m r x n] of (2); one step of iterative refinement."""
    parts = []
    for C_i in C:
        right = -np.outer(form.b, C_i @ A)
        G_i = scipy.linalg.solve_sylvester(form.J, -A, right)
        G_i += scipy.linalg.solve_sylvester(form.J, -A, right - (form.J @ G_i - G_i @ A))
        parts.append(G_i)
    return np.vstack(parts)


def fusion(form: JordanForm, K: Array) -> Array:
    """F [n x m r] of (3), chain by chain in the invariant subspaces of Acl."""
    parts = jordan_form.components(form, K)
    columns = []
    for i in range(K.shape[1]):
        for U, T, link, part in zip(form.bases, form.compressions, form.links, parts):
            Y = jordan_form.intertwiner(T, link, np.ones(len(link)), part[:, i])
            columns.append(jordan_form.real_columns(U @ Y))
    return np.hstack(columns)


def error_covariance(form: JordanForm, G: Array, model: Model) -> Array:
    """W [m r x m r] of (4).

    All m^2 blocks obey the same equation of order r^2, so one factorisation serves them all.
    """
    m, r = model.m, form.r
    N = (G - np.kron(model.C, form.b[:, None])) @ model.B
    Xi = N @ model.Q @ N.T + np.kron(model.R, np.outer(form.b, form.b))
    stacked = Xi.reshape(m, r, m, r).transpose(1, 3, 0, 2).reshape(r * r, m * m)
    factor = scipy.linalg.lu_factor(np.eye(r * r) - np.kron(form.J, form.J))
    solved = scipy.linalg.lu_solve(factor, stacked)
    W = solved.reshape(r, r, m, m).transpose(2, 0, 3, 1).reshape(m * r, m * r)
    return (W + W.T) / 2.0


def _refuse_shared_eigenvalue(model: Model, kalman: Kalman) -> None:
    of_A = np.linalg.eigvals(model.A)
    of_Acl = np.linalg.eigvals(kalman.Acl)
    gap = np.abs(of_A[:, None] - of_Acl[None, :])
    row, column = np.unravel_index(np.argmin(gap), gap.shape)
    smallest = np.min(np.abs(of_A))
    if smallest < _SHARED:
        raise DesignError(
            f"A is singular (smallest |eigenvalue| {smallest:.1e}), which the local filters of"
            " lasso and canonical exclude; use guard"
        )
    if gap[row, column] < _SHARED:
        raise DesignError(
            f"A and A - K C A share the eigenvalue {of_A[row]:.6g} (gap {gap[row, column]:.1e}):"
            " no sensor sees this mode or no noise drives it; lasso and canonical cannot serve it,"
            " use guard"
        )


def _refuse_ill_conditioned(filters: LocalFilters) -> None:
    deviation = np.sqrt(np.abs(np.diag(filters.W)))
    spectrum = np.linalg.eigvalsh(filters.W / np.outer(deviation, deviation))
    if spectrum[0] <= 0.0 or spectrum[-1] > COND_LIMIT * spectrum[0]:
        raise DesignError(
            "the covariance W of the local errors is not positive definite in double precision:"
            f" scaled to unit diagonal its eigenvalues go from {spectrum[0]:.1e} to"
            f" {spectrum[-1]:.1e}, cond(W) = {filters.cond_W:.1e}, {filters.r} Jordan states per"
            " sensor; use guard"
        )
