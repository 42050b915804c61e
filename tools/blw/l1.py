# SPDX-License-Identifier: MIT
"""Reduced form of the l1-penalised fusion and its thresholds: the tables of blw_l1.h.

For zeta = H x + mu + nu with mu ~ N(0, W),

    Z' W Z = I,   Z' H = 0,   l = Z Z' zeta = Z z,   z ~ N(0, I) without attack,               (1)

and nu = 0 is optimal iff |l_g| <= c_g = gamma w_g for every group g.  Z [N x d], d = N - n, comes
from a Cholesky factor of the equilibrated W and a QR decomposition, is made lower trapezoidal by
an orthogonal change of its columns, and its rows are scaled span by span (a span is a Jordan block
of one sensor) so that l has unit mean square per row.  The scale s belongs to zeta:

    zeta' = s zeta,   H' = s H,   W' = s W s,   Z' = Z / s,   F' = F / s,   c' = c / s.        (2)
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg
import scipy.special
from numpy.typing import NDArray

from blw import l1_straight
from blw.errors import DesignError
from blw.tables import Link, Struct, index, real, table

Array = NDArray[Any]

ACTIVE_SET = Link("blw_l1_active_set_ops", "active_set")
ADMM = Link("blw_l1_admm_ops", "admm")
TABLEAU = Link("blw_l1_tableau_ops", "tableau")
NEWTON = Link("blw_l1_newton_ops", "newton")

#: Part of a row's information that is redundant; below this it is rounding.
_NOT_REDUNDANT = 1e-12

#: What it may leave of a one.
_ROUNDING = 1e-12

#: A row is a combination of others if no more than this part of it is left.
_DEPENDENT = 1e-9

#: Most rows of zeta: dense tables of N^2 numbers.
_MAX_ROWS = 1024

_SAMPLES = 200_000
_CHUNK = 20_000
_SEED = 20200131


@dataclass(frozen=True, eq=False)
class Groups:
    """Rows that share one penalty: adjacent, one or two of them."""

    first: Array  #: [g + 1] first row of each group, then N
    weight: Array  #: [g]

    @property
    def count(self) -> int:
        return self.weight.size

    def norms(self, rows: Array) -> Array:
        """|rows_g| for rows [N x k] -> [g x k]."""
        return np.sqrt(np.add.reduceat(rows * rows, self.first[:-1], axis=0))

    def spread(self, per_group: Array) -> Array:
        """Repeat per-group values [g] or [g x k] for every row of the group."""
        return np.repeat(per_group, np.diff(self.first), axis=0)


def sensor_groups(
    local: list[tuple[int, int]], sensors: int, r: int, sensor_weight: Array | None = None
) -> Groups:
    """Groups of all sensors from those of one, (first row, rows); sqrt2 for two rows."""
    weight = np.ones(sensors) if sensor_weight is None else np.asarray(sensor_weight, dtype=float)
    first = [i * r + row for i in range(sensors) for row, _ in local]
    each = np.array([np.sqrt(rows) for _, rows in local])
    return Groups(np.array(first + [sensors * r]), np.kron(weight, each))


@dataclass(frozen=True, eq=False)
class Reduced:
    """(1) in the scaled coordinates of (2)."""

    Z: Array  #: [N x d] lower trapezoidal
    H: Array  #: [N x n]
    W: Array  #: [N x N]
    scale: Array  #: [N] s, constant over a span

    @property
    def S(self) -> Array:
        """[N x N] covariance of l without attack; 1 is exact on the diagonal."""
        S = self.Z @ self.Z.T
        ones = np.flatnonzero(np.abs(np.diag(S) - 1.0) < _ROUNDING)
        S[ones, ones] = 1.0
        return S

    @property
    def unchecked(self) -> Array:
        """Rows without redundancy, whose multiplier is always zero."""
        return np.flatnonzero(~self.Z.any(axis=1))


def reduced(W: Array, H: Array, spans: list[slice]) -> Reduced:
    """Reduced form for covariance W [N x N] and regressor H [N x n]; spans cover the rows.

    Raises DesignError if W is not positive definite or nothing is redundant (N = n).
    """
    N, n = H.shape
    if N <= n:
        raise DesignError(f"{N} local states for {n} states: no redundancy to check against")
    if N > _MAX_ROWS:
        raise DesignError(f"{N} local states, at most {_MAX_ROWS} are supported")
    deviation = np.sqrt(np.diag(W))
    try:
        L = np.linalg.cholesky(W / np.outer(deviation, deviation))
    except np.linalg.LinAlgError as error:
        raise DesignError("W is not positive definite in double precision; use guard") from error
    whitened = scipy.linalg.solve_triangular(L, H / deviation[:, None], lower=True)
    Q = np.linalg.qr(whitened, mode="complete")[0]
    full = scipy.linalg.solve_triangular(L.T, Q) / deviation[:, None]
    Z, scale = _scaled(full, n, spans)
    return Reduced(_trapezoidal(Z), H * scale[:, None], W * np.outer(scale, scale), scale)


def _scaled(full: Array, n: int, spans: list[slice]) -> tuple[Array, Array]:
    """Z / s and s, from the n columns of `full` [N x N] that explain x and the others, Z.

    A span that only a change of x could explain has rows of rounding errors in Z.  They become
    zero: its multiplier vanishes and it is never suspected, which is what the exact rows would do.
    """
    Z, scale = full[:, n:].copy(), np.empty(full.shape[0])
    total, redundant = np.sum(full**2, axis=1), np.sum(Z**2, axis=1)
    for span in spans:
        if np.all(redundant[span] <= _NOT_REDUNDANT * total[span]):
            Z[span], scale[span] = 0.0, np.sqrt(np.mean(total[span]))
        else:
            scale[span] = np.sqrt(np.mean(redundant[span]))
    return Z / scale[:, None], scale


def _trapezoidal(Z: Array) -> Array:
    """Z Q with Q orthogonal such that row i ends at column i or before, with a positive number if
    it is independent of the rows above.

    Q comes from the first d independent rows by Gram-Schmidt, twice each: unlike a plain QR of the
    first d rows this is unique, so that the tables do not depend on the linear algebra package.
    """
    d, count = Z.shape[1], 0
    Q, width = np.zeros((d, d)), np.full(Z.shape[0], d)
    for i, row in enumerate(Z):
        rest = row
        for _ in range(2):
            rest = rest - Q[:, :count] @ (rest @ Q[:, :count])
        length = np.linalg.norm(rest)
        if length > _DEPENDENT * np.linalg.norm(row):
            Q[:, count] = rest / length
            count += 1
        width[i] = count
        if count == d:
            return np.where(np.arange(d) < width[:, None], Z @ Q, 0.0)
    raise DesignError(f"W is too ill-conditioned: {count} of {d} redundant directions found")


def recovery_statistic(reduced_form: Reduced, groups: Groups) -> Array:
    """Sorted samples of max_g |l_g| / w_g without attack, w in unscaled coordinates.

    The certificate at gamma holds iff the statistic is <= gamma; Monte Carlo with a fixed seed.
    """
    Z = reduced_form.Z
    weight = groups.weight / reduced_form.scale[groups.first[:-1]]
    generator = np.random.default_rng(_SEED)
    samples = np.empty(_SAMPLES)
    for start in range(0, _SAMPLES, _CHUNK):
        rows = Z @ generator.standard_normal((Z.shape[1], _CHUNK))
        samples[start : start + _CHUNK] = np.max(groups.norms(rows) / weight[:, None], axis=0)
    samples.sort()
    return samples


def probability(samples: Array, gamma: float) -> float:
    """P(exactly Kalman without attack) at gamma."""
    return float(np.searchsorted(samples, gamma, side="right")) / samples.size


def union_bound(reduced_form: Reduced, groups: Groups, gamma: float) -> float:
    """Lower bound on P(exactly Kalman): 1 - sum_g P(|l_g| > c_g), at least 0.

    One row: a normal tail.  Two rows: at most the tail exp(-c^2 / 2 lambda_max) of the isotropic
    case.
    """
    S = reduced_form.S
    c = thresholds(reduced_form, groups, gamma)
    missed = 0.0
    for first, last, c_g in zip(groups.first[:-1], groups.first[1:], c):
        largest = np.linalg.eigvalsh(S[first:last, first:last])[-1]
        if largest <= 0.0:
            continue  # nothing redundant: the multiplier is always 0
        if last - first == 1:
            missed += float(scipy.special.erfc(c_g / np.sqrt(2.0 * largest)))
        else:
            missed += float(np.exp(-(c_g**2) / (2.0 * largest)))
    return max(0.0, 1.0 - missed)


def thresholds(reduced_form: Reduced, groups: Groups, gamma: float) -> Array:
    """c' [g] of (2)."""
    return gamma * groups.weight / reduced_form.scale[groups.first[:-1]]


def kappas(reduced_form: Reduced, groups: Groups, c: Array) -> tuple[float, float]:
    """Constants of the error bound: sum_g c_g |(H x)_g| >= |x| / kappa_G for all x, and
    sum_g c_g |(W Z e)_g| <= kappa_W |e| for all e."""
    rows = groups.spread(c)[:, None]
    smallest = np.linalg.svd(rows * reduced_form.H, compute_uv=False)[-1]
    largest = np.linalg.norm(rows * (reduced_form.W @ reduced_form.Z), 2)
    return 1.0 / float(smallest), float(np.sqrt(groups.count) * largest)


def pack_trapezoid(Z: Array) -> Array:
    """Rows of Z, row i with min(i + 1, d) numbers."""
    return np.concatenate([row[: min(i + 1, Z.shape[1])] for i, row in enumerate(Z)])


def pack_lower(M: Array) -> Array:
    """Lower triangle of M by rows."""
    return M[np.tril_indices(M.shape[0])]


@dataclass(frozen=True, eq=False)
class Engine:
    """How the problem is solved on the device."""

    link: Link
    max_iterations: int
    rho: float = 0.0
    M: Array | None = None  #: admm: (S + rho I)^-1; newton: smoothed()


def smoothed(reduced_form: Reduced, groups: Groups, c: Array, kappa: float) -> Array:
    """[N x N] from zeta to the multipliers l where the corner of every |nu_g| is rounded off below
    kappa width_g and no nu_g is beyond, blw_l1_newton_start.c (1): S with W + D in place of W,
    D = kappa width_g / c_g on group g, width_g = the benign standard deviation of its first row."""
    width = np.sqrt(np.diag(reduced_form.W)[groups.first[:-1]])
    K = np.linalg.inv(reduced_form.W + np.diag(groups.spread(kappa * width / c)))
    KH = K @ reduced_form.H
    M = K - KH @ np.linalg.solve(reduced_form.H.T @ KH, KH.T)
    return (M + M.T) / 2.0


def struct(
    suffix: str, reduced_form: Reduced, groups: Groups, F: Array, gamma: float, engine: Engine
) -> Struct:
    """Tables blw_l1_model_t; F [n x N] unscaled."""
    Z = reduced_form.Z
    N, d = Z.shape
    c = thresholds(reduced_form, groups, gamma)
    kappa_G, kappa_W = kappas(reduced_form, groups, c)
    tableau = engine.link is TABLEAU
    in_W = tableau or engine.link is NEWTON
    packed = "[N(N+1)/2] packed lower"
    scaled_F = F / reduced_form.scale
    inverse = "S smoothed by rho" if in_W else "(S + rho I)^-1"
    M = None if engine.M is None else table(pack_lower(engine.M), f"{packed}: {inverse}")
    return Struct(
        "blw_l1_model_t",
        suffix,
        {
            "N": N,
            "d": d,
            "n_groups": groups.count,
            "max_iterations": engine.max_iterations,
            "n": F.shape[0],
            "engine": engine.link,
            "first": index(groups.first, "[n_groups + 1] first row of each group, then N"),
            "Z": None if in_W else table(pack_trapezoid(Z), f"[{N} x {d}] trapezoid, packed"),
            "F": table(scaled_F, f"[{F.shape[0]} x {N}]"),
            "c": table(c, "[n_groups] gamma w_g / s_g"),
            "M": M,
            "S": table(pack_lower(reduced_form.S), f"{packed}: Z Z'") if in_W else None,
            "W": table(pack_lower(reduced_form.W), packed) if in_W else None,
            "G": table(reduced_form.H, f"[{N} x {F.shape[0]}]") if in_W else None,
            "P": table(pack_lower(scaled_F @ reduced_form.W @ scaled_F.T), "[n(n+1)/2] F W F'")
            if in_W else None,
            "fast": l1_straight.kernels(f"{suffix}_fast", reduced_form.S, F.shape[0])
            if tableau else None,
            "rho": real(engine.rho),
            "kappa_G": real(kappa_G),
            "kappa_W": real(kappa_W),
        },
    )
