# SPDX-License-Identifier: MIT
"""Fusion of `guard` in device coordinates, its threshold and its constants (SPEC 4.1).

With W = L L' and the QR decomposition L^-1 Gu = [Q1 Q2] [R1; 0],

    Fu = R1^-1 Q1' L^-1,   S = L'^-1 (I - Q1 Q1') L^-1:   xu_hat = Fu eta,   l = S eta           (1)

are the best linear estimate and its multipliers; l ~ N(0, S) without attack.  Per sensor
T_i S_ii T_i' = diag(I, 0), the zeros being directions that no other sensor can check, and

    eta_i' = T_i'^-1 eta_i,   l_i' = T_i l_i,   S' = T S T',   Lam_i' = T_i'^-1 Lam T_i'.        (2)

An orthogonal matrix is left free in T_i.  Where S_ii = I for all sensors it makes Lam_i' upper
Hessenberg and b_i' a multiple of e_1: `reach` is the number of diagonals below the main one, and
of entries of b_i', that need not be zero.
"""

from dataclasses import dataclass
from itertools import combinations
from math import comb, sqrt

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from blw import chi2
from blw.guard_filters import Filters

Array = NDArray

#: Share of a direction's own information that the other sensors can check; below it is rounding.
UNCHECKED = 1e-8

_SEED = 20260001
_SAMPLES = 100_000
_WORK = 4e9  # multiply-adds that sampling may take
_CHUNK = 4096
_MAX_SETS = 2000


@dataclass(frozen=True, eq=False)
class Fusion:
    """(2), everything in device coordinates."""

    Lam: Array  #: [m][r x r]
    b: Array  #: [m][r]
    S: Array  #: [N x N]
    Z: Array  #: [N x N - n_u], S = Z Z'
    Fu: Array  #: [n_u x N]
    Gu: Array  #: [N x n_u]
    Sig: Array  #: [n_s x N]
    rank: list[int]  #: per sensor, of S_ii
    reach: int  #: of Lam and b: 1, or r where some S_ii is singular
    W: Array  #: [N x N]
    T: Array  #: [m][r x r]

    @property
    def m(self) -> int:
        return len(self.b)

    @property
    def r(self) -> int:
        return self.b.shape[1]

    def rows(self, i: int) -> slice:
        """Rows of sensor i."""
        return slice(i * self.r, (i + 1) * self.r)


def fuse(filters: Filters) -> Fusion:
    """The fusion of the local filters."""
    L = np.linalg.cholesky(filters.W)
    H = scipy.linalg.solve_triangular(L, filters.Gu, lower=True)
    Q, R = np.linalg.qr(H, mode="complete")
    n_u = filters.split.n_u
    Z = scipy.linalg.solve_triangular(L.T, Q[:, n_u:])
    Fu = scipy.linalg.solve_triangular(
        R[:n_u], scipy.linalg.solve_triangular(L.T, Q[:, :n_u]).T
    ) if n_u else np.zeros((0, filters.N))
    m, r = filters.m, filters.r
    T, rank = zip(*(_normal(Z[s], filters.W[s, s]) for s in _spans(m, r)))
    hessenberg = min(rank) == r
    if hessenberg:
        T = [_staircase(t, filters) for t in T]
    back = [np.linalg.inv(t).T for t in T]  # eta' = back eta
    per_sensor = scipy.linalg.block_diag(*T)
    inverse = scipy.linalg.block_diag(*back)
    Z = per_sensor @ Z
    for s, good in zip(_spans(m, r), rank):
        Z[s][good:] = 0.0
    Lam = np.array([t @ filters.Lam @ np.linalg.inv(t) for t in back])
    b = np.array([t @ filters.b for t in back])
    if hessenberg:
        Lam, b = np.triu(Lam, -1), np.where(np.arange(r) < 1, b, 0.0)
    return Fusion(
        Lam=Lam,
        b=b,
        S=Z @ Z.T,
        Z=Z,
        Fu=Fu @ per_sensor.T,
        Gu=inverse @ filters.Gu,
        Sig=filters.Sig @ inverse.T,
        rank=list(rank),
        reach=1 if hessenberg else r,
        W=inverse @ filters.W @ inverse.T,
        T=np.array(T),
    )


def _spans(m: int, r: int) -> list[slice]:
    return [slice(i * r, (i + 1) * r) for i in range(m)]


def _normal(Z: Array, W: Array) -> tuple[Array, int]:
    """T_i of (2) from the rows Z [r x d] and W_ii, and the rank of S_ii.

    The share of a direction is the eigenvalue of L_i' S_ii L_i, W_ii = L_i L_i': independent of
    coordinates and units.
    """
    L = np.linalg.cholesky(W)
    U, s, _ = np.linalg.svd(L.T @ Z, full_matrices=True)
    share = np.zeros(len(W))
    share[: s.size] = s**2
    good = share > UNCHECKED
    T = (U / np.where(good, np.sqrt(np.where(good, share, 1.0)), 1.0)).T @ L.T
    return T, int(good.sum())


def _staircase(T: Array, filters: Filters) -> Array:
    """T_i turned such that Lam_i' is upper Hessenberg and b_i' a multiple of e_1."""
    back = np.linalg.inv(T).T
    b = back @ filters.b
    Q = np.linalg.qr(b[:, None], mode="complete")[0]
    _, H = scipy.linalg.hessenberg(Q.T @ back @ filters.Lam @ T.T @ Q, calc_q=True)
    return (Q @ H).T @ T  # the first column of H is e_1


def excluded_spectra(fusion: Fusion) -> tuple[Array, Array]:
    """For sensors i and j /= i: eigenvectors [m][m-1][r x r], in rows, and eigenvalues [m][m-1][r]
    of S_ii - S_ij S_ji, which is what is left of S_ii once sensor j is excluded."""
    m, r = fusion.m, fusion.r
    vectors, values = np.empty((m, m - 1, r, r)), np.empty((m, m - 1, r))
    for i in range(m):
        for at, j in enumerate(j for j in range(m) if j != i):
            coupling = fusion.S[fusion.rows(i), fusion.rows(j)]
            own = fusion.S[fusion.rows(i), fusion.rows(i)]
            found, V = np.linalg.eigh(own - coupling @ coupling.T)
            vectors[i, at], values[i, at] = V.T, np.clip(found, 0.0, 1.0)
    return vectors, values


def largest_multiplier(fusion: Fusion) -> Array:
    """Sorted samples of max_i |l_i| without attack; fixed seed, as many as are affordable."""
    N, d = fusion.Z.shape
    samples = int(min(_SAMPLES, max(20_000, _WORK / max(1, N * d))))
    generator = np.random.default_rng(_SEED)
    found = np.empty(samples)
    for start in range(0, samples, _CHUNK):
        count = min(_CHUNK, samples - start)
        l = fusion.Z @ generator.standard_normal((d, count))
        norms = np.sqrt(np.sum(l.reshape(fusion.m, fusion.r, count) ** 2, axis=1))
        found[start : start + count] = norms.max(axis=0)
    return np.sort(found)


def chi2_threshold(fusion: Fusion, probability: float) -> float:
    """k as if the m tests were independent: the closed form of SPEC 4.1."""
    return sqrt(chi2.threshold(1.0 - probability ** (1.0 / fusion.m), max(fusion.rank)))


def unit_sets(units: list[list[int]], p: int) -> list[tuple[int, ...]] | None:
    """Sensors of every choice of p units; None if there are too many to go through."""
    if comb(len(units), p) > _MAX_SETS:
        return None
    return [tuple(i for unit in chosen for i in unit) for chosen in combinations(units, p)]


def checkable(fusion: Fusion, rows: Array) -> Array:
    """[m][r x k] rows [N x k] by sensor, those that no other sensor can check set to zero."""
    blocks = rows.reshape(fusion.m, fusion.r, -1).copy()
    for block, rank in zip(blocks, fusion.rank):
        block[rank:] = 0.0
    return blocks


def kappa(fusion: Fusion, Xu: Array, sets: list[tuple[int, ...]] | None) -> float:
    """Smallest kappa with |Xu x| <= kappa sum over i not in I of |Gu_i x|, for every I in sets;
    0 if there is none (some mode is seen by nothing else, or there are too many sets)."""
    n_u = fusion.Gu.shape[1]
    if n_u == 0 or sets is None:
        return 0.0
    R = np.linalg.qr(Xu, mode="r")
    scaled = np.linalg.solve(R.T, fusion.Gu.T).T  # |Xu x| = |R x|
    blocks = checkable(fusion, scaled)
    gram = np.einsum("iab,iac->ibc", blocks, blocks)
    total, largest = gram.sum(axis=0), 0.0
    for chosen in [(), *sets]:
        rest = total - gram[list(chosen)].sum(axis=0)
        smallest = float(np.linalg.eigvalsh(rest)[0])
        if smallest <= 1e-12 * float(np.trace(total)):
            return 0.0
        largest = max(largest, 1.0 / np.sqrt(smallest))
    return largest


def ratios(fusion: Fusion, units: list[list[int]], p: int, samples: int = 4000) -> Array:
    """[units] sampled max over x of the attacked units' share, sum_I |v_i| / sum_rest |v_i| with
    v_i = Z_i' Gu_i x, over the sets I of p units that hold the unit; below 1 the limit of a large
    attack is harmless (docs/guard.md).  For every x the worst I are the largest p units."""
    n_u = fusion.Gu.shape[1]
    worst = np.zeros(len(units))
    if n_u == 0 or p == 0:
        return worst
    generator = np.random.default_rng(_SEED)
    x = generator.standard_normal((n_u, samples))
    R = np.linalg.qr(fusion.Gu, mode="r")
    x = np.hstack([np.linalg.solve(R, x), x])
    for _ in range(2):
        share = _shares(fusion, units, x)
        for j in range(len(units)):
            others = np.sort(np.delete(share, j, axis=0), axis=0)[::-1]
            taken = share[j] + others[: p - 1].sum(axis=0)
            worst[j] = max(worst[j], float(_ratio(taken, share).max()))
        best = x[:, np.argsort(-_worst_ratio(share, p))[:50]]
        x = np.repeat(best, 40, axis=1)
        x = x + 0.1 * np.linalg.norm(x, axis=0) * generator.standard_normal(x.shape)
    return worst


def _shares(fusion: Fusion, units: list[list[int]], x: Array) -> Array:
    """[units x samples] sum over the unit's sensors of |v_i|, checkable rows only."""
    norms = np.linalg.norm(checkable(fusion, fusion.Gu @ x), axis=1)
    return np.array([norms[unit].sum(axis=0) for unit in units])


def _worst_ratio(share: Array, p: int) -> Array:
    return _ratio(np.sort(share, axis=0)[::-1][:p].sum(axis=0), share)


def _ratio(taken: Array, share: Array) -> Array:
    """Of the share that was taken to the rest; infinite where nothing is left."""
    rest = share.sum(axis=0) - taken
    return np.divide(taken, rest, out=np.full(len(rest), np.inf), where=rest > 0.0)
