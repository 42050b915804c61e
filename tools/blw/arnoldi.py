# SPDX-License-Identifier: MIT
"""Orthonormal basis of the subspace that one sensor observes: shifted, scaled Arnoldi iteration.

The rows c, c A, c A^2, ... lose their rank to rounding long before n = 10.  The same space is
spanned by the Krylov vectors of M = A' - sigma I, sigma = tr(A) / n, in coordinates in which A is
balanced; Arnoldi keeps them orthogonal, and the iteration breaks down exactly when the space is
exhausted.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import matrix_balance

from blw.errors import DesignError

Array = NDArray[np.float64]

#: What is left of a Krylov vector after the projection, relative to it: below this it is rounding.
BREAKDOWN = 1e-10
#: The same relative to A itself, whose digits may be rounded: modes that only these tell apart are
#: one.
ROUNDING = 1e-12


def observable_basis(A: Array, c: Array) -> Array:
    """Z [n, mu], Z' Z = I, whose columns span the observable subspace of (A, c).

    A [n, n], c [n].  The rank mu is the number of steps before the iteration breaks down.
    Raises DesignError if c = 0.
    """
    if not np.any(c):
        raise DesignError("its row of C is zero: it observes nothing")
    balanced, (scale, _) = matrix_balance(A, permute=False, separate=True)
    shift = np.trace(A) / len(A)
    columns = _krylov(balanced.T - shift * np.eye(len(A)), c * scale,
                      ROUNDING * np.linalg.norm(balanced, 2))
    return np.linalg.qr(columns / scale[:, None])[0]


def _krylov(M: Array, start: Array, rounding: float) -> Array:
    """Orthonormal basis [n, mu] of span{start, M start, M^2 start, ...}; M is known to within
    `rounding`."""
    basis = (start / np.linalg.norm(start))[:, None]
    while basis.shape[1] < len(M):
        image = M @ basis[:, -1]
        rest = image
        for _ in range(2):  # twice is enough for orthogonality to rounding
            rest = rest - basis @ (basis.T @ rest)
        size = np.linalg.norm(rest)
        if size <= max(BREAKDOWN * np.linalg.norm(image), rounding):
            break
        basis = np.column_stack([basis, rest / size])
    return basis
