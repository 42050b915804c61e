# SPDX-License-Identifier: MIT
"""The canonical form of [N] Theorem 2: P_i G_i X = H_i, diagonal, 1 where sensor i observes a
coordinate and 0 elsewhere.

X.  The paper takes the Jordan coordinates of A.  What is needed is that the columns of X span, for
every sensor, the states that it does not see; so to column j any multiple of column k may be added
if every sensor that sees k sees j as well, with the same H_i, groups and guarantee.  Modes whose
eigenvalues nearly agree have nearly parallel vectors, and what tells them apart is large numbers
that nearly cancel: a car with speed v and acceleration a, eigenvalues 1 and 0.99984, has the
Jordan coordinates v + 122 a and a.  Then the fusion is beyond float32; and between two samples a
local filter, which decays in its own coordinates, is in these

    xi_i = P_i J P_i^-1 xi_i,                                                                   (1)

which grows by up to 1750 before it decays.  The prediction from the estimate stands in for a
missing sample, so that is a loop, and on a bus that loses frames it was unstable under attack.
Columns that are orthogonal to all that may be added to them (in the units that balance A) make it
1.4; for oscillating modes Jordan coordinates are the better ones.  The growth of (1) decides.

P_i is not unique where a sensor misses a mode.  Here the observed coordinates are the best linear
unbiased estimates from zeta_i, (O' W_ii^-1 O)^-1 O' W_ii^-1 with O the observed columns of G_i X;
the other rows see noise only and are orthonormal in W_ii: both depend on the model alone, up to a
rotation of the latter, which is fixed in local coordinates.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from blw.errors import DesignError
from blw.jordan_form import Block
from blw.local_filters import LocalFilters
from blw.modes import Modes

Array = NDArray[np.float64]

#: steady: what grows least; auto: that if it grows by much less than jordan, else jordan.
Choice = Literal["auto", "jordan", "orthogonal", "steady"]

MUCH_LESS = 0.1

#: Steady is sought among columns that are orthogonal within clusters of modes whose eigenvalues
#: are closer than these parts of 1 - rho(A - K C A), which is what the filter can tell apart.
REACHES = (0.02, 0.2, 1.0)

#: Powers of (1) whose growth counts.
STEPS = tuple(range(1, 17))

#: Largest error of P_i G_i X = H_i that is taken for rounding.
RESIDUAL = 1e-6


@dataclass(frozen=True, eq=False)
class CanonicalForm:
    """X [n x n] and P [m x n x n] with P_i G_i X = H_i."""

    filters: LocalFilters
    modes: Modes
    X: Array
    P: Array

    @property
    def observed(self) -> Array:
        """[m x n] whether sensor i observes coordinate j: the diagonals of H_i."""
        return self.modes.observed

    @property
    def changed(self) -> list[int]:
        """Which coordinates, from 0, are not Jordan's."""
        return np.flatnonzero((self.X != self.modes.X).any(axis=0)).tolist()

    @cached_property
    def growth(self) -> float:
        """Largest growth of (1) in the 1-norm, every row in units of its benign deviation."""
        n = self.modes.observed.shape[1]
        found = 0.0
        for i, P_i in enumerate(self.P):
            rows = slice(i * n, i * n + n)
            scaled = P_i / np.sqrt(np.diag(P_i @ self.filters.W[rows, rows] @ P_i.T))[:, None]
            step = np.linalg.solve(scaled.T, (scaled @ self.filters.form.J).T).T
            found = max([found, *(np.linalg.norm(np.linalg.matrix_power(step, k), 1)
                                  for k in STEPS)])
        return float(found)


def choose(filters: LocalFilters, modes: Modes, choice: Choice) -> CanonicalForm:
    """The canonical form for local filters and modes of A.

    Raises DesignError if A is derogatory, or if P does not exist or cannot be computed.
    """
    if choice == "orthogonal":
        return _form(filters, modes, orthogonal(modes, np.zeros(len(modes.X))))
    if choice == "jordan":
        return _form(filters, modes, modes.X)
    forgetting = 1.0 - float(np.abs(filters.form.eigenvalues).max())
    others = [orthogonal(modes, clusters(modes, part * forgetting)) for part in REACHES]
    different = {X.tobytes(): X for X in [modes.X, *others]}
    forms, errors = [], []
    for X in different.values():
        try:
            forms.append(_form(filters, modes, X))
        except DesignError as error:
            errors.append(error)
    if not forms:
        raise errors[0]
    steady = min(forms, key=lambda form: form.growth)
    keep = choice == "auto" and steady.growth > MUCH_LESS * forms[0].growth
    return forms[0] if keep else steady


def _form(filters: LocalFilters, modes: Modes, X: Array) -> CanonicalForm:
    return CanonicalForm(filters, modes, X, transforms(filters, modes.observed, X))


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


def transforms(filters: LocalFilters, observed: Array, X: Array) -> Array:
    """P [m x n x n].  Raises DesignError if they do not exist or cannot be computed."""
    m, n = observed.shape
    if filters.r < n:
        raise DesignError(f"A - K C A is derogatory: its {filters.r} local states per sensor cannot"
                          f" hold the {n} modes of A; use guard")
    P = np.empty((m, n, n))
    for i in range(m):
        rows = slice(i * n, i * n + n)
        G_i = filters.G[rows] @ X
        P[i] = transform(G_i[:, observed[i]], filters.W[rows, rows], observed[i])
        error = np.abs(P[i] @ G_i - np.diag(observed[i])).max()
        if not error <= RESIDUAL:
            raise DesignError(f"sensor {i + 1} sees some mode too faintly to separate it: P G - H ="
                              f" {error:.1e}, cond(P) = {np.linalg.cond(P[i]):.1e}; use guard")
    return P


def transform(O: Array, W: Array, observed: Array) -> Array:  # noqa: E741
    """P_i [n x n] for observed columns O [n x k] of G_i X and covariance W [n x n] of zeta_i."""
    deviation = np.sqrt(np.diag(W))
    L = np.linalg.cholesky(W / np.outer(deviation, deviation))
    whitened = scipy.linalg.solve_triangular(L, O / deviation[:, None], lower=True)
    Q, T = np.linalg.qr(whitened)
    P = np.empty_like(W)
    P[observed] = np.linalg.solve(T, Q.T)
    P[~observed] = complement(Q)
    return scipy.linalg.solve_triangular(L, P.T, lower=True, trans="T").T / deviation


def complement(Q: Array) -> Array:
    """[n - k x n] orthonormal rows that complete the orthonormal columns Q [n x k].

    Gram-Schmidt on the unit vectors, twice each: unlike a factorisation with signs and pivots of
    its own, this does not depend on the linear algebra package.
    """
    n, k = Q.shape
    basis, found = Q, []
    for unit in np.eye(n):
        rest = unit
        for _ in range(2):
            rest = rest - basis @ (rest @ basis)
        if len(found) < n - k and np.linalg.norm(rest) > 1.0 / (2.0 * n):
            found.append(rest / np.linalg.norm(rest))
            basis = np.column_stack([basis, found[-1]])
    return np.array(found).reshape(n - k, n)
