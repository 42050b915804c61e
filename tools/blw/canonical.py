# SPDX-License-Identifier: MIT
"""Method `canonical`: the l1 fusion of [N] in Jordan coordinates of A, tables of blw_lasso.h.

The local filters are those of `lasso`; xi_i = P_i zeta_i with P_i G_i X = H_i, where A X = X J is
the real Jordan form of a non-derogatory A and H_i is diagonal: 1 where sensor i observes the
coordinate, 0 elsewhere ([N] Theorem 2; blw.coordinates tells where X is another).  Then

    minimise over x, mu, nu:  1/2 mu' M^-1 mu + gamma sum_i v_i sum_g w_g |nu_ig|,              (1)
    xi = H X^-1 x + mu + nu,   M = P~ W P~',                                                 (2)

with v_i the weight of sensor i and w_g = sqrt2 for a complex pair of A.

P_i is not unique where a sensor misses a mode.  Here the observed coordinates are the best linear
unbiased estimates from zeta_i, (O' W_ii^-1 O)^-1 O' W_ii^-1 with O the observed columns of G_i X;
the other rows see noise only and are orthonormal in W_ii: both depend on the model alone, up to a
rotation of the latter, which is fixed in local coordinates.

With v_i = 1 a mode that an even number of sensors sees has many minimisers (median of an even
number); weights without equal partial sums make it one.  (1) bounds the influence of any p
sensors iff in every mode the p heaviest that see it weigh less than the others.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from blw import l1, lasso
from blw.coordinates import Choice, Coordinates, choose
from blw.design import Designed
from blw.errors import DesignError, ModelError
from blw.kalman import Kalman
from blw.local_filters import LocalFilters, local_filters
from blw.model import Model
from blw.modes import modes_of

Array = NDArray[np.float64]

NAME = "canonical"
AVERAGES = False

#: First weights - 1; the golden section continues them below WIDEST.
OFFSETS = (0.0, 0.03, 0.07, 0.13, 0.21, 0.33)
WIDEST = 0.33
GOLDEN_SECTION = 0.6180339887498949

#: Largest error of P_i G_i X = H_i that is taken for rounding.
RESIDUAL = 1e-6

#: Partial sums of weights that are closer than this are equal.
EQUAL_SUMS = 1e-6

#: Sensors of one mode for which all partial sums are compared.
MOST_SUMMED = 16


@dataclass(frozen=True)
class Options(lasso.Options):
    """[method.canonical] of a model file: that of lasso, and"""

    #: of every sensor's penalty; they must vary by less than (p + 1) / p
    weights: list[float] | None = None
    #: of the fusion, see blw.coordinates
    coordinates: Choice = "auto"
    #: printed: [N] as it stands, all weights 1, Jordan coordinates
    variant: Literal["corrected", "printed"] = "corrected"


def design(model: Model, kalman: Kalman, options: Options) -> Designed:
    """Tables and figures of `canonical` for one model.  Raises ModelError, DesignError."""
    lasso.check_options(options, model, NAME)
    weights = sensor_weights(model, options)
    choice = "jordan" if options.variant == "printed" else options.coordinates
    space = choose(modes_of(model.A, model.C), choice, kalman.Acl)
    filters = local_filters(model, kalman)
    P = transforms(filters, space)
    return assemble(model, kalman, options, weights, filters, space, P)


def assemble(model: Model, kalman: Kalman, options: Options, weights: Array,
             filters: LocalFilters, space: Coordinates, P: Array) -> Designed:
    """Tables and figures for given transforms P [m x n x n] with P_i G_i X = H_i."""
    fused = fusion(weights, filters, space, P)
    designed = lasso.assemble(NAME, fused, filters, model, kalman, options)
    return Designed(designed.tables, designed.info | figures(model, options, weights, space, P),
                    designed.mem)


def fusion(weights: Array, filters: LocalFilters, space: Coordinates, P: Array) -> lasso.Fusion:
    """The problem (1) in reduced form for given transforms P [m x n x n]."""
    m, n = P.shape[:2]
    local = space.modes.form.groups()
    rows = [slice(i * n + first, i * n + first + size) for i in range(m) for first, size in local]
    stacked = scipy.linalg.block_diag(*P)
    M = stacked @ filters.W @ stacked.T
    H = space.observed.reshape(m * n, 1) * np.tile(np.linalg.inv(space.X), (m, 1))
    reduced = l1.reduced((M + M.T) / 2.0, H, rows)
    deviation = np.sqrt(np.diag(filters.W)).reshape(m, n)
    filter_scale = 1.0 / block_means(filters, deviation).ravel()
    return lasso.Fusion(
        reduced=reduced,
        groups=l1.sensor_groups(local, m, n, weights),
        F=np.linalg.solve(stacked.T, filters.F.T).T,
        response=P @ lasso.steady_response(filters),
        filter_scale=filter_scale,
        P=reduced.scale.reshape(m, n, 1) * P / filter_scale.reshape(m, 1, n),
        ambiguous=ambiguous(weights, space.observed),
    )


def figures(model: Model, options: Options, weights: Array, space: Coordinates, P: Array) -> dict:
    """What a reader wants to know beside the figures of lasso."""
    return {
        "variant": options.variant,
        "coordinates_changed": space.changed,
        "weights": weights.tolist(),
        "ambiguous": ambiguous(weights, space.observed),
        "modes": [
            {
                "re": mode.eigenvalue.real,
                "im": abs(mode.eigenvalue.imag),
                "multiplicity": mode.multiplicity,
                "seen_by": [model.sensors[i] for i in np.flatnonzero(mode.seen)],
            }
            for mode in space.modes.modes
        ],
        "cond_P": float(max(np.linalg.cond(P_i) for P_i in P)),
        "cond_X": float(np.linalg.cond(space.X)),
    }


def sensor_weights(model: Model, options: Options) -> Array:
    """[m] as given, all 1, or by the default rule.  Raises ModelError if they do not fit."""
    where = f"method.{NAME}.weights"
    if options.weights is None:
        return np.ones(model.m) if options.variant == "printed" else default_weights(model)
    weights = np.array(options.weights)
    if options.variant == "printed":
        raise ModelError(f"{where}: variant \"printed\" has all weights 1")
    if weights.size != model.m:
        raise ModelError(f"{where}: {weights.size} numbers for {model.m} sensors")
    if not np.all(weights > 0.0):
        raise ModelError(f"{where}: must be positive")
    if model.p > 0 and weights.max() * model.p >= weights.min() * (model.p + 1):
        raise ModelError(
            f"{where}: they vary by {weights.max() / weights.min():.4g}; against p = {model.p}"
            f" attacked sensors it must be less than (p + 1) / p = {(model.p + 1) / model.p:.4g}")
    return weights


def default_weights(model: Model) -> Array:
    """[m] 1, 1.03, 1.07, 1.13, ...: no equal partial sums, and a range below (p + 1) / p."""
    later = np.arange(len(OFFSETS), max(model.m, len(OFFSETS)))
    offsets = np.concatenate([OFFSETS, WIDEST * np.modf(GOLDEN_SECTION * later)[0]])[: model.m]
    return 1.0 + offsets * min(1.0, 3.0 / max(model.p, 1))


def ambiguous(weights: Array, observed: Array) -> bool:
    """Whether the sensors that observe some coordinate can be split into two sides of one weight.

    observed [m x n].  Then (1) has an interval of minimisers whenever the two sides disagree.
    """
    return any(splits_evenly(weights[column]) for column in np.unique(observed.T, axis=0))


def splits_evenly(weights: Sequence[float]) -> bool:
    """Whether some signs make sum +-w_i vanish; more than MOST_SUMMED only if two are equal."""
    ordered = np.sort(np.asarray(weights))
    if ordered.size > MOST_SUMMED:
        return ordered.size % 2 == 0 and bool(np.any(np.diff(ordered) < EQUAL_SUMS))
    sums = np.zeros(1)
    for weight in ordered:
        sums = np.concatenate([sums + weight, sums - weight])
    return ordered.size > 0 and bool(np.min(np.abs(sums)) < EQUAL_SUMS)


def block_means(filters: LocalFilters, rows: Array) -> Array:
    """[m x r] root mean squares over each Jordan block of the local filters."""
    means = np.empty_like(rows)
    for block in filters.form.blocks:
        means[:, block.rows] = np.sqrt(np.mean(rows[:, block.rows] ** 2, axis=1, keepdims=True))
    return means


def transforms(filters: LocalFilters, space: Coordinates) -> Array:
    """P [m x n x n].  Raises DesignError if they do not exist or cannot be computed."""
    observed = space.observed
    m, n = observed.shape
    if filters.r < n:
        raise DesignError(f"A - K C A is derogatory: its {filters.r} local states per sensor cannot"
                          f" hold the {n} modes of A; use guard")
    P = np.empty((m, n, n))
    for i in range(m):
        rows = slice(i * n, i * n + n)
        G_i = filters.G[rows] @ space.X
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
