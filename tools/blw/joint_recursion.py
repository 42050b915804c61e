# SPDX-License-Identifier: MIT
"""Gains and covariances of [J]: Lemma 1, Theorems 1 and 2, for all local estimators at once.

Local estimator i has the state X_i = [x; theta_i], theta_i the attack on its weak sensor, and the
input phi_i(k) = theta_i(k) - theta_i(k-1).  With d_i(k) = phi_i(k) - phi_hat_i(k-1) its errors obey

    e_i(k)  = Aa X~_i(k-1) + Wa(k-1) + Phi d_i(k),    y~_i(k) = Ca_i e_i(k) + v_i(k)
    X~_i(k) = e_i(k) - K_i y~_i(k),    phi_hat_i(k) = phi_hat_i(k-1) + Gamma_i y~_i(k)

theta is taken as white with the variance eta.  The matrices of all estimators are stacked, so that
one set of formulas gives the covariances (15)-(19) and, off the diagonal, the cross-covariances
(45)-(50).  Corrections: (19) with Xi1 = 4 eta I - eta (Gamma^a + Gamma^a') + V(k-1), and
(45)-(49) with the covariance R_ij of the noises that two estimators share.  The `printed` variant
has neither; only the symbol of (19) that cannot be meant, {Gamma_i}', is read as {Gamma_i^a}'.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag, cho_factor, cho_solve, eigh, null_space

from blw.model import Model

Array = NDArray[np.float64]

#: Relative eigenvalue below which differences of local estimates carry no information.
CUT_OFF = 1e-10


@dataclass(frozen=True)
class Pair:
    """A weak sensor and the strong ones that its local estimator uses, as indices."""

    weak: int
    strong: tuple[int, ...]

    @property
    def sensors(self) -> tuple[int, ...]:
        """The weak sensor first, as in (3)."""
        return (self.weak, *self.strong)

    def among(self, trusted: Sequence[int]) -> "Pair":
        """The same with those partners only that are trusted."""
        return Pair(self.weak, tuple(sensor for sensor in self.strong if sensor in trusted))


@dataclass(frozen=True, eq=False)
class Gains:
    """Gains of one step: K[i] [n + 1, m_i] and Gamma[i] [m_i]."""

    K: list[Array]
    Gamma: list[Array]


class Stack:
    """Stacked matrices of r local estimators; N = n + 1 states each, m_i measurements."""

    def __init__(self, model: Model, pairs: Sequence[Pair], shared_noise: bool = True) -> None:
        n, r = model.n, len(pairs)
        self.n, self.r, self.pairs = n, r, list(pairs)
        self.Aa = np.kron(np.eye(r), block_diag(model.A, 1.0))
        self.Wa = np.kron(np.ones((r, r)), block_diag(model.W, 0.0))
        self.Phi = np.kron(np.eye(r), np.eye(n + 1)[:, n:])
        self.C = [self._measurement(model, pair) for pair in pairs]
        self.Ca = block_diag(*self.C)
        used = [sensor for pair in pairs for sensor in pair.sensors]
        owner = np.repeat(np.arange(r), [len(pair.sensors) for pair in pairs])
        self.R = model.R[np.ix_(used, used)]
        if not shared_noise:
            self.R = np.where(owner[:, None] == owner[None, :], self.R, 0.0)
        self.rows = [np.flatnonzero(owner == i) for i in range(r)]

    @staticmethod
    def _measurement(model: Model, pair: Pair) -> Array:
        theta = np.zeros((len(pair.sensors), 1))
        theta[0] = 1.0
        return np.hstack([model.C[list(pair.sensors)], theta])

    def state(self, i: int) -> slice:
        """Rows of X_i among the stacked ones."""
        return slice(i * (self.n + 1), (i + 1) * (self.n + 1))

    @property
    def plant_rows(self) -> Array:
        """Rows of all x_i among the stacked ones, [r n]."""
        return np.arange(self.r * (self.n + 1)).reshape(self.r, -1)[:, :-1].ravel()

    @property
    def attack_rows(self) -> Array:
        """Rows of all theta_i, [r]."""
        return np.arange(self.r) * (self.n + 1) + self.n


class Recursion:
    """The covariances of one step, and how they follow from those of the step before.

    PX [r N, r N] = E X~ X~',  Xi [r N, r N] = E e e' of the last step,  U [r N, r] = E X~ phi_hat',
    V [r, r] = E phi_hat phi_hat',  Pphi [r] = E phi~_i^2.
    At k = 0: x~ ~ N(0, P0) in all estimators, theta_hat = phi_hat = 0.
    """

    def __init__(self, stack: Stack, P0: Array, eta: Array, printed: bool = False) -> None:
        n, r = stack.n, stack.r
        self.stack, self.eta, self.printed = stack, np.asarray(eta, dtype=float), printed
        self.PX = np.kron(np.ones((r, r)), block_diag(P0, 0.0)) + stack.Phi @ np.diag(
            self.eta) @ stack.Phi.T
        self.U = np.zeros((r * (n + 1), r))
        self.V = np.zeros((r, r))
        self.Xi = self.PX
        self.Pphi = 2 * self.eta
        self.Ga = np.ones(r)            # the diagonal of Gamma^a
        self.KaPhi = stack.Phi.copy()   # K^a Phi

    def advance(self, gains: Gains | None = None) -> Gains:
        """One step, with the optimal gains (36), (37) or with those given."""
        s = self.stack
        eta = np.diag(self.eta)
        Xi1 = self.V + np.diag(self._own_Xi1() - np.diag(self.V))
        AXi2 = s.Aa @ (self.U + self.KaPhi @ eta)
        T = s.Phi @ Xi1 - AXi2                                      # E e d'
        Xi = s.Aa @ self.PX @ s.Aa.T + s.Wa + T @ s.Phi.T - s.Phi @ AXi2.T
        gains = gains or self._optimal(Xi, T)
        self.Xi = Xi
        K, Gamma = block_diag(*gains.K), block_diag(*gains.Gamma)
        # E e phi_hat(k-1)':  theta(k-1) is known to phi_hat(k-1) through Gamma C Phi
        past = s.Aa @ self.U - s.Phi @ (self.V + np.diag(self.eta * (1 - self.Ga)))
        Ka = np.eye(len(Xi)) - K @ s.Ca
        GC = Gamma @ s.Ca
        self._update_own_Pphi(GC, Gamma, Xi, T, Xi1)
        self.PX = Ka @ Xi @ Ka.T + K @ s.R @ K.T
        self.U = Ka @ past + Ka @ Xi @ GC.T - K @ s.R @ Gamma.T
        self.V = self.V + GC @ past + (GC @ past).T + GC @ Xi @ GC.T + Gamma @ s.R @ Gamma.T
        self.PX, self.V = (self.PX + self.PX.T) / 2, (self.V + self.V.T) / 2
        self.Ga = 1 - np.diag(GC @ s.Phi)
        self.KaPhi = Ka @ s.Phi
        return gains

    def _own_Xi1(self) -> Array:
        """Xi_i^1 of (19), [r]."""
        if self.printed:
            return 6 * self.eta - self.Pphi - 2 * self.eta * self.Ga
        return 4 * self.eta - 2 * self.eta * self.Ga + np.diag(self.V)

    def _optimal(self, Xi: Array, T: Array) -> Gains:
        s = self.stack
        K, Gamma = [], []
        for i, (C, rows) in enumerate(zip(s.C, s.rows, strict=True)):
            own = s.state(i)
            S = cho_factor(C @ Xi[own, own] @ C.T + s.R[np.ix_(rows, rows)])
            K.append(cho_solve(S, C @ Xi[own, own]).T)
            Gamma.append(cho_solve(S, C @ T[own, i]))
        return Gains(K, Gamma)

    def _update_own_Pphi(self, GC: Array, Gamma: Array, Xi: Array, T: Array, Xi1: Array) -> None:
        """(15), the diagonal."""
        cross = np.einsum("ij,ji->i", GC, T)
        spread = GC @ Xi @ GC.T + Gamma @ self.stack.R @ Gamma.T
        self.Pphi = np.diag(Xi1) - 2 * cross + np.diag(spread)

    @property
    def Sigma(self) -> Array:
        """[r n, r n] of (13)."""
        rows = self.stack.plant_rows
        return self.PX[np.ix_(rows, rows)]

    @property
    def theta_variance(self) -> Array:
        """[r] error variances of the attack estimates."""
        return np.diag(self.PX)[self.stack.attack_rows]

    def gap_variance(self, gains: Gains) -> Array:
        """[r] the same if the weak sensor's sample of the last step had been missing."""
        s = self.stack
        found = np.zeros(s.r)
        for i, (C, rows, K) in enumerate(zip(s.C, s.rows, gains.K, strict=True)):
            k = np.where(np.arange(K.shape[1]) == 0, 0.0, K[-1])
            keep = np.eye(s.n + 1)[-1] - k @ C
            own = s.state(i)
            found[i] = keep @ self.Xi[own, own] @ keep + k @ s.R[np.ix_(rows, rows)] @ k
        return found


def fusion_weights(Sigma: Array, n: int) -> Array:
    """G [r n, n] of (12), G' [x_1; ...; x_r] = x_hat, with sum G_i = I whatever Sigma.

    G = H / r + N M with H' N = 0; M minimises the fused covariance by a pseudo-inverse, so a
    singular Sigma (estimators that share all their sensors) yields finite weights.  What it cuts
    off is judged in units of the states' own deviations, whatever the units of the model.
    """
    r = len(Sigma) // n
    if r == 1:
        return np.eye(n)
    unit = deviations(np.abs(np.diag(Sigma)).reshape(r, n).max(axis=0))
    units = np.tile(unit, r)
    Sigma = Sigma / np.outer(units, units)
    H = np.kron(np.ones((r, 1)), np.eye(n))
    N = np.kron(null_space(np.ones((1, r))), np.eye(n))
    D = N.T @ Sigma @ N
    values, vectors = eigh((D + D.T) / 2)
    keep = np.abs(values) > CUT_OFF * np.abs(np.diag(Sigma)).max()
    kept = vectors[:, keep]
    M = -kept @ ((kept.T @ (N.T @ Sigma @ H)) / values[keep, None]) / r
    return (H / r + N @ M) * unit / units[:, None]


def deviations(variances: Array) -> Array:
    """Standard deviations to a power of two: to scale by them is exact; 1 for the variance 0."""
    positive = np.where(variances > 0, variances, 1.0)
    return np.exp2(np.round(np.log2(positive) / 2))


def fused_covariance(Sigma: Array, G: Array) -> Array:
    """[n, n] G' Sigma G."""
    P = G.T @ Sigma @ G
    return (P + P.T) / 2
