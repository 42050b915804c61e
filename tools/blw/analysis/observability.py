# SPDX-License-Identifier: MIT
"""Sparse observability: how many sensors can be lost before some mode is seen by none.

A set S of sensors sees a mode with eigenspace V iff rank C_S V = dim V.  The attacker blinds it
with the fewest removals by leaving the most sensors inside one hyperplane, so

    index + 1 = min over the modes of (sensors - largest set S with rank C_S V < dim V).         (1)

For dim V = 1, which is every mode of a non-derogatory A, S holds the sensors that do not see it,
and (1) is a count ([N] Corollary 2).  Otherwise the flats of the rows of C V are searched: branch
on one sensor, inside or outside, and bound by what is undecided.  Sensors that fall together count
as one unit; protected ones are never lost.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from blw.modes import Mode

Array = NDArray
Units = Sequence[Sequence[int]]

#: Nodes of the search, over all modes.
LIMIT = 200_000

#: A row is inside a subspace if no more than this part of it is left.
INSIDE = 1e-8

#: Nodes between two reports of progress.
_REPORT = 500


@dataclass(frozen=True)
class Index:
    """Largest s such that after the loss of any s units all modes are still seen; -1 if some mode
    is never seen.  lower <= s <= upper; they differ if the search met its limit."""

    lower: int
    upper: int
    weakest: complex | None  #: the mode that gives way first; None if none ever does

    @property
    def exact(self) -> bool:
        return self.lower == self.upper

    @property
    def max_attacked(self) -> int:
        """Most lying units that 2p-sparse observability tolerates."""
        return max(0, self.lower // 2)


def sparse_index(modes: Iterable[Mode], units: Units, protected: Iterable[int] = (),
                 limit: int = LIMIT, progress: Callable[[str], None] = lambda text: None) -> Index:
    """Index (1) over units of sensors; `protected` sensors are never lost.

    Units without a sensor that can be lost do not count.  Never more than the number of units.
    """
    kept = sorted(set(protected))
    open_units = [[i for i in unit if i not in kept] for unit in units]
    open_units = [unit for unit in open_units if unit]
    lower = upper = len(open_units)
    weakest = None
    search = _Search(limit, progress)
    for mode in modes:
        least, most = search.removals(mode, open_units, kept)
        if most - 1 < upper:
            upper, weakest = most - 1, mode.eigenvalue
        lower = min(lower, least - 1)
    return Index(lower, upper, weakest)


class _Search:
    """Search for the largest set of units inside a hyperplane, with one budget for all modes."""

    def __init__(self, limit: int, progress: Callable[[str], None]) -> None:
        self.left = limit
        self.progress = progress
        self.best = 0
        self.open = 0  # a set that the search did not exclude may have up to so many units

    def removals(self, mode: Mode, units: Units, kept: Sequence[int]) -> tuple[int, int]:
        """Bounds on the fewest units whose loss blinds the mode; len(units) + 1 if none does."""
        size = np.linalg.norm(mode.rows, axis=1, keepdims=True)
        unit_rows = mode.rows / np.where(size > 0.0, size, 1.0)
        basis = _grown(np.zeros((mode.dimension, 0), dtype=mode.rows.dtype), unit_rows[kept])
        if basis.shape[1] == mode.dimension:
            return len(units) + 1, len(units) + 1
        rows = [unit_rows[list(unit)] for unit in units]
        self.best = self.open = 0
        self._branch(rows, np.arange(len(rows)), basis, 0)
        return len(units) - max(self.best, self.open), len(units) - self.best

    def _branch(self, rows: Sequence[Array], undecided: Array, basis: Array, inside: int) -> None:
        """All flats around `basis`, which holds `inside` units, by adding undecided ones."""
        contained = np.array([_within(rows[u], basis) for u in undecided], dtype=bool)
        inside += int(np.count_nonzero(contained))
        self.best = max(self.best, inside)
        undecided = undecided[~contained]
        if basis.shape[1] == basis.shape[0] - 1:
            return
        for position, unit in enumerate(undecided):
            bound = inside + undecided.size - position
            if bound <= self.best:
                return
            if self.left == 0:
                self.open = max(self.open, bound)
                return
            self._count(bound)
            larger = _grown(basis, rows[unit])
            if larger.shape[1] < larger.shape[0]:
                self._branch(rows, undecided[position + 1 :], larger, inside + 1)

    def _count(self, bound: int) -> None:
        self.left -= 1
        if self.left % _REPORT == 0:
            self.progress(f"sparse observability: {self.best} to {bound} units share a blind spot,"
                          f" {self.left} sets left to try")


def _within(rows: Array, basis: Array) -> bool:
    return bool(np.linalg.norm(_outside(rows, basis), axis=1).max(initial=0.0) <= INSIDE)


def _outside(rows: Array, basis: Array) -> Array:
    """The part of rows [k x d] that is orthogonal to the columns of basis [d x b]."""
    return rows - (rows @ basis) @ basis.conj().T


def _grown(basis: Array, rows: Array) -> Array:
    """Orthonormal basis [d x b'] of the columns of `basis` and the rows [k x d]."""
    for row in rows:
        rest = _outside(_outside(row[None, :], basis), basis)[0]
        size = np.linalg.norm(rest)
        if size > INSIDE:
            basis = np.column_stack([basis, rest.conj() / size])
    return basis
