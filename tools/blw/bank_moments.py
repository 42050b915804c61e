# SPDX-License-Identifier: MIT
"""Exact benign moments of the block residues of method `bank`.

A filter on a set s of sensors predicts x with the error e; a subset i of s gives the estimate
Z_i Y_i from the outputs of h steps.  Their difference over the block that starts at t is

    rho(t) = T e(t) + sum_{j<h} N_j xi(t+j),    xi = (w, v)                                    (1)
    e(t+1) = Phi e(t) + E xi(t),                Phi = A - A K C,  E = [I, -A K]                (2)

with T = I for predictions, and T = I - K C, N_0 less [0, K] for filtered estimates, which yields
the term -2 tr(Z_0 (K R)') of the filtering version.  q = |rho|^2 is tested by its average; noise is
Gaussian, so cov(q(t), q(t+tau)) = 2 |Gamma(tau)|_F^2 with Gamma(tau) = E rho(t) rho(t+tau)'.  (3)
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr, solve_discrete_lyapunov, solve_triangular
from scipy.special import gammainccinv

from blw.semidefinite import root

NEGLIGIBLE = 1e-6  # of a covariance at lag 0
MAX_LAGS = 2000

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Noise:
    """The plant as the moments need it: A [n, n], C [m, n], W = B Q B' [n, n], R [m, m]."""

    A: Array
    C: Array
    W: Array
    R: Array

    @property
    def joint(self) -> Array:
        """[n+m, n+m] covariance of xi."""
        n, m = len(self.W), len(self.R)
        return np.block([[self.W, np.zeros((n, m))], [np.zeros((m, n)), self.R]])



def power_stack(A: Array, count: int) -> Array:
    """[count, n, n] I, A, ..., A^(count-1), by doubling."""
    found, next_power = np.eye(len(A))[None], A
    while len(found) < count:
        found = np.concatenate([found, found @ next_power])
        next_power = next_power @ next_power
    return found[:count]


def observability_matrix(A: Array, C: Array, horizon: int) -> Array:
    """[C; C A; ...; C A^(horizon-1)]."""
    return np.vstack([C @ power for power in power_stack(A, horizon)])


def block_response(noise: Noise, subset: tuple[int, ...], horizon: int) -> Array:
    """[h theta, h (n+m)] response of the outputs of a block to xi(t), ..., xi(t+h-1): [B] (18)."""
    n, m, theta = len(noise.W), len(noise.R), len(subset)
    C, rows = noise.C[list(subset)], power_stack(noise.A, horizon)
    response = np.zeros((horizon, theta, horizon, n + m))
    for j in range(horizon):
        response[j, np.arange(theta), j, n + np.array(subset)] = 1.0
        for a in range(j):
            response[j, :, a, :n] = C @ rows[j - 1 - a]
    return response.reshape(horizon * theta, horizon * (n + m))


def left_inverse(noise: Noise, subset: tuple[int, ...], horizon: int, kind: str) -> Array:
    """Z [n, h theta] with Z O = I: the pseudo-inverse, or the one that minimises tr(Z M Z')."""
    O = observability_matrix(noise.A, noise.C[list(subset)], horizon)
    if kind == "pinv":
        return np.linalg.pinv(O)
    response = block_response(noise, subset, horizon)
    # M = L L' from the factor itself: M squares the growth of an unstable A over the block.
    factor = qr((response @ np.kron(np.eye(horizon), root(noise.joint))).T, mode="r")[0]
    L = factor[:len(O)].T
    basis, triangle = qr(solve_triangular(L, O, lower=True), mode="economic")
    white = solve_triangular(triangle, basis.T)
    return solve_triangular(L, white.T, lower=True, trans="T").T


@dataclass(frozen=True, eq=False)
class Residue:
    """rho of (1) for one filter and one subset.

    P    [n, n] steady covariance of the prediction error e
    Phi  [n, n] and E [n, n+m] of (2)
    T    [n, n] and N [h, n, n+m] of (1)
    """

    joint: Array
    P: Array
    Phi: Array
    E: Array
    T: Array
    N: Array

    def covariances(self, count: int) -> Array:
        """[count, n, n] Gamma(0), Gamma(1), ... of (3)."""
        h, weighted = len(self.N), self.N @ self.joint
        with_error = self.T @ self.P  # E rho(t) e(t+tau)', advanced with tau
        found = np.empty((min(count, h), *self.P.shape))
        for tau in range(len(found)):
            direct = np.tensordot(weighted[tau:], self.N[:h - tau], ((0, 2), (0, 2)))
            found[tau] = with_error @ self.T.T + direct
            with_error = with_error @ self.Phi.T + weighted[tau] @ self.E.T
        if count <= h:
            return found
        return np.concatenate([found, with_error @ power_stack(self.Phi.T, count - h) @ self.T.T])

    def mean(self) -> float:
        """E q: [B] (19) without epsilon."""
        return float(np.trace(self.covariances(1)[0]))

    def window_variance(self, blocks: int, spacing: int = 1) -> float:
        """Variance of the mean of q over `blocks` blocks that start `spacing` steps apart."""
        Gamma = self.covariances((blocks - 1) * spacing + 1)[::spacing]
        c = 2.0 * np.sum(Gamma**2, axis=(1, 2))
        weights = 2.0 * (1.0 - np.arange(blocks) / blocks)
        weights[0] = 1.0
        return float(weights @ c) / blocks

    def ewma_variance(self, gain: float) -> float:
        """Variance of the stationary average += gain (q - average).

        Lags up to h are summed, the geometric rest is a Lyapunov equation, in standard deviations
        of e: its conditioning must not depend on the units of the states.
        """
        h, keep = len(self.N), 1.0 - gain
        Gamma = self.covariances(h)
        c = 2.0 * np.sum(Gamma**2, axis=(1, 2))
        sigma = np.sqrt(np.diag(self.P))
        units = np.where(sigma > 0.0, sigma, 1.0)
        Phi, T = self.Phi * units / units[:, None], self.T * units
        rest = solve_discrete_lyapunov(np.sqrt(keep) * Phi.T, T.T @ T)
        start = self._with_error(h) / units
        tail = keep**h * 2.0 * np.trace(start @ rest @ start.T)
        total = c[0] + 2.0 * (float(keep ** np.arange(1, h) @ c[1:]) + tail)
        return float(gain / (2.0 - gain) * total)

    def ewma_skewness(self, gain: float, variance: float) -> float:
        """Skewness of that average, for a memory much longer than the lags that count.

        The third cumulant of a sum of w q is then 8 sum w^3 times the mean of tr S^3 over the
        frequencies, S the spectral density of rho.
        """
        radius = np.abs(np.linalg.eigvals(self.Phi)).max()
        lags = len(self.N) + int(np.log(NEGLIGIBLE) / np.log(max(radius, NEGLIGIBLE)))
        Gamma = self.covariances(min(lags, MAX_LAGS))
        both = np.concatenate([Gamma, Gamma[:0:-1].transpose(0, 2, 1)])
        S = np.fft.fft(both, axis=0)
        cubes = float(np.mean(np.einsum("fij,fjk,fki->f", S, S, S).real))
        return 8.0 * cubes * gain**3 / (1.0 - (1.0 - gain)**3) / variance**1.5

    def _with_error(self, tau: int) -> Array:
        """E rho(t) e(t+tau)' for tau <= h."""
        found = self.T @ self.P
        for j in range(tau):
            found = found @ self.Phi.T + self.N[j] @ self.joint @ self.E.T
        return found


def residue(noise: Noise, K: Array, P: Array, N: Array, filtered: bool) -> Residue:
    """The residue of the filter with gain K [n, m] (zero columns outside its set).

    P [n, n] prediction error covariance; N [h, n, n+m] = Z block_response; filtered: compare with
    the filtered estimate instead of the prediction.
    """
    n = len(noise.W)
    N = N.copy()
    if filtered:
        N[0] -= np.hstack([np.zeros((n, n)), K])
    return Residue(joint=noise.joint, P=P, Phi=noise.A - noise.A @ K @ noise.C,
                   E=np.hstack([np.eye(n), -noise.A @ K]),
                   T=np.eye(n) - K @ noise.C if filtered else np.eye(n), N=N)


def upper_quantile(mean: float, variance: float, probability: float,
                   skewness: float | None = None) -> float:
    """The value that an average of q exceeds with this probability.

    The average is a weighted sum of chi-squares.  It is matched by a gamma distribution of the
    same mean and variance or, moved along the axis, of the same mean, variance and skewness.
    """
    shape = mean**2 / variance if skewness is None else 4.0 / skewness**2
    standard = (gammainccinv(shape, probability) - shape) / np.sqrt(shape)
    return float(mean + np.sqrt(variance) * standard)
