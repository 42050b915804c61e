# SPDX-License-Identifier: MIT
"""The security ratio of an l1 fusion, [L] Theorem 4 and [N] Theorem 1.

    ratio(I) = max over u of  sum_{g in I} w_g |H_g u| / sum_{g not in I} w_g |H_g u|            (1)

The fusion bounds the influence of the attacked units I iff ratio(I) < 1.  The numerator is convex,
so its maximum over the polytope {denominator <= 1} is that of finitely many linear functions: one
linear program for every choice of signs.  A pair of rows has a norm instead of an absolute value;
it lies between the support functions of a regular polygon and of the polygon around it, which gives
bounds that close as the polygons get more corners.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog

Array = NDArray[np.float64]

#: Corners of the polygon of a pair: tried in this order until the bounds agree on the verdict.
CORNERS = (8, 32)
DENOMINATOR_CORNERS = 32

#: Ascents from different rows where there are too many signs.
STARTS = 6
ASCENTS = 6

#: H without the attacked units has lost rank below this relative singular value.
RANK = 1e-12


@dataclass(frozen=True)
class Ratio:
    """lower <= (1) <= upper; equal if the maximum was found exactly."""

    lower: float
    upper: float

    @property
    def exact(self) -> bool:
        return self.upper <= self.lower * (1.0 + 1e-9)

    @property
    def secure(self) -> bool:
        """Proven to be below 1."""
        return self.upper < 1.0 - 1e-9

    @property
    def undecided(self) -> bool:
        return not self.secure and self.lower < 1.0 - 1e-9

    def __or__(self, other: "Ratio") -> "Ratio":
        """The larger of two."""
        return Ratio(max(self.lower, other.lower), max(self.upper, other.upper))


UNBOUNDED = Ratio(np.inf, np.inf)
ZERO = Ratio(0.0, 0.0)


class RatioProblem:
    """(1) for one split of the groups; rows [k x n] include the weights."""

    def __init__(self, inside: Sequence[Array], outside: Sequence[Array]) -> None:
        stacked = np.vstack(outside) if outside else np.zeros((1, inside[0].shape[1]))
        size = np.linalg.norm(stacked, axis=0)
        size[size == 0.0] = 1.0
        _, values, V = np.linalg.svd(stacked / size, full_matrices=False)
        n = stacked.shape[1]
        self.bounded = len(values) == n and values[-1] > RANK * values[0]
        if not self.bounded:
            return
        T = V.T / values / size[:, None]  # u = T v makes the denominator's rows orthonormal
        self.inside = [rows @ T for rows in inside]
        self.outside = [rows @ T for rows in outside]
        self._polytope(n)

    def _polytope(self, n: int) -> None:
        """{v, t: sum t <= 1, t_g >= d'H_g v for the directions d of g}."""
        normals, owner = [], []
        for g, rows in enumerate(self.outside):
            directions = polygon(len(rows), DENOMINATOR_CORNERS)
            normals.append(directions @ rows)
            owner += [g] * len(directions)
        count = len(self.outside)
        self.A = np.vstack([
            np.hstack([np.vstack(normals), -np.eye(count)[owner]]),
            np.concatenate([np.zeros(n), np.ones(count)])[None, :],
        ])
        self.b = np.append(np.zeros(len(owner)), 1.0)
        self.limits = [(None, None)] * n + [(0.0, None)] * count

    def patterns(self, corners: int) -> int:
        """Linear programs that the exact maximum takes; a pattern and its negative are one."""
        sizes = [2 if len(rows) == 1 else corners for rows in self.inside]
        return max(1, int(np.prod(sizes, dtype=float)) // 2)

    def solve(self, limit: int) -> Ratio:
        """Bounds with about `limit` linear programs at most."""
        if not self.bounded:
            return UNBOUNDED
        found = None
        for corners in CORNERS:
            if self.patterns(corners) > limit:
                break
            found = self._by_signs(corners)
            if found.exact or not found.undecided:
                break
        return found or self._by_ascent()

    def value(self, v: Array) -> float:
        """(1) without the maximum."""
        top = sum(np.linalg.norm(rows @ v) for rows in self.inside)
        return float(top / sum(np.linalg.norm(rows @ v) for rows in self.outside))

    def _maximise(self, c: Array) -> tuple[float, Array]:
        cost = np.concatenate([-c, np.zeros(len(self.outside))])
        done = linprog(cost, A_ub=self.A, b_ub=self.b, bounds=self.limits, method="highs")
        if done.status != 0:
            return np.inf, np.zeros(c.size)
        return float(-done.fun), done.x[: c.size]

    def _by_signs(self, corners: int) -> Ratio:
        choices = [polygon(len(rows), corners) @ rows for rows in self.inside]
        choices[0] = choices[0][: len(choices[0]) // 2]
        best, best_v = 0.0, None
        for pattern in product(*choices):
            value, v = self._maximise(np.sum(pattern, axis=0))
            if not np.isfinite(value):
                return Ratio(0.0, np.inf)
            if value > best:
                best, best_v = value, v
        if best_v is None:
            return ZERO
        paired = any(len(rows) > 1 for rows in self.inside + self.outside)
        if not paired:
            return Ratio(best, best)
        widest = any(len(rows) > 1 for rows in self.inside)
        lower = self._ascend(best_v)
        return Ratio(lower, max(lower, best / (np.cos(np.pi / corners) if widest else 1.0)))

    def _by_ascent(self) -> Ratio:
        """Lower bound: ascents from a few rows; upper bound: every group at its own maximum."""
        upper, starts = 0.0, []
        for rows in self.inside:
            found = [self._maximise(row) for row in rows]
            upper += float(np.linalg.norm([value for value, _ in found]))
            starts += found
        starts.sort(key=lambda item: -item[0])
        lower = max(self._ascend(v) for _, v in starts[:STARTS])
        return Ratio(lower, max(lower, upper))

    def _ascend(self, v: Array) -> float:
        """A local maximum of (1): the numerator gives way to its tangent until it stands still."""
        best = self.value(v) if v.any() else 0.0
        for _ in range(ASCENTS):
            slope = np.zeros(v.size)
            for rows in self.inside:
                image = rows @ v
                size = np.linalg.norm(image)
                slope += rows.T @ (image / size) if size > 0.0 else 0.0
            v = self._maximise(slope)[1]
            reached = self.value(v) if v.any() else 0.0
            if reached <= best * (1.0 + 1e-12):
                break
            best = reached
        return best


def polygon(rows: int, corners: int) -> Array:
    """[k x rows] directions, the second half the negatives of the first: signs for one row."""
    if rows == 1:
        return np.array([[1.0], [-1.0]])
    angle = 2.0 * np.pi * np.arange(corners) / corners
    return np.column_stack([np.cos(angle), np.sin(angle)])
