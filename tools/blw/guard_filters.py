# SPDX-License-Identifier: MIT
"""Local filters of `guard`: modal split, input-normal realisation, joint covariance (SPEC 4.1).

    x = Xu xu + Xs xs,   xu(k+1) = Au xu + ...,   xs(k+1) = As xs + ...                          (1)
    eta_i(k+1) = Lam eta_i + b y_i(k+1),   Lam Lam' + b b' = I                                   (2)
    Lam Gu_i = Gu_i Au - b C_i Xu Au,   eta_i = Gu_i xu + eps_i                                  (3)
    eps_i(k+1) = Lam eps_i + b C_i Xs As xs + (b C_i - Gu_i Tu) B w + b v_i                      (4)

Tu are the rows of [Xu Xs]^-1 that yield xu.  V is the stationary covariance of (eps, xs); its block
W of eps is at least lambda_min(R) I, since (2) makes (Lam, b) input-normal: there is no model for
which W loses rank, unlike in Jordan coordinates.
"""

from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from blw.errors import DesignError
from blw.model import Model

Array = NDArray

#: Modes of A at least this far from the origin are fused securely; the others forget by themselves.
RADIUS = 0.9
#: Radii tried, nearest to RADIUS first, where that split is ill-conditioned.
OTHER_RADII = (0.88, 0.92, 0.85, 0.95, 0.8, 0.97, 0.7, 0.98, 0.6, 0.5, 0.4, 0.3)
SPLIT_COND = 1e6

#: A stable mode of A this close to a pole of the local filters moves to xs: (3) has no solution.
SHARED = 1e-7

#: Local states per sensor; one linear system of r^2 unknowns serves every block of V.
MAX_ORDER = 64
#: Rows of eta: dense tables of N^2 / 2 numbers.
MAX_ROWS = 1024


@dataclass(frozen=True, eq=False)
class Split:
    """(1): Xu [n x n_u], Xs [n x n_s], Au, As and the rows Tu, Ts of [Xu Xs]^-1."""

    Xu: Array
    Xs: Array
    Au: Array
    As: Array
    Tu: Array
    Ts: Array

    @property
    def n_u(self) -> int:
        return self.Au.shape[0]


@dataclass(frozen=True, eq=False)
class Filters:
    """(2), (3) stacked over the sensors, and V [(m r + n_s) square] of (4)."""

    split: Split
    poles: Array
    Lam: Array  #: [r x r]
    b: Array  #: [r]
    Gu: Array  #: [m r x n_u]
    V: Array
    m: int

    @property
    def r(self) -> int:
        return self.b.size

    @property
    def N(self) -> int:
        return self.m * self.r

    @property
    def W(self) -> Array:
        """[N x N] covariance of eps."""
        return self.V[: self.N, : self.N]

    @property
    def Sig(self) -> Array:
        """[n_s x N] covariance of xs and eps: xs_hat = Sig W^-1 ... = Sig l."""
        return self.V[self.N :, : self.N]


def filters(model: Model, poles: Array) -> Filters:
    """Local filters with the given poles, closed under conjugation and inside the unit circle.

    Raises DesignError if there are too many, or if one of them is an unstable mode of A.
    """
    r = poles.size
    if r > MAX_ORDER or r * model.m > MAX_ROWS:
        raise DesignError(
            f"{r} local states for each of {model.m} sensors make {r * model.m} rows; at most"
            f" {MAX_ROWS} and {MAX_ORDER} states are supported: set method.guard.order"
        )
    split = modal_split(model.A, poles)
    Lam, b = input_normal(poles)
    CXu = model.C @ split.Xu
    Gu = np.vstack([measured_part(Lam, b, split.Au, c) for c in CXu])
    V = joint_covariance(model, split, Lam, b, Gu)
    return Filters(split, poles, Lam, b, Gu, V, model.m)


def modal_split(A: Array, poles: Array) -> Split:
    """(1) at RADIUS, or at the nearest radius where it is well conditioned.

    Stable modes of A that coincide with a pole go to xs.  Raises DesignError if no radius serves.
    """
    best: tuple[float, Split] | None = None
    for radius in (RADIUS, *OTHER_RADII):
        candidate = _split_at(A, poles, radius)
        if candidate is None:
            continue
        cond = float(np.linalg.cond(np.hstack([candidate.Xu, candidate.Xs])))
        if cond <= SPLIT_COND:
            return candidate
        if best is None or cond < best[0]:
            best = cond, candidate
    if best is None:
        raise DesignError("the modes of A cannot be split at any radius between 0.3 and 0.98")
    return best[1]


def _split_at(A: Array, poles: Array, radius: float) -> Split | None:
    n = len(A)

    def is_secure(re: float, im: float) -> bool:
        z = complex(re, im)
        near = poles.size > 0 and min(abs(poles - z)) < SHARED and abs(z) < 1.0 - SHARED
        return abs(z) >= radius and not near

    T, U, n_u = scipy.linalg.schur(A, "real", sort=is_secure)
    if n_u == n:
        none = np.zeros((n, 0))
        return Split(np.eye(n), none, A, none.T @ none, np.eye(n), none.T)
    try:
        Y = scipy.linalg.solve_sylvester(T[:n_u, :n_u], -T[n_u:, n_u:], -T[:n_u, n_u:])
    except np.linalg.LinAlgError:
        return None
    Xu, Xs = U[:, :n_u], U[:, :n_u] @ Y + U[:, n_u:]
    Ts = U[:, n_u:].T
    Tu = U[:, :n_u].T - Y @ Ts
    return Split(Xu, Xs, T[:n_u, :n_u], T[n_u:, n_u:], Tu, Ts) if np.isfinite(Y).all() else None


def input_normal(poles: Array) -> tuple[Array, Array]:
    """(2): Lam [r x r] lower block triangular, b [r].

    Takenaka-Malmquist: a cascade of lossless sections of first and second order, so that repeated
    poles need no care.  The output of each section drives the next.
    """
    Lam, b = np.zeros((0, 0)), np.zeros(0)
    c, d = np.zeros(0), 1.0
    for z in sorted_poles(poles):
        a, bb, cc, dd = _section(z)
        r, size = b.size, bb.size
        grown = np.zeros((r + size, r + size))
        grown[:r, :r], grown[r:, r:], grown[r:, :r] = Lam, a, np.outer(bb, c)
        Lam, b = grown, np.concatenate([b, bb * d])
        c, d = np.concatenate([dd * c, cc]), dd * d
    return Lam, b


def sorted_poles(poles: Array) -> list[complex]:
    """One of each conjugate pair, by magnitude."""
    kept = [complex(z.real, 0.0 if abs(z.imag) < 1e-12 else z.imag) for z in poles]
    return sorted((z for z in kept if z.imag >= 0), key=lambda z: (abs(z), z.imag))


def _section(z: complex) -> tuple[Array, Array, Array, float]:
    """Lossless section [a b; c d], an orthogonal matrix, with the pole z or the pair z, z*.

    The pair's is a unitary Hessenberg matrix whose parameters alpha, rho = sqrt(1 - alpha^2) are
    the reflection coefficients of the polynomial with the roots z, z*: also good for a pair that
    is almost real.
    """
    if z.imag == 0.0:
        s = float(np.sqrt((1.0 - z.real) * (1.0 + z.real)))
        return np.array([[z.real]]), np.array([s]), np.array([s]), -z.real
    size = abs(z) ** 2
    alpha = np.array([2.0 * z.real / (1.0 + size), -size])
    rho_0 = float(np.sqrt(((1.0 - z.real) ** 2 + z.imag**2) * ((1.0 + z.real) ** 2 + z.imag**2)))
    rho_0 /= 1.0 + size
    rho_1 = float(np.sqrt((1.0 - abs(z)) * (1.0 + abs(z)) * (1.0 + size)))
    a = np.array([[alpha[0], rho_0 * alpha[1]], [rho_0, -alpha[0] * alpha[1]]])
    return a, rho_1 * np.array([rho_0, -alpha[0]]), np.array([0.0, rho_1]), -float(alpha[1])


def measured_part(Lam: Array, b: Array, Au: Array, c: Array) -> Array:
    """Gu_i [r x n_u] of (3) for c = C_i Xu [n_u]; one step of iterative refinement."""
    right = -np.outer(b, c @ Au)
    if not right.size:
        return right
    G = scipy.linalg.solve_sylvester(Lam, -Au, right)
    return G + scipy.linalg.solve_sylvester(Lam, -Au, right - (Lam @ G - G @ Au))


def joint_covariance(model: Model, split: Split, Lam: Array, b: Array, Gu: Array) -> Array:
    """V of (4).  Lam is common to all sensors, so one factorisation serves all blocks."""
    m, r, n_s = model.m, b.size, split.As.shape[0]
    E = (np.kron(model.C, b[:, None]) - Gu @ split.Tu) @ model.B
    Es = split.Ts @ model.B
    drive = model.C @ split.Xs @ split.As  # [m x n_s] of xs in (4), before b
    Vs = _stein(split.As, split.As, (Es @ model.Q @ Es.T)[None])[0]
    right = (E @ model.Q @ Es.T).reshape(m, r, n_s) + np.einsum(
        "a,ij->iaj", b, drive @ Vs @ split.As.T
    )
    cross = _stein(Lam, split.As, right)  # [m][r x n_s]
    Xi = (E @ model.Q @ E.T).reshape(m, r, m, r).transpose(0, 2, 1, 3).copy()
    Xi += np.einsum("ij,a,c->ijac", model.R + drive @ Vs @ drive.T, b, b)
    coupled = np.einsum("ias,js,c->ijac", np.einsum("ab,ibs->ias", Lam, cross), drive, b)
    Xi += coupled + coupled.transpose(1, 0, 3, 2)
    W = _stein(Lam, Lam, Xi.reshape(m * m, r, r)).reshape(m, m, r, r)
    W = W.transpose(0, 2, 1, 3).reshape(m * r, m * r)
    cross = cross.reshape(m * r, n_s)
    V = np.block([[W, cross], [cross.T, Vs]])
    return (V + V.T) / 2.0


def _stein(F: Array, H: Array, M: Array) -> Array:
    """X_k = F X_k H' + M_k for all k; one step of iterative refinement."""
    if not M.size:
        return M
    a, c = F.shape[0], H.shape[0]
    factor = scipy.linalg.lu_factor(np.eye(a * c) - np.kron(F, H))

    def solve(right: Array) -> Array:
        return scipy.linalg.lu_solve(factor, right.reshape(-1, a * c).T).T.reshape(-1, a, c)

    X = solve(M)
    return X + solve(M - (X - F @ X @ H.T))
