# SPDX-License-Identifier: MIT
"""Steady-state Kalman filter, [L] (3)-(8), and the design of the method `kalman`.

    Pp  = A P A' + W                      W = B Q B'
    K   = Pp C' (C Pp C' + R)^-1
    P   = (I - K C) Pp (I - K C)' + K R K'
    Acl = (I - K C) A

A mode that no sensor sees but that dies out by itself is kept: the filter predicts it.  Methods
that need every mode to be seen refuse such a model.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve, matrix_balance, solve_discrete_are

from blw import chi2, straight
from blw.design import Designed
from blw.errors import DesignError
from blw.model import Model
from blw.tables import Struct, table

NAME = "kalman"
GAPS = "weighted"

UNIT_CIRCLE = 1e-8     # an eigenvalue this close to it counts as on it
CLUSTER = 1e-4         # eigenvalues of a defective matrix scatter; their mean does not
PBH = 1e-10            # relative singular value below which a mode is unseen
POLISH_STEPS = 20      # Riccati steps at most
DOUBLINGS = 60         # of the Riccati recursion at most
SEMIDEFINITE = 1e-9    # negative eigenvalue of a correlation matrix that is taken for rounding
ROUNDING = 1e-14       # relative eigenvalue of a correlation matrix that is taken for rounding
GROWTH_MAX = 6.7e7     # of a mode in a step: beyond 1/sqrt(eps) of double, I - K C is rounding
CONDITION_MAX = 1e14   # of the correlation matrix of R

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Kalman:
    """Steady state: gain K [n, m], filtered and predicted covariance P, Pp [n, n], Acl [n, n]."""

    K: Array
    P: Array
    Pp: Array
    Acl: Array


@dataclass(frozen=True)
class Options:
    """The method has no options."""


def steady_state(A: Array, C: Array, W: Array, R: Array) -> Kalman:
    """The stabilising solution of the Riccati equation, polished by Riccati steps.

    A [n, n], C [m, n], W = B Q B' [n, n] positive semidefinite, R [m, m] positive definite.
    Raises DesignError naming the mode that no sensor sees or no noise moves, the sensor whose
    noise is not positive, or the entries that are too far apart for double precision.
    """
    A, C, W, R = (np.asarray(matrix, dtype=float) for matrix in (A, C, W, R))
    _check_R(R)
    _check_growth(A)
    try:
        with np.errstate(over="ignore", invalid="ignore"):
            _check_modes(A, C, "no sensor sees the mode", "it is not detectable")
            _check_modes(A.T, _root(W), "no noise reaches the mode",
                         "it is not stabilisable; give B Q B' a part in it")
            return _checked(_polish(A, C, W, R, _stabilising(A, C, W, R)))
    except (np.linalg.LinAlgError, ValueError):  # ValueError: of scipy, for what is not finite
        sizes = np.abs(A[A != 0.0])
        reach = f"from {sizes.min():.3g} to {sizes.max():.3g}" if sizes.size else "nowhere"
        raise DesignError("the Riccati equation cannot be solved in double precision; the entries "
                          f"of A reach {reach}: choose units that bring them closer "
                          "together") from None


def _stabilising(A: Array, C: Array, W: Array, R: Array) -> Array:
    """Pp [n, n], to be polished."""
    try:
        Pp = solve_discrete_are(A.T, C.T, W, R)
    except (np.linalg.LinAlgError, ValueError):  # its Schur form could not be put in order
        Pp = _doubled(A, C, W, R)
    if not np.isfinite(Pp).all():
        raise DesignError("the Riccati equation has no stabilising solution")
    return _covariance(Pp)


def _covariance(P: Array) -> Array:
    """P [n, n] made symmetric; 0 for a state whose variance is nothing but negative rounding."""
    P = (P + P.T) / 2
    known = np.diag(P) < 0.0
    P[known] = P[:, known] = 0.0
    return P


def _doubled(A: Array, C: Array, W: Array, R: Array) -> Array:
    """Pp [n, n] by doubling: Pp(1), Pp(2), Pp(4), ... of the Riccati recursion from 0 (Anderson and
    Moore, Optimal Filtering, 6.7)."""
    step, G, Pp = A.T, C.T @ cho_solve(cho_factor(R), C), W
    for _ in range(DOUBLINGS):
        V = np.linalg.solve(np.eye(len(A)) + G @ Pp, np.hstack([step, G]))
        forward, spread = V[:, :len(A)], V[:, len(A):]
        change = step.T @ Pp @ forward
        G = G + step @ spread @ step.T
        Pp = Pp + change
        step = step @ forward
        if not np.abs(change).max() > np.finfo(float).eps * np.abs(Pp).max():
            break
    return Pp


def modes(A: Array) -> list[complex]:
    """Eigenvalues of A [n, n] and the means of their clusters, upper half plane only."""
    eigenvalues = [z for z in np.linalg.eigvals(A) if z.imag >= 0]
    found = list(eigenvalues)
    for z in eigenvalues:
        near = [w for w in eigenvalues if abs(w - z) <= CLUSTER * max(1.0, abs(z))]
        mean = complex(np.mean(near))
        if len(near) > 1 and all(abs(mean - w) > 0 for w in found):
            found.append(mean)
    return found


def unseen(A: Array, C: Array, z: complex) -> bool:
    """Whether C [m, n] fails to see the mode z of A [n, n]: Popov, Belevitch and Hautus.

    A is balanced and every row of C counts alike, so the units of states and sensors do not matter.
    """
    balanced, units = matrix_balance(A, permute=False)
    scale = max(np.linalg.norm(balanced, 2), abs(z), np.finfo(float).tiny)
    rows = C @ units
    norms = np.linalg.norm(rows, axis=1, keepdims=True)
    rows = scale * rows / np.where(norms > 0, norms, 1.0)
    pencil = np.vstack([z * np.eye(len(A)) - balanced, rows])
    return bool(np.linalg.svd(pencil, compute_uv=False)[-1] <= PBH * scale)


def unobservable_modes(A: Array, C: Array) -> list[complex]:
    """The modes of A [n, n] that C [m, n] does not see, upper half plane only."""
    return [z for z in modes(A) if unseen(A, C, z)]


def mode_text(z: complex) -> str:
    """A mode, or a pair of them, for messages."""
    return f"{z.real:.6g}" if z.imag == 0 else f"{z.real:.6g} +- {z.imag:.6g}i"


def design(model: Model, kalman: Kalman, options: Options) -> Designed:
    """Tables of blw_kalman_model_t, and a detector on the filter's innovations."""
    on_samples = replace(kalman, K=kalman.K * model.weight)
    Acl, Bcl = straight.closed(model, on_samples.K) or ([], [])
    tables = Struct("blw_kalman_model_t", NAME,
                    {"K": table(on_samples.K, "[n x m] steady-state gain"),
                     "Acl": table(Acl, "[n x n] A - K C A"),
                     "Bcl": table(Bcl, "[n x l] Bu - K C Bu"),
                     "step": straight.kalman_step(model, on_samples)}, method=NAME)
    S = model.C @ kalman.Pp @ model.C.T + model.sample_R
    info = {
        "trace_P": float(np.trace(kalman.P)),
        "P": kalman.P.tolist(),
        "sigma": np.sqrt(np.diag(kalman.P)).tolist(),
        "innovation_sigma": np.sqrt(np.diag(S)).tolist(),
        "spectral_radius": float(np.abs(np.linalg.eigvals(kalman.Acl)).max()),
        "unobservable_modes": [mode_text(z) for z in unobservable_modes(model.A, model.C)],
        "cond_P": float(np.linalg.cond(kalman.P)),
        "cond_S": float(np.linalg.cond(S)),
    }
    return Designed(tables, info, mem=(model.n, model.m), extras=(chi2.detector(S),))


def _check_growth(A: Array) -> None:
    radius = np.abs(np.linalg.eigvals(A)).max()
    if not radius <= GROWTH_MAX:
        raise DesignError(f"A has a mode that grows {radius:.3g} times in a step, at most "
                          f"{GROWTH_MAX:g} can be estimated in double precision; check its units "
                          "and dt_s")


def _check_R(R: Array) -> None:
    for i, variance in enumerate(np.diag(R)):
        if not variance > 0:
            raise DesignError(f"R is not positive definite: sensor {i + 1} has the variance "
                              f"{variance:.6g}")
    d = np.sqrt(np.diag(R))
    eigenvalues = np.linalg.eigvalsh(R / np.outer(d, d))
    if eigenvalues[0] <= eigenvalues[-1] / CONDITION_MAX:
        raise DesignError("R is not positive definite: the smallest eigenvalue of its correlation "
                          f"matrix is {eigenvalues[0]:.3g}")


def _root(W: Array) -> Array:
    """[n, n] with root' root = W, for W positive semidefinite; eigenvalues at rounding are 0."""
    d = np.sqrt(np.clip(np.diag(W), 0.0, None))
    units = np.where(d > 0, d, 1.0)
    values, vectors = np.linalg.eigh(W / np.outer(units, units))
    if values[0] < -SEMIDEFINITE:
        raise DesignError("B Q B' is not positive semidefinite: the smallest eigenvalue of its "
                          f"correlation matrix is {values[0]:.3g}")
    values = np.where(values > ROUNDING * max(values[-1], 0.0), values, 0.0)
    return np.sqrt(values)[:, None] * vectors.T * units


def _check_modes(A: Array, C: Array, what: str, consequence: str) -> None:
    for z in unobservable_modes(A, C):
        if abs(z) >= 1 - UNIT_CIRCLE:
            raise DesignError(f"{what} {mode_text(z)} (|z| = {abs(z):.6g}): {consequence}")


def _riccati(A: Array, C: Array, W: Array, R: Array, Pp: Array) -> Kalman:
    """Measurement update in Joseph form from the predicted covariance Pp."""
    S = C @ Pp @ C.T + R
    K = cho_solve(cho_factor(S), C @ Pp).T
    keep = np.eye(len(A)) - K @ C
    P = keep @ Pp @ keep.T + K @ R @ K.T
    return Kalman(K=K, P=_covariance(P), Pp=Pp, Acl=keep @ A)


def _polish(A: Array, C: Array, W: Array, R: Array, Pp: Array) -> Kalman:
    """Riccati steps while they still change Pp less and less."""
    filtered = _riccati(A, C, W, R, Pp)
    change = np.inf
    for _ in range(POLISH_STEPS):
        Pp_next = _covariance(A @ filtered.P @ A.T + W)
        last, change = change, np.abs(Pp_next - filtered.Pp).max()
        if not change < last:
            break
        filtered = _riccati(A, C, W, R, Pp_next)
    return filtered


def _checked(kalman: Kalman) -> Kalman:
    radius = np.abs(np.linalg.eigvals(kalman.Acl)).max()
    if not np.isfinite(kalman.K).all() or not radius < 1:
        raise DesignError("the steady-state filter is not stable: an eigenvalue of A - K C A has "
                          f"the magnitude {radius:.9g}")
    return kalman
