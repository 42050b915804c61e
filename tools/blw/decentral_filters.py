# SPDX-License-Identifier: MIT
"""Local Kalman filters of [D] section 3, one per sensor, and their joint error covariance.

    z_i = Z_i' x,   S_i = Z_i' A Z_i,   t_i = c_i Z_i                                          (7)
    z_i(k) = F_i z_i(k-1) + ... + K_i y_i(k),   F_i = (I - K_i t_i) S_i                        (10)
    P = F P F' + H W H' + K R K',   H = Phi - K C,   Phi = [Z_1 ... Z_m]'                      (17)

F and K are block diagonal; W = B Q B'; R may correlate the sensors.
"""

from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from blw.arnoldi import observable_basis
from blw.errors import DesignError
from blw.kalman import Kalman, steady_state
from blw.model import Model

Array = NDArray[np.float64]

_DOUBLINGS = 60
_POLISH_STEPS = 3
_CALM_STEPS = 50       # steps in a row that end the warm-up
_WARM_UP_MAX = 65535
_WARM_UP_EXCESS = 0.05  # of the mean of the statistic, by an initial error


@dataclass(frozen=True, eq=False)
class LocalFilters:
    """All local filters, stacked: mu = sum mu_i rows.

    first [m + 1] first row of every sensor, then mu;  Phi [mu, n];  S [mu_i, mu_i], t [mu_i],
    F [mu_i, mu_i] per sensor;  K [mu];  P [mu, mu] steady-state error covariance.
    """

    first: Array
    Phi: Array
    S: list[Array]
    t: list[Array]
    F: list[Array]
    K: Array
    P: Array

    @property
    def mu(self) -> Array:
        """[m] local states per sensor."""
        return np.diff(self.first)

    def rows(self, i: int) -> slice:
        """Rows of sensor i."""
        return slice(int(self.first[i]), int(self.first[i + 1]))


def local_filters(model: Model) -> LocalFilters:
    """Steady-state filters on the observable subspaces and (17).

    Raises DesignError naming the sensor whose filter does not exist.
    """
    bases, gains = [], []
    for i, name in enumerate(model.sensors):
        try:
            Z = observable_basis(model.A, model.C[i])
            gains.append(_local_filter(model, i, Z))
        except DesignError as error:
            raise DesignError(f"local filter of sensor '{name}': {error}") from None
        bases.append(Z)
    K = np.concatenate([gain.K[:, 0] for gain in gains])
    Phi = np.vstack([Z.T for Z in bases])
    first = np.concatenate([[0], np.cumsum([Z.shape[1] for Z in bases])])
    F = [gain.Acl for gain in gains]
    return LocalFilters(first=first, Phi=Phi, S=[Z.T @ model.A @ Z for Z in bases],
                        t=[c @ Z for c, Z in zip(model.C, bases)], F=F, K=K,
                        P=_covariance(F, drive(model, Phi, K, first)))


def drive(model: Model, Phi: Array, K: Array, first: Array) -> Array:
    """H W H' + K R K' of (17), [mu, mu]."""
    stacked = np.zeros((len(K), model.m))
    for i in range(model.m):
        stacked[first[i]:first[i + 1], i] = K[first[i]:first[i + 1]]
    H = Phi - stacked @ model.C
    D = H @ model.W @ H.T + stacked @ model.R @ stacked.T
    return (D + D.T) / 2.0


def warm_up(filters: LocalFilters, N: Array, P0: Array) -> int:
    """Steps until an initial error with the covariance P0 [n, n] no longer raises |N z|^2.

    N [d, mu].  All local filters start in the same x0, so their errors agree at first and part
    later.  Raises DesignError if the initial error takes too long to decay.
    """
    F = scipy.linalg.block_diag(*filters.F)
    excess = filters.Phi @ P0 @ filters.Phi.T - filters.P
    seen, last = N, 0
    for k in range(1, _WARM_UP_MAX + 1):
        seen = seen @ F
        if np.sum((seen @ excess) * seen) > _WARM_UP_EXCESS * len(N):
            last = k
        elif k - last >= _CALM_STEPS:
            return last
    raise DesignError(f"the initial error P0 has not decayed after {_WARM_UP_MAX} steps")


def _local_filter(model: Model, i: int, Z: Array) -> Kalman:
    """The filter of sensor i in its observable subspace Z [n, n_i].

    Its gaps count as they do for the central filter (R is that of gaps.averaged()): counted about
    its own, larger error they make it so slow that a ramp passes for the truth.
    """
    one = slice(i, i + 1)
    return steady_state(Z.T @ model.A @ Z, model.C[one] @ Z, Z.T @ model.W @ Z, model.R[one, one])


def _covariance(F: list[Array], D: Array) -> Array:
    """P = F P F' + D by doubling; F stable, block diagonal."""
    step = scipy.linalg.block_diag(*F)
    P, power = D, step
    for _ in range(_DOUBLINGS):
        term = power @ P @ power.T
        P = P + term
        if np.abs(term).max() <= 1e-17 * np.abs(P).max():
            break
        power = power @ power
    for _ in range(_POLISH_STEPS):
        P = step @ P @ step.T + D
        P = (P + P.T) / 2.0
    return P
