# SPDX-License-Identifier: MIT
"""Real Jordan form of a real matrix M, as the local filters of [L] need it.

The spectrum is split into clusters of nearly equal eigenvalues.  Every cluster becomes one chain

    J_l = lambda_l I + (ones above the diagonal),   input vector 1,                            (1)

whose length is the degree of the cluster's factor of the *minimal* polynomial: a derogatory M gets
fewer rows than its order.  Inside a cluster the eigenvalues stay distinct: two of them, c +- d
or c +- i d, share the block [[c, 1], [+-d^2, c]], which is (1) for d = 0 and exact otherwise.  So
clustering is a choice of coordinates, never an approximation.

A complex pair z, z* is kept real as sqrt2 [Re z; Im z]: a unitary change, so that covariances carry
over; its input vector is (sqrt2, 0).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg
import scipy.sparse.csgraph
from numpy.typing import NDArray

Array = NDArray[Any]

SQRT2 = float(np.sqrt(2.0))

#: Below this (relative to |M|) M - lambda I is zero on a cluster: the eigenvalue is semisimple.
_SEMISIMPLE = 1e-12
#: Powers of the normalised nilpotent part are dependent below this relative residual.
_DEPENDENT = 1e-7
#: Coefficients of the shifted minimal polynomial below this are rounding: the chain is exact.
_ROUNDING = 1e-13


@dataclass(frozen=True)
class Block:
    """One chain: rows first .. first + size - 1 of J."""

    first: int
    size: int
    length: int  #: links of the chain; size = length, or 2 length for a complex pair
    multiplicity: int  #: eigenvalues of M in the cluster (upper half plane if complex)
    eigenvalue: complex  #: their mean

    @property
    def is_complex(self) -> bool:
        return self.size != self.length

    @property
    def rows(self) -> slice:
        return slice(self.first, self.first + self.size)


@dataclass(frozen=True, eq=False)
class JordanForm:
    """J [r x r], input vector b [r] and the invariant subspaces they stand for."""

    J: Array
    b: Array
    blocks: tuple[Block, ...]
    tolerance: float  #: within which eigenvalues were clustered
    eigenvalues: Array  #: [n] of M, complex
    links: tuple[Array, ...]  #: per block [q x q], J_l before a pair is made real
    bases: tuple[Array, ...]  #: per block [n x k], orthonormal, M U = U T
    compressions: tuple[Array, ...]  #: per block [k x k] T

    @property
    def r(self) -> int:
        return self.J.shape[0]

    @property
    def derogatory(self) -> bool:
        """True if the minimal polynomial has a lower degree than M has rows."""
        return self.r < self.eigenvalues.size

    def groups(self) -> list[tuple[int, int]]:
        """(first row, rows) of every l1 group: one row, or the two rows of a complex link."""
        found = []
        for block in self.blocks:
            rows = 2 if block.is_complex else 1
            found += [(block.first + rows * link, rows) for link in range(block.length)]
        return found


def cluster(eigenvalues: Array, tolerance: float) -> list[Array]:
    """Indices of each cluster: real ones ascending, then complex ones (upper half plane only).

    Single linkage: neighbours closer than tolerance max(1, |lambda|) belong together; a pair that
    is so close to the real axis joins a real cluster.
    """
    reach = tolerance * np.maximum(1.0, np.abs(eigenvalues))
    near = np.abs(eigenvalues[:, None] - eigenvalues[None, :]) <= np.maximum.outer(reach, reach)
    near |= np.eye(eigenvalues.size, dtype=bool)
    _, label = scipy.sparse.csgraph.connected_components(near, directed=False)
    found = []
    for index in range(label.max() + 1):
        members = np.flatnonzero(label == index)
        mean = eigenvalues[members].mean()
        real = _self_conjugate(eigenvalues[members])
        if real or mean.imag > 0.0:
            found.append((not real, mean.real, mean.imag, members))
    found.sort(key=lambda item: item[:3])
    return [item[3] for item in found]


def _self_conjugate(values: Array) -> bool:
    return bool(np.count_nonzero(values.imag > 0.0) == np.count_nonzero(values.imag < 0.0))


def jordan_form(M: Array, tolerance: float = 1e-8) -> JordanForm:
    """Real Jordan form of M [n x n] with eigenvalues clustered by `tolerance`.

    Raises numpy.linalg.LinAlgError if the clusters cannot be separated numerically.
    """
    eigenvalues = np.linalg.eigvals(M).astype(complex)
    scale = max(1.0, float(np.linalg.norm(M, 2)))
    blocks, links, bases, compressions = [], [], [], []
    first = 0
    for members in cluster(eigenvalues, tolerance):
        is_complex = not _self_conjugate(eigenvalues[members])
        U, T = _invariant_subspace(M, eigenvalues, members, is_complex)
        link = _chain(T, scale)
        length = link.shape[0]
        size = 2 * length if is_complex else length
        mean = complex(np.trace(link) / length)
        blocks.append(Block(first, size, length, len(members), mean))
        links.append(link)
        bases.append(U)
        compressions.append(T)
        first += size
    J = scipy.linalg.block_diag(*(real_form(link) for link in links))
    b = np.concatenate([input_vector(link) for link in links])
    return JordanForm(
        J, b, tuple(blocks), tolerance, eigenvalues, tuple(links), tuple(bases),
        tuple(compressions),
    )


def real_form(link: Array) -> Array:
    """Matrix of sqrt2 [Re z; Im z] for z+ = link z; the link itself if it is real."""
    if not np.iscomplexobj(link):
        return link
    quarter_turn = np.array([[0.0, -1.0], [1.0, 0.0]])
    return np.kron(link.real, np.eye(2)) + np.kron(link.imag, quarter_turn)


def input_vector(link: Array) -> Array:
    """The all-one input vector of a chain in real coordinates."""
    if not np.iscomplexobj(link):
        return np.ones(link.shape[0])
    return np.kron(np.ones(link.shape[0]), np.array([SQRT2, 0.0]))


def real_columns(columns: Array) -> Array:
    """Real matrix [n x 2q] that maps sqrt2 [Re z; Im z] to f z + f* z*, for f [n x q] complex."""
    if not np.iscomplexobj(columns):
        return columns
    pairs = np.stack([SQRT2 * columns.real, -SQRT2 * columns.imag], axis=2)
    return pairs.reshape(columns.shape[0], -1)


def _invariant_subspace(
    M: Array, eigenvalues: Array, members: Array, is_complex: bool
) -> tuple[Array, Array]:
    """Orthonormal U [n x k] and T [k x k] with M U = U T for the eigenvalues of one cluster."""
    inside = np.zeros(eigenvalues.size, dtype=bool)
    inside[members] = True

    def selected(re: complex, im: float = 0.0) -> bool:
        return bool(inside[np.argmin(np.abs(eigenvalues - (re + 1j * im)))])

    output = "complex" if is_complex else "real"
    T, U, count = scipy.linalg.schur(M, output=output, sort=selected)
    if count != members.size:
        raise np.linalg.LinAlgError(
            f"the cluster of eigenvalues at {eigenvalues[members].mean():.6g} cannot be separated"
        )
    return U[:, :count], T[:count, :count]


def _chain(T: Array, scale: float) -> Array:
    """Chain [q x q] with the minimal polynomial of T [k x k], whose eigenvalues lie close."""
    centre = np.trace(T) / T.shape[0]
    shifted = T - centre * np.eye(T.shape[0])
    nu = float(np.linalg.norm(shifted, 2))
    if nu <= _SEMISIMPLE * scale:
        return np.array([[centre]])
    coefficients = _minimal_polynomial(shifted / nu)
    degree = coefficients.size - 1
    mean = -coefficients[1] / degree * nu
    roots = np.roots(coefficients) * nu - mean
    centre = centre + mean
    size = np.abs(np.poly(roots)[1:])
    if np.all(size <= _ROUNDING * scale ** np.arange(1, degree + 1)):
        return centre * np.eye(degree) + np.eye(degree, k=1)
    if np.iscomplexobj(T):
        return np.diag(centre + roots) + np.eye(degree, k=1)
    return _newton_chain(centre, roots)


def _minimal_polynomial(N: Array) -> Array:
    """Monic coefficients, highest first, of the minimal polynomial of N, |N| = 1."""
    powers = [np.eye(N.shape[0], dtype=N.dtype)]
    while True:
        power = powers[-1] @ N
        basis = np.stack([p.ravel() for p in powers], axis=1)
        coefficients = np.linalg.lstsq(basis, power.ravel(), rcond=None)[0]
        residual = np.linalg.norm(power.ravel() - basis @ coefficients)
        if residual <= _DEPENDENT or len(powers) == N.shape[0]:
            return np.concatenate(([1.0], -coefficients[::-1]))
        powers.append(power)


def _newton_chain(centre: float, roots: Array) -> Array:
    """Real chain with eigenvalues centre + roots, a set closed under conjugation."""
    upper = sorted(roots[roots.imag > 0.0], key=lambda root: root.real)
    real = np.sort(roots[roots.imag == 0.0].real)
    pairs = [(root.real, -(root.imag**2)) for root in upper]
    pairs += [((a + b) / 2.0, ((a - b) / 2.0) ** 2) for a, b in zip(real[:-1:2], real[1::2])]
    chain = np.eye(roots.size, k=1) + centre * np.eye(roots.size)
    for index, (mean, square) in enumerate(pairs):
        row = 2 * index
        chain[row, row] += mean
        chain[row + 1, row + 1] += mean
        chain[row + 1, row] = square
    if real.size % 2:
        chain[-1, -1] += real[-1]
    return chain


def intertwiner(T: Array, link: Array, start: Array, image: Array) -> Array:
    """Y [k x q] with T Y = Y link and Y start = image [k].

    Exists and is unique if link has the minimal polynomial of T and start [q] is cyclic for it.
    """
    k, q = T.shape[0], link.shape[0]
    commute = np.kron(T, np.eye(q)) - np.kron(np.eye(k), link.T)
    total = np.kron(np.eye(k), start[None, :])
    right = np.concatenate([np.zeros(k * q), image])
    return np.linalg.lstsq(np.vstack([commute, total]), right, rcond=None)[0].reshape(k, q)


def chain_vectors(form: JordanForm) -> Array:
    """V [n x n] with M V = V J for a form that is not derogatory.

    Every chain starts from its last vector, which has unit norm, is orthogonal to the vectors of
    lower order, and has a real positive largest entry.
    """
    columns = []
    for U, T, link in zip(form.bases, form.compressions, form.links):
        q = link.shape[0]
        nilpotent = T - np.trace(T) / q * np.eye(q)
        lower = np.linalg.matrix_power(nilpotent / max(np.linalg.norm(nilpotent), 1e-300), q - 1)
        top = np.linalg.svd(lower)[2][0].conj()
        vector = U @ top
        largest = vector[np.argmax(np.round(np.abs(vector), 9))]
        last = np.eye(q)[:, -1]
        Y = intertwiner(T, link, last, top * (largest.conj() / abs(largest)))
        columns.append(real_columns(U @ Y))
    return np.hstack(columns)


def stacked_basis(form: JordanForm) -> Array:
    """[n x n] all invariant subspaces side by side, a complex one followed by its conjugate."""
    parts = []
    for U in form.bases:
        parts += [U, U.conj()] if np.iscomplexobj(U) else [U]
    return np.hstack(parts)


def components(form: JordanForm, vectors: Array) -> list[Array]:
    """Per block [k x c]: coordinates of vectors [n x c] in that block's subspace."""
    inside = np.linalg.solve(stacked_basis(form), vectors)
    parts, at = [], 0
    for U in form.bases:
        k = U.shape[1]
        part = inside[at : at + k]
        parts.append(part if np.iscomplexobj(U) else part.real)
        at += 2 * k if np.iscomplexobj(U) else k
    return parts
