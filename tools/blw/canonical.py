# SPDX-License-Identifier: MIT
"""Method `canonical`: the l1 fusion of [N] in Jordan coordinates of A, tables of blw_lasso.h.

The local filters are those of `lasso`; xi_i = P_i zeta_i with P_i G_i X = H_i, where A X = X J is
the real Jordan form of a non-derogatory A and H_i is diagonal: 1 where sensor i observes the
coordinate, 0 elsewhere ([N] Theorem 2; blw.canonical_form tells where X is another).  Then

    minimise over x, mu, nu:  1/2 mu' M^-1 mu + gamma sum_i v_i sum_g w_g |nu_ig|,              (1)
    xi = H X^-1 x + mu + nu,   M = P~ W P~',                                                 (2)

with v_i the weight of sensor i and w_g = sqrt2 for a complex pair of A.

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
from blw.canonical_form import CanonicalForm, Choice, choose
from blw.design import Designed
from blw.errors import DesignError, ModelError
from blw.kalman import Kalman
from blw.local_filters import LocalFilters, local_filters
from blw.model import Model
from blw.modes import modes_of

Array = NDArray[np.float64]

NAME = "canonical"
GAPS = "counted once"

#: Of the local estimates between samples, where samples are missing; beyond it the loop over the
#: predictions that stand in for them was unstable on random plants, below it on none.
GROWTH_MAX = 1000.0

#: First weights - 1; the golden section continues them below WIDEST.
OFFSETS = (0.0, 0.03, 0.07, 0.13, 0.21, 0.33)
WIDEST = 0.33
GOLDEN_SECTION = 0.6180339887498949

#: Partial sums of weights that are closer than this are equal.
EQUAL_SUMS = 1e-6

#: Sensors of one mode for which all partial sums are compared.
MOST_SUMMED = 16


@dataclass(frozen=True)
class Options(lasso.Options):
    """[method.canonical] of a model file: that of lasso, and"""

    #: of every sensor's penalty; they must vary by less than (p + 1) / p
    weights: list[float] | None = None
    #: X, see blw.canonical_form
    coordinates: Choice = "auto"
    #: printed: [N] as it stands, all weights 1, Jordan coordinates
    variant: Literal["corrected", "printed"] = "corrected"


def design(model: Model, kalman: Kalman, options: Options) -> Designed:
    """Tables and figures of `canonical` for one model.  Raises ModelError, DesignError."""
    lasso.check_options(options, model, NAME)
    weights = sensor_weights(model, options)
    modes = modes_of(model.A, model.C)
    filters = local_filters(model, kalman)
    form = choose(filters, modes, _coordinates(model, options))
    if np.any(model.rate < 1.0) and form.growth > GROWTH_MAX:
        raise DesignError("samples are missing (plant.rate), and until they come its local "
                          f"estimates may grow by a factor of {form.growth:.3g}, at most "
                          f"{GROWTH_MAX:g} is supported: use guard or decentral")
    return assemble(model, kalman, options, weights, filters, form)


def _coordinates(model: Model, options: Options) -> Choice:
    if options.variant == "printed":
        if options.coordinates not in ("auto", "jordan"):
            raise ModelError(f"method.{NAME}.coordinates: variant \"printed\" has Jordan "
                             "coordinates")
        return "jordan"
    if options.coordinates == "auto" and np.any(model.rate < 1.0):
        return "steady"
    return options.coordinates


def assemble(model: Model, kalman: Kalman, options: Options, weights: Array,
             filters: LocalFilters, form: CanonicalForm) -> Designed:
    """Tables and figures in a given canonical form."""
    fused = fusion(weights, filters, form)
    designed = lasso.assemble(NAME, fused, filters, model, kalman, options)
    return Designed(designed.tables, designed.info | figures(model, options, weights, form),
                    designed.mem)


def fusion(weights: Array, filters: LocalFilters, form: CanonicalForm) -> lasso.Fusion:
    """The problem (1) in reduced form."""
    m, n = form.observed.shape
    P, local = form.P, form.modes.form.groups()
    rows = [slice(i * n + first, i * n + first + size) for i in range(m) for first, size in local]
    stacked = scipy.linalg.block_diag(*P)
    M = stacked @ filters.W @ stacked.T
    H = form.observed.reshape(m * n, 1) * np.tile(np.linalg.inv(form.X), (m, 1))
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
        ambiguous=ambiguous(weights, form.observed),
    )


def figures(model: Model, options: Options, weights: Array, form: CanonicalForm) -> dict:
    """What a reader wants to know beside the figures of lasso."""
    return {
        "variant": options.variant,
        "coordinates_changed": form.changed,
        "coordinates_growth": form.growth,
        "weights": weights.tolist(),
        "ambiguous": ambiguous(weights, form.observed),
        "modes": [
            {
                "re": mode.eigenvalue.real,
                "im": abs(mode.eigenvalue.imag),
                "multiplicity": mode.multiplicity,
                "seen_by": [model.sensors[i] for i in np.flatnonzero(mode.seen)],
            }
            for mode in form.modes.modes
        ],
        "cond_P": float(max(np.linalg.cond(P_i) for P_i in form.P)),
        "cond_X": float(np.linalg.cond(form.X)),
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
