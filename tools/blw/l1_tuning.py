# SPDX-License-Identifier: MIT
"""What the l1 penalty costs without attack, and the gamma for a wanted cost.

Without attack the error of the least-squares fusion F zeta is independent of z in (1) of l1.py, and
x_hat = F zeta - F nu(z), so the mean square error is exactly tr P + E |F nu(z)|^2, z ~ N(0, I):

    loss(gamma) = E |F nu(z; gamma)|^2 / tr P,                                                 (1)
    nu = argmin 1/2 |z - Z' nu|^2 + sum_g c_g |nu_g|,

a Monte Carlo mean over a fixed sample; the minimisation by ADMM, (1) and (2) of admm_tuning.py.
The loss falls and the reach of an attacker grows with gamma.
"""

from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blw.admm_tuning import iterates
from blw.l1 import Groups, Reduced, thresholds

Array = NDArray[Any]

_RHO = 0.02
_PASSES = 300
_SAMPLES = (64, 400)
#: Multiply-adds that one value of the loss may cost.
_WORK = 2.5e9
_SEED = 20210513
#: nu is solved if, in the median sample, no |l_g| exceeds c_g by more than this factor; the loss of
#: what ADMM reaches is then right to a fifth.
_EXCEEDED = 2.0
#: gamma is found to this relative accuracy, and not below this part of the largest one.
_RELATIVE = 0.02
_LEAST = 1e-8
_STEP = 4.0


class BenignLoss:
    """loss(gamma) of (1) for one fusion; F [n x N] unscaled, trace_P the trace of P.

    Where (1) has many minimisers, rho and passes of ADMM decide which one is meant.
    """

    def __init__(self, reduced: Reduced, groups: Groups, F: Array, trace_P: float,
                 rho: float = _RHO, passes: int = _PASSES, samples: int | None = None) -> None:
        N, d = reduced.Z.shape
        self._reduced, self._groups, self._trace_P = reduced, groups, trace_P
        self._F = F / reduced.scale
        self._rho, self._passes = rho, passes
        count = samples or int(np.clip(_WORK / (N * N * passes), *_SAMPLES))
        self._z = np.random.default_rng(_SEED).standard_normal((d, count))

    def __call__(self, gamma: float) -> float | None:
        """loss(gamma); None if W is too ill-conditioned to solve (1) at so small a gamma."""
        Z, c = self._reduced.Z, thresholds(self._reduced, self._groups, gamma)
        run = iterates(self._reduced, self._groups, c, Z @ self._z, self._rho)
        nu = next(islice(run, self._passes - 1, None))
        norms = self._groups.norms(Z @ (self._z - Z.T @ nu))
        if np.median(np.max(norms / c[:, None], axis=0)) > _EXCEEDED:
            return None
        return float(np.mean(np.sum((self._F @ nu) ** 2, axis=0)) / self._trace_P)

    def gamma_for(self, wanted: float, largest: float) -> float:
        """The smallest gamma, at most `largest`, that is solved and loses at most `wanted`."""
        high = low = largest
        while self._affordable(low, wanted):
            if low <= _LEAST * largest:
                return low
            high, low = low, low / _STEP
        while high > (1.0 + _RELATIVE) * low:
            middle = float(np.sqrt(low * high))
            if self._affordable(middle, wanted):
                high = middle
            else:
                low = middle
        return high

    def _affordable(self, gamma: float, wanted: float) -> bool:
        loss = self(gamma)
        return loss is not None and loss <= wanted
