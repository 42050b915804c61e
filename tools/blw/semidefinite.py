# SPDX-License-Identifier: MIT
"""Covariances, which may be singular."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def root(covariance: Array) -> Array:
    """[n, n] with root root' = covariance [n, n], positive semidefinite up to rounding.

    Rounding is that of the correlations: variances may differ by any number of decades.
    """
    variances = np.diag(covariance)
    unit = np.sqrt(np.where(variances > 0, variances, 1.0))
    values, vectors = np.linalg.eigh(covariance / np.outer(unit, unit))
    return unit[:, None] * vectors * np.sqrt(np.clip(values, 0.0, None))
