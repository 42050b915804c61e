# SPDX-License-Identifier: MIT
"""Modes of A and which sensor sees which: the test of Popov, Belevitch and Hautus.

Sensor i sees an eigenvector v of A iff C_i v /= 0, and a set of sensors sees the eigenvalue iff its
rows keep their eigenspace: rank C_S V = dim V.  Nearly equal eigenvalues of a matrix that is nearly
defective form one cluster, whose mean is far better conditioned than they are.  Powers of A, which
lose rank numerically, are not used.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import matrix_balance

from blw import jordan_form
from blw.errors import DesignError
from blw.jordan_form import JordanForm
from blw.kalman import mode_text

Array = NDArray

#: Distances below which eigenvalues may be one cluster; the first with a sound basis is taken.
TOLERANCES = (1e-10, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4)
BASIS_COND = 1e5

#: A cluster's eigenvectors: singular values of T - lambda I below this, relative to max(1, |T|).
EIGENVECTOR = 1e-7

#: A mode is unseen if the terms of C_i v cancel but for this part of them,
UNSEEN = 1e-9
#: and an entry of v is zero if it is no more than this part of the balanced vector.
ROUNDING = 1e-11


@dataclass(frozen=True, eq=False)
class Mode:
    """One eigenvalue (of a conjugate pair: the upper one) and what the sensors see of it."""

    eigenvalue: complex
    rows: Array  #: [m x d] C V; what nothing is seen of is exactly 0
    multiplicity: int

    @property
    def dimension(self) -> int:
        """Of the eigenspace; above 1 A is derogatory."""
        return self.rows.shape[1]

    @property
    def seen(self) -> Array:
        """[m] whether the sensor sees any of it."""
        return self.rows.any(axis=1)

    @property
    def persists(self) -> bool:
        """Whether the mode does not die out by itself."""
        return abs(self.eigenvalue) >= 1.0 - 1e-8


@dataclass(frozen=True, eq=False)
class Modes:
    """Jordan form of A [n x n] as the sensors C [m x n] see it."""

    form: JordanForm
    A: Array
    C: Array

    @cached_property
    def units(self) -> Array:
        """[n] scale of the states that balances A, so that their units do not matter."""
        return np.diag(matrix_balance(self.A, permute=False)[1])

    def visible(self, vectors: Array) -> Array:
        """[m x k] C v of the vectors [n x k] without what is only rounding."""
        balanced = np.abs(vectors / self.units[:, None])
        clean = np.where(balanced > ROUNDING * np.linalg.norm(balanced, axis=0), vectors, 0.0)
        value = self.C @ clean
        return np.where(np.abs(value) > UNSEEN * (np.abs(self.C) @ np.abs(clean)), value, 0.0)

    @cached_property
    def modes(self) -> list[Mode]:
        """Every eigenvalue once, complex pairs by their upper one."""
        found = []
        for block, U, T in zip(self.form.blocks, self.form.bases, self.form.compressions):
            rows = self.visible(U @ _eigenvectors(T))
            found.append(Mode(block.eigenvalue, rows, block.multiplicity))
        return found

    @property
    def derogatory(self) -> list[complex]:
        """Eigenvalues with more than one eigenvector."""
        return [mode.eigenvalue for mode in self.modes if mode.dimension > 1]

    @cached_property
    def X(self) -> Array:
        """[n x n] real Jordan coordinates, A X = X J.  Raises DesignError if A is derogatory."""
        if self.form.derogatory or self.derogatory:
            first = (self.derogatory or [self.form.blocks[0].eigenvalue])[0]
            raise DesignError(
                f"A is derogatory: its eigenvalue {mode_text(first)} has more than one eigenvector,"
                " so [N]'s canonical form does not exist; use guard"
            )
        return jordan_form.chain_vectors(self.form)

    @cached_property
    def observed(self) -> Array:
        """[m x n] whether sensor i observes Jordan coordinate j: a chain from its first visible
        vector on."""
        visible = self.visible(self.X) != 0.0
        for block in self.form.blocks:
            step = block.size // block.length
            links = visible[:, block.rows].reshape(len(visible), block.length, step).any(axis=2)
            known = np.logical_or.accumulate(links, axis=1)
            visible[:, block.rows] = np.repeat(known, step, axis=1)
        return visible


def modes_of(A: Array, C: Array) -> Modes:
    """Modes of A [n x n] and their visibility through C [m x n].

    Raises DesignError if the eigenvalues of A cannot be told apart numerically.
    """
    best, best_cond = None, np.inf
    for tolerance in TOLERANCES:
        try:
            form = jordan_form.jordan_form(A, tolerance)
        except np.linalg.LinAlgError:
            continue
        cond = np.linalg.cond(jordan_form.stacked_basis(form))
        if cond < best_cond:
            best, best_cond = form, cond
        if cond <= BASIS_COND:
            break
    if best is None:
        raise DesignError("A has no numerically stable Jordan form")
    return Modes(best, A, C)


def _eigenvectors(T: Array) -> Array:
    """[k x d] orthonormal eigenvectors of T [k x k], whose eigenvalues are one cluster."""
    shifted = T - np.trace(T) / len(T) * np.eye(len(T))
    _, values, vectors = np.linalg.svd(shifted)
    small = values <= EIGENVECTOR * max(1.0, float(np.linalg.norm(T, 2)))
    d = max(1, int(np.count_nonzero(small)))
    return vectors[-d:].conj().T
