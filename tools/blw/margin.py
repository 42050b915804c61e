# SPDX-License-Identifier: MIT
"""Room for noise that is not white: `noise_margin` (derivation in docs/recorded.md).

Beside white noise every sensor may have a slow disturbance d_i of unknown sign and course with

    |d_i| <= noise_margin sigma_i,   sigma_i^2 = R_ii of one sample.                           (1)

A statistic that is linear in the samples moves by M d, M the answer to constants: the local filters
are low-pass, so nothing faster moves it further.  Its largest length over the box (1) is

    delta = noise_margin max over s in {-1, 1}^m of |M diag(sigma) s|.                         (2)
"""

from itertools import product

import numpy as np
from numpy.typing import NDArray

from blw import chi2
from blw.model import Model

Array = NDArray[np.float64]

#: Sensors up to which all signs of (2) are tried; beyond, a bound takes its place.
MOST_TRIED = 14


def sigma(model: Model) -> Array:
    """[m] noise_margin times the deviation of a sample, 0 without a margin."""
    return model.noise_margin * np.sqrt(np.diag(model.sample_R))


def largest(M: Array, bounds: Array) -> float:
    """(2): the largest |M d| over |d_i| <= bounds_i; M [rows x m], bounds [m]."""
    scaled = M * bounds
    m = scaled.shape[1]
    if not scaled.any():
        return 0.0
    if m > MOST_TRIED:
        columns = float(np.linalg.norm(scaled, axis=0).sum())
        return min(columns, float(np.sqrt(m) * np.linalg.norm(scaled, 2)))
    signs = np.array([(1.0, *rest) for rest in product((-1.0, 1.0), repeat=m - 1)])
    return float(np.sqrt(np.max(np.sum((scaled @ signs.T) ** 2, axis=0))))


def chi2_threshold(false_alarm: float, dof: float, delta: float) -> float:
    """What |z + d|^2 exceeds with the probability false_alarm, z ~ N(0, I) and |d| = delta."""
    if delta == 0.0:
        return chi2.threshold(false_alarm, dof)
    from scipy.stats import ncx2  # here, since loading it takes longer than most commands

    return float(ncx2.isf(false_alarm, dof, delta**2))
