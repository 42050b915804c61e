# SPDX-License-Identifier: MIT
"""What a model file says about its sensors beside R, from a log without attacks (docs/recorded.md).

All by fixed rules: the share of the steps in which a sensor sends, the state at the beginning, and
the part of the noise that is not white, as the root mean square of the means of BLOCK successive
residuals about a fixed-interval smoother (Rauch, Tung, Striebel, AIAA J. 3, 1965).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from blw.errors import BulwarkError
from blw.model import MIN_RATE, Model

Array = NDArray[np.float64]

#: Samples in a mean; white noise has 1 / BLOCK of its variance left there.
BLOCK = 16

#: A recording of minutes cannot show that its noise will always be whiter than this.
LEAST_MARGIN = 0.5

#: A sensor that misses fewer samples than this sends in every step.
COMPLETE = 0.98

#: Initial covariance, relative to P0 or I: the first samples decide.
UNKNOWN_START = 1e4


@dataclass(frozen=True, eq=False)
class Identified:
    """Keys of [plant]: rate [m], noise_margin, x0 [n]; and the smoothed states [T x n]."""

    rate: Array
    noise_margin: float
    x0: Array
    states: Array

    def plant(self) -> dict[str, list[float] | float]:
        """The keys that a model file should have."""
        found = {"x0": self.x0.tolist(), "noise_margin": self.noise_margin}
        return found | ({"rate": self.rate.tolist()} if np.any(self.rate < 1.0) else {})


def identify(model: Model, y: Array, where: str) -> Identified:
    """From samples y [T x m], NaN = missing, of a plant without inputs.  Raises BulwarkError."""
    if model.l > 0:
        raise BulwarkError(f"{where}: a plant with inputs cannot be identified from its log yet")
    share = np.mean(~np.isnan(y), axis=0)
    for name, value in zip(model.sensors, share, strict=True):
        if value < MIN_RATE:
            raise BulwarkError(f"{where}: {name} sends in {value:.2%} of the steps only")
    states = smooth(model, y)
    residuals = (y - model.offset - states @ model.C.T) / np.sqrt(np.diag(model.R))
    slow = [_slow_variance(column[~np.isnan(column)]) for column in residuals.T]
    margin = max(LEAST_MARGIN, float(np.sqrt(max(0.0, np.mean(slow)))))
    return Identified(rate=np.where(share >= COMPLETE, 1.0, share.round(3)),
                      noise_margin=round(margin, 2), x0=states[0], states=states)


def _slow_variance(residuals: Array) -> float:
    """Variance of means of BLOCK residuals beyond what white noise of variance 1 has there."""
    count = len(residuals) // BLOCK
    if count == 0:
        return 0.0
    means = residuals[:count * BLOCK].reshape(count, BLOCK).mean(axis=1)
    return float(np.mean(means**2) - 1.0 / BLOCK)


def smooth(model: Model, y: Array) -> Array:
    """[T x n] the smoothed state at every row of y [T x m]; inputs are 0."""
    P0 = UNKNOWN_START * (np.eye(model.n) if model.P0 is None else model.P0)
    x, P, steps = model.x0, P0, []
    for samples in y:
        x_bar, P_bar = model.A @ x, model.A @ P @ model.A.T + model.W
        x, P = _update(model, x_bar, P_bar, samples)
        steps.append((x_bar, P_bar, x, P))
    states = [steps[-1][2]]
    for (x_bar, P_bar, _, _), (_, _, x, P) in zip(steps[:0:-1], steps[-2::-1], strict=True):
        G = np.linalg.solve(P_bar, model.A @ P).T
        states.append(x + G @ (states[-1] - x_bar))
    return np.array(states[::-1])


def _update(model: Model, x_bar: Array, P_bar: Array, samples: Array) -> tuple[Array, Array]:
    """A Kalman step with the samples that are there, Joseph form."""
    there = np.flatnonzero(~np.isnan(samples))
    if there.size == 0:
        return x_bar, P_bar
    C, R = model.C[there], model.R[np.ix_(there, there)]
    K = np.linalg.solve(C @ P_bar @ C.T + R, C @ P_bar).T
    L = np.eye(model.n) - K @ C
    x = x_bar + K @ (samples[there] - model.offset[there] - C @ x_bar)
    return x, L @ P_bar @ L.T + K @ R @ K.T


def with_plant(mapping: dict, identified: Identified) -> dict:
    """The tables of a model file with what was identified."""
    return mapping | {"plant": mapping["plant"] | identified.plant()}
