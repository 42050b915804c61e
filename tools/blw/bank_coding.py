# SPDX-License-Identifier: MIT
"""Sparse observability as the distance of a code: [B] section VI.

The outputs of one sensor over n steps are a symbol.  The initial states whose difference a sensor
does not show form a subspace that A leaves invariant, so two states with the most symbols in common
differ by an eigenvector of A (or by the real plane of a complex one): it is enough to look at the
eigenvectors.  A simple eigenvalue has one; an eigenspace of more dimensions holds one that hides
from a set S of sensors iff C_S restricted to it has dependent columns.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations
from math import comb

import numpy as np
from numpy.typing import NDArray

from blw.errors import DesignError
from blw.kalman import modes
from blw.model import Model

RANK = 1e-9              # relative singular value that counts as zero
MAX_SUBSETS = 200_000    # of an eigenspace's search

Array = NDArray[np.float64]


@dataclass(frozen=True)
class CodingDistance:
    """What any two initial states have in common at most.

    distance     the smallest number of sensors in which two initial states differ
    theta        the smallest size for which every set of sensors is observable: m - distance + 1
    correctable  the largest number of attacked sensors: the largest p with 2 p < distance
    mode         an eigenvalue that fewest sensors see
    sensors      the sensors that see it
    """

    distance: int
    theta: int
    correctable: int
    mode: complex
    sensors: tuple[str, ...]


def coding_distance(model: Model) -> CodingDistance:
    """The distance of the code of model.A [n, n], model.C [m, n].

    Raises DesignError if an eigenspace of several dimensions has too many subsets to search.
    """
    mode, seen = min(_words(model), key=lambda word: len(word[1]))
    distance = len(seen)
    return CodingDistance(distance=distance, theta=model.m - distance + 1,
                          correctable=max(0, (distance - 1) // 2), mode=mode,
                          sensors=tuple(model.sensors[i] for i in seen))


def _words(model: Model) -> Iterator[tuple[complex, tuple[int, ...]]]:
    """Every mode with a smallest set of sensors that see one of its eigenvectors."""
    size = np.linalg.norm(model.C, axis=1, keepdims=True)
    rows = model.C / np.where(size > 0, size, 1.0)
    for mode in modes(model.A):
        V = _eigenvectors(model.A, mode)
        if V.shape[1]:
            yield mode, _fewest(rows @ V, mode)


def _eigenvectors(A: Array, mode: complex) -> NDArray[np.complex128]:
    """[n, d] orthonormal basis of the eigenspace of mode; d = 0 if it is no eigenvalue."""
    _, values, Vh = np.linalg.svd(mode * np.eye(len(A)) - A)
    scale = max(np.linalg.norm(A, 2), abs(mode), np.finfo(float).tiny)
    return Vh[values <= RANK * scale].conj().T


def _fewest(rows: NDArray[np.complex128], mode: complex) -> tuple[int, ...]:
    """Fewest rows [m, d] left when all others have a vector in their common null space."""
    m, d = rows.shape
    total = sum(comb(m, size) for size in range(m + 1)) if d > 1 else 0
    if total > MAX_SUBSETS:
        raise DesignError(f"the eigenspace of {mode:.6g} has {d} dimensions: its coding distance "
                          f"would need a search over {total} sets of sensors")
    if d == 1:
        return tuple(np.flatnonzero(np.abs(rows[:, 0]) > RANK))
    for hidden in range(m, -1, -1):
        for chosen in combinations(range(m), hidden):
            if not hidden or np.linalg.matrix_rank(rows[list(chosen)], tol=RANK) < d:
                return tuple(i for i in range(m) if i not in chosen)
    raise AssertionError("no row at all has a null space")
