# SPDX-License-Identifier: MIT
"""Coordinates for the fusion of [N]: P_i G_i X = H_i, diagonal, needs X whose columns span, for
every sensor, the states that it does not see.

The Jordan coordinates of A do that, and are those of the paper.  But modes whose eigenvalues
nearly agree have nearly parallel vectors, and what tells them apart is large numbers that nearly
cancel: on a car with speed v and acceleration a, eigenvalues 1 and 0.99984, they are v + 122 a and
a.  Every coordinate being fused by itself, an attack that moves the two by different amounts moves
v by 122 times the difference.

The columns of a sensor's unseen states may be mixed: to column j any multiple of column k may be
added if every sensor that sees k sees j as well.  So column j is made orthogonal to all such k (in
the units that balance A), and its length 1.  That keeps H_i, the groups and with them the
guarantee; only A X = X J becomes A X = X T, T block triangular.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from blw.jordan_form import Block
from blw.modes import Modes

Array = NDArray[np.float64]

Choice = Literal["auto", "jordan", "orthogonal"]

#: auto: modes whose eigenvalues differ by less than this part of 1 - rho(A - K C A).  Within the
#: filter's memory they grow apart by less than that.
CLOSE = 0.02


@dataclass(frozen=True, eq=False)
class Coordinates:
    """X [n x n] for modes of A, whose `observed` and groups hold for X column by column."""

    modes: Modes
    X: Array

    @property
    def observed(self) -> Array:
        """[m x n] whether sensor i sees coordinate j."""
        return self.modes.observed

    @property
    def changed(self) -> list[int]:
        """Which of them, from 0, are not the Jordan coordinates."""
        return np.flatnonzero((self.X != self.modes.X).any(axis=0)).tolist()


def choose(modes: Modes, choice: Choice, Acl: Array) -> Coordinates:
    """Coordinates for modes of A and the filter Acl = A - K C A.  Raises DesignError if A is
    derogatory.

    orthogonal mixes all modes, jordan none, and auto those that Acl cannot tell apart.
    """
    if choice == "orthogonal":
        return Coordinates(modes, orthogonal(modes, np.zeros(len(Acl))))
    forgetting = 1.0 - float(np.abs(np.linalg.eigvals(Acl)).max())
    reach = CLOSE * forgetting if choice == "auto" else 0.0
    return Coordinates(modes, orthogonal(modes, clusters(modes, reach)))


def clusters(modes: Modes, reach: float) -> Array:
    """[n] a number per coordinate: modes that a chain of distances below reach connects share one,
    and every coordinate of a mode that is close to none has one of its own."""
    blocks = modes.form.blocks
    number, own = np.arange(len(blocks)), np.ones(len(blocks), dtype=bool)
    for i, block in enumerate(blocks):
        for j, other in enumerate(blocks[: i + 1]):
            if _distance(block, other) < reach:
                number[number == number[i]] = number[j]
                own[[i, j]] = False
    rows = np.repeat(np.arange(len(blocks)), [block.size for block in blocks])
    return np.where(own[rows], -1 - np.arange(rows.size), number[rows])


def _distance(block: Block, other: Block) -> float:
    """Between the eigenvalues of two blocks; of a complex pair and itself, between the two."""
    if block is other:
        return 2.0 * abs(block.eigenvalue.imag) if block.is_complex else np.inf
    return min(abs(block.eigenvalue - z) for z in (other.eigenvalue, other.eigenvalue.conjugate()))


def orthogonal(modes: Modes, cluster: Array) -> Array:
    """X [n x n] with every column orthogonal to those of its cluster that may be mixed into it."""
    X = modes.X.copy()
    seen = modes.observed
    order = np.argsort(seen.sum(axis=0), kind="stable")
    for place, j in enumerate(order):
        earlier = [k for k in order[:place]
                   if cluster[k] == cluster[j] and np.all(seen[:, k] <= seen[:, j])]
        if earlier:
            balanced = X / modes.units[:, None]
            X[:, j] = modes.units * _residual(balanced[:, earlier], balanced[:, j])
    return X


def _residual(B: Array, v: Array) -> Array:
    """v [n] without its part in the span of B [n x k], of unit length; projected twice."""
    Q = np.linalg.qr(B)[0]
    for _ in range(2):
        v = v - Q @ (Q.T @ v)
        v = v / np.linalg.norm(v)
    return v
