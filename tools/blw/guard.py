# SPDX-License-Identifier: MIT
"""Method `guard`: secure fusion with one penalty per sensor, tables of blw_guard.h (SPEC 4.1).

The derivation is in docs/guard.md; the local filters are made by guard_filters, their fusion by
guard_fusion, poles for fewer local states than n by guard_order.
"""

from dataclasses import dataclass, field, replace
from math import comb
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blw import gaps, guard_fusion, guard_order, guard_straight, margin
from blw.design import Designed
from blw.errors import DesignError, ModelError
from blw.guard_filters import Filters, filters
from blw.guard_fusion import Fusion
from blw.kalman import Kalman, steady_state
from blw.l1 import probability
from blw.model import Model
from blw.semidefinite import root
from blw.tables import Link, Struct, Table, index, real, table

Array = NDArray

NAME = "guard"
GAPS = "weighted"

DEFAULT_RECOVERY = 0.99

#: Exclusion threshold where none is given, relative to k.
EXCLUDE = 1.5

#: An attack is gross beyond so many k, where rounding in l shows, and so many times benign_size():
#: where the others hardly check a direction, |e_i| is large without any attack.
GROSS = 64.0
BENIGN = 10.0

#: Rows of a strip, BLW_GUARD_STRIP.
STRIP = 3

#: Initial errors this many times larger than P0 says must not look like an attack after warm-up.
START_ERROR = 10.0
LONGEST_WARM_UP = 10_000

#: Gain of the slow average of the multipliers, and false alarms per sensor and step.
DRIFT_GAIN = 1.0 / 32.0
DRIFT_SIGMAS = 5.0

#: Block updates per step and attacked unit, and one more per so many multiply-adds of one where the
#: work beside them weighs less; where several sensors are excluded jointly without tables; and
#: where more than RARE_CLIPPING of the benign steps need some.
UPDATES = 7
UPDATE_TERMS = 80
MOST_UPDATES = 16
UPDATES_IF_JOINT = 30
UPDATES_IF_OFTEN = 200
RARE_CLIPPING = 0.95

#: How (2) is solved: for one liar with tables for every sensor beside it, unless the work may be
#: more than MOST_UPDATES; for everything.
ONE = Link("blw_guard_one_ops", "one")
MANY = Link("blw_guard_many_ops", "many")

#: Sensors beside the p excluded units that a Newton step has room for.
NEWTON_RESERVE = 3

#: blw_guard_model_t.search where noise that is not white may hide who lies from the first choice.
SEARCH_ALWAYS = 2

#: Sets of units times multiply-adds for each that a search may cost in a step.
SEARCH_LIMIT = 2_000_000


@dataclass(frozen=True)
class Options:
    """[method.guard] of a model file."""

    recovery_probability: float | None = field(default=None, metadata={"gt": 0.0, "le": 0.9999})
    k: float | None = field(default=None, metadata={"gt": 0.0})
    exclude: float | None = field(default=None, metadata={"gt": 0.0})
    order: int | None = field(default=None, metadata={"ge": 1})
    max_updates: int | None = field(default=None, metadata={"ge": 1, "le": 65535})


def design(model: Model, kalman: Kalman, options: Options) -> Designed:
    """Tables and figures of `guard` for one model.  Raises ModelError, DesignError."""
    check_options(options, model)
    model, kalman, bank = _bank(model, kalman, options)
    try:
        fusion = guard_fusion.fuse(bank)
    except np.linalg.LinAlgError:
        raise DesignError("the covariance of the local filters is not positive definite in double"
                          " precision; scale the units of the model") from None
    limits = choose_limits(model, kalman, options, bank, fusion)
    info = {
        **limits.figures,
        "search": limits.search,
        "max_updates": limits.max_updates,
        "warm_up_steps": limits.warm_up,
        **filter_figures(model, kalman, bank, fusion),
        **guard_order.curve(model, np.linalg.eigvals(kalman.Acl), bank),
    }
    tables = struct(model, kalman, bank, fusion, limits)
    return Designed(tables, info, mem=(model.n, model.m, bank.r, newton_sensors(model)))


def _bank(model: Model, kalman: Kalman, options: Options) -> tuple[Model, Kalman, Filters]:
    """The local filters, and the model and filter that they are for.

    What decays fast is not fused, and its coasting over a missing sample cannot be weighed by a
    table: then every sample counts once (gaps.cautious()).
    """
    bank = _filters(model, kalman, options)
    if bank.split.n_u == model.n or np.all(model.rate == 1.0):
        return model, kalman, bank
    plain = replace(model, R=model.sample_R)
    model, kalman = gaps.cautious(plain, steady_state(plain.A, plain.C, plain.W, plain.R))
    model = replace(model, rate=np.ones(model.m))
    return model, kalman, _filters(model, kalman, options)


def _filters(model: Model, kalman: Kalman, options: Options) -> Filters:
    poles = np.linalg.eigvals(kalman.Acl)
    return filters(model, guard_order.reduced(poles, options.order or model.n))


@dataclass(frozen=True)
class Limits:
    """Thresholds and bounds of one design."""

    k: float
    exclude: float
    gross: float
    search: bool
    max_updates: int
    warm_up: int
    figures: dict[str, Any]


def choose_limits(
    model: Model, kalman: Kalman, options: Options, bank: Filters, fusion: Fusion
) -> Limits:
    """As given, or from the wanted probability of returning exactly the Kalman estimate."""
    samples = guard_fusion.largest_multiplier(fusion)
    wanted = options.recovery_probability or DEFAULT_RECOVERY
    k = options.k or float(np.quantile(samples, wanted) + disturbed(model, fusion).max())
    exclude = options.exclude or EXCLUDE * k
    if exclude < k:
        raise ModelError(f"method.{NAME}: exclude is {exclude:g}; it must be at least k = {k:g}")
    ratios = guard_fusion.ratios(fusion, model.units, model.p)
    recovery = probability(samples, k)
    pairs = guard_order.pair_reals(model, bank.r) > 0
    search = needs_search(model, ratios, newton_sensors(model) * bank.r)
    return Limits(
        k=k,
        exclude=exclude,
        gross=max(GROSS * k, BENIGN * benign_size(kalman, bank, fusion).max()),
        search=search,
        max_updates=options.max_updates or default_updates(model, bank.r, pairs, search, recovery),
        warm_up=warm_up_steps(model, kalman, bank, fusion),
        figures={
            "k": k,
            "exclude": exclude,
            "recovery_probability": recovery,
            "k_for_recovery": {str(p): float(np.quantile(samples, p)) for p in (0.9, 0.99, 0.999)},
            "k_if_independent": guard_fusion.chi2_threshold(fusion, wanted),
            "ratio": [ratio if np.isfinite(ratio) else None for ratio in ratios.tolist()],
        },
    )


def struct(
    model: Model, kalman: Kalman, bank: Filters, fusion: Fusion, limits: Limits
) -> Struct:
    """Tables blw_guard_model_t."""
    sets = guard_fusion.unit_sets(model.units, model.p)
    pairs = guard_order.pair_reals(model, bank.r) > 0
    return Struct("blw_guard_model_t", NAME, {
        "r": bank.r,
        "reach": fusion.reach,
        "n_u": bank.split.n_u,
        "n_units": len(model.units),
        "most": newton_sensors(model),
        "search": SEARCH_ALWAYS if limits.search and model.noise_margin > 0.0
                  else int(limits.search),
        "pairs": int(pairs),
        "max_updates": limits.max_updates,
        "warm_up": limits.warm_up,
        "unit": index(unit_numbers(model), "[m] the sensor's unit"),
        "rank": index(fusion.rank, "[m] ones in S_ii"),
        **matrices(bank, fusion, pairs, model.weight),
        "effect": table(effects(bank, fusion), "[m] |d x_hat / d tau_i|_2"),
        "drift": table(drift_thresholds(model, bank, fusion), "[m] on |average of l_i|"),
        "k": real(limits.k),
        "exclude": real(limits.exclude),
        "gross": real(limits.gross),
        "gain": real(DRIFT_GAIN),
        "kappa": real(guard_fusion.kappa(fusion, bank.split.Xu, sets)),
        "omega": real(np.sqrt(model.m) * norm(fusion.W @ fusion.Z)),
        "sigma": real(norm(bank.split.Xs @ fusion.Sig @ fusion.Z)),
        "solver": ONE if pairs and model.p == 1 and limits.max_updates <= MOST_UPDATES else MANY,
        "advance": guard_straight.advance(model, kalman, fusion),
        "multiply": guard_straight.multiply(fusion),
        "squares": guard_straight.squares(model.m, bank.r),
        "average": guard_straight.average(model.m, bank.r, DRIFT_GAIN),
        "fuse": guard_straight.fuse(fusion, bank.split.Xu),
        "move": guard_straight.move(fusion),
    }, method=NAME)


def check_options(options: Options, model: Model) -> None:
    """Refuse options that contradict each other or the model."""
    if options.k is not None and options.recovery_probability is not None:
        raise ModelError(f"method.{NAME}: give k or recovery_probability, not both")
    if options.order is not None and options.order > model.n:
        raise ModelError(f"method.{NAME}: order is {options.order}; more local states than the"
                         f" {model.n} of the plant gain nothing")


def newton_sensors(model: Model) -> int:
    """Sensors in the p largest units and some more: those that one Newton step may move."""
    units = sorted((len(unit) for unit in model.units), reverse=True)
    return min(model.m, sum(units[: model.p]) + NEWTON_RESERVE)


def unit_numbers(model: Model) -> list[int]:
    """[m] the number of each sensor's unit."""
    return [next(j for j, unit in enumerate(model.units) if i in unit) for i in range(model.m)]


def needs_search(model: Model, ratios: Array, rows: int) -> bool:
    """Whether a convex penalty alone may be led astray, or kept from its end by several liars, and
    a search is affordable."""
    sets = comb(len(model.units), model.p)
    affordable = sets * (rows**3 / 6 + rows**2) <= SEARCH_LIMIT
    misled = ratios.max() >= 1.0 - 1e-3 or model.noise_margin > 0.0
    return bool(affordable and (model.p > 1 or (model.p > 0 and model.groups and misled)))


def default_updates(model: Model, rows: int, pairs: bool, search: bool, recovery: float) -> int:
    """Room for the steps of an attack on p units; several times that where benign noise alone often
    clips several sensors at once, where whole groups have to be left out, or where the noise is not
    white; and twice that where a second solution follows a search."""
    few = min(MOST_UPDATES, UPDATES + model.m * rows**2 // UPDATE_TERMS)
    each = few * min(2, max(1, model.p)) if pairs else UPDATES_IF_JOINT
    if recovery < RARE_CLIPPING or model.groups or model.noise_margin > 0.0:
        each = UPDATES_IF_OFTEN
    return (2 if search else 1) * each * max(1, model.p)


def strips(M: Array) -> Array:
    """M [rows x cols] three rows at a time, each strip by columns; flat."""
    return np.concatenate([M[a : a + STRIP].T.ravel() for a in range(0, len(M), STRIP)] or [[]])


def rows_of(Lam: Array, reach: int) -> Array:
    """Lam [r x r] by rows, each from `reach` columns left of the diagonal on; flat."""
    return np.concatenate([row[max(0, a - reach) :] for a, row in enumerate(Lam)])


def matrices(
    bank: Filters, fusion: Fusion, pairs: bool, weight: Array
) -> dict[str, Table | None]:
    """The members Lam to Sig; without pairs, no V and no s.  weight [m]: steps that a sample
    stands for."""
    split, r = bank.split, bank.r
    below = [strips(fusion.S[fusion.rows(i), : i * r]) for i in range(1, bank.m)]
    N, n_u, n_s = bank.N, split.n_u, split.As.shape[0]
    vectors, values = guard_fusion.excluded_spectra(fusion) if pairs else (np.zeros((0, 0)),) * 2
    b = fusion.b[:, : fusion.reach] * weight[:, None]
    banded = [rows_of(L, fusion.reach) for L in fusion.Lam]
    turned = [V.ravel() for per_sensor in vectors for V in per_sensor]
    return {
        "Lam": table(np.concatenate(banded), "by rows, banded"),
        "b": table(b, f"[{bank.m}][{fusion.reach}]"),
        "S": table(np.concatenate([*below, []]), "S below its diagonal, sensor by sensor"),
        "V": table(np.concatenate([*turned, []]), "eigenvectors of S_ii without sensor j"),
        "s": table(values, "eigenvalues of S_ii without sensor j"),
        "Fu": table(strips(fusion.Fu), f"[{n_u} x {N}]"),
        "Gu": table(strips(fusion.Gu.T), f"[{n_u} x {N}] transposed"),
        "Xu": table(split.Xu, "[n x n_u]") if n_s else None,
        "Xs": table(split.Xs, "[n x n_s]"),
        "Sig": table(strips(fusion.Sig), f"[{n_s} x {N}]"),
    }


def disturbed(model: Model, fusion: Fusion) -> Array:
    """[m] how far the disturbances within noise_margin move l_i, margin (2)."""
    r, bounds = fusion.r, margin.sigma(model)
    settled = np.zeros((model.m * r, model.m))
    for i in range(model.m):
        settled[fusion.rows(i), i] = np.linalg.solve(np.eye(r) - fusion.Lam[i], fusion.b[i])
    M = fusion.S @ settled
    return np.array([margin.largest(M[fusion.rows(i)], bounds) for i in range(model.m)])


def norm(M: Array) -> float:
    """Largest singular value, 0 of an empty matrix."""
    return float(np.linalg.norm(M, 2)) if M.size else 0.0


def estimate_of(bank: Filters, fusion: Fusion) -> Array:
    """[n x N] x_hat - x_bar per tau."""
    return bank.split.Xu @ fusion.Fu + bank.split.Xs @ fusion.Sig @ fusion.S


def benign_size(kalman: Kalman, bank: Filters, fusion: Fusion) -> Array:
    """[m] standard deviation of |e_i| without attack, over the rows that others can check: at most
    that of the local error and that of the prediction in its coordinates together."""
    Pu = bank.split.Tu @ kalman.Pp @ bank.split.Tu.T
    parts = (fusion.W, fusion.Gu @ Pu @ fusion.Gu.T)
    return np.array([sum(np.sqrt(np.diag(part)[fusion.rows(i)][:rank].sum()) for part in parts)
                     for i, rank in enumerate(fusion.rank)])


def effects(bank: Filters, fusion: Fusion) -> Array:
    """[m] |x_hat| per |tau_i|."""
    F = estimate_of(bank, fusion)
    return np.array([norm(F[:, fusion.rows(i)]) for i in range(bank.m)])


def warm_up_steps(model: Model, kalman: Kalman, bank: Filters, fusion: Fusion) -> int:
    """Steps until an initial error of START_ERROR times P0 moves no |l_i| by more than 1."""
    start = root(kalman.P if model.P0 is None else model.P0)
    split, m, r = bank.split, bank.m, bank.r
    eps = -(fusion.Gu @ split.Tu @ start)
    xs = split.Ts @ start
    drive = model.C @ split.Xs @ split.As
    for steps in range(LONGEST_WARM_UP):
        l = (fusion.S @ eps).reshape(m, r, -1)
        if START_ERROR * max(norm(block) for block in l) <= 1.0 and steps > 0:
            return steps
        pushed = fusion.b[:, :, None] * (drive @ xs)[:, None, :]
        eps = (fusion.Lam @ eps.reshape(m, r, -1) + pushed).reshape(m * r, -1)
        xs = split.As @ xs
    return LONGEST_WARM_UP


def drift_thresholds(model: Model, bank: Filters, fusion: Fusion) -> Array:
    """[m] DRIFT_SIGMAS above the benign mean of |average of l_i|^2, moment by moment.

    The average is s = g sum_j (1-g)^j l(k-j); with F the dynamics of (eps, xs) and a = 1 - g,
    cov s = g / (2 - g) (V + Y + Y'),  Y = (I - a F)^-1 a F V, in the rows of l = S eps.
    """
    a, r, N = 1.0 - DRIFT_GAIN, bank.r, bank.N
    V, Vs = fusion.W, fusion.Sig
    drive = model.C @ bank.split.Xs @ bank.split.As
    As = bank.split.As
    Ys = np.linalg.solve(np.eye(len(As)) - a * As, a * As @ Vs)
    pushed = a * drive @ (Vs + Ys)  # [m x N]
    Y = np.empty((N, N))
    for i in range(bank.m):
        rows = fusion.rows(i)
        right = a * fusion.Lam[i] @ V[rows] + np.outer(fusion.b[i], pushed[i])
        Y[rows] = np.linalg.solve(np.eye(r) - a * fusion.Lam[i], right)
    cov = fusion.S @ (V + Y + Y.T) @ fusion.S * (DRIFT_GAIN / (2.0 - DRIFT_GAIN))
    found = []
    for i in range(bank.m):
        block = cov[fusion.rows(i), fusion.rows(i)]
        mean, spread = np.trace(block), np.sqrt(2.0 * np.sum(block * block))
        found.append(np.sqrt(max(mean + DRIFT_SIGMAS * spread, 1e-12)))
    return np.array(found) + disturbed(model, fusion)


def filter_figures(model: Model, kalman: Kalman, bank: Filters, fusion: Fusion) -> dict[str, Any]:
    """What a reader wants to know about filters and fusion."""
    unchecked = [model.sensors[i] for i in range(model.m) if fusion.rank[i] < bank.r]
    return {
        "local_states": bank.r,
        "secure_modes": bank.split.n_u,
        "cond_W": float(np.linalg.cond(bank.W)),
        "trace_P": guard_order.trace_P(bank),
        "trace_P_kalman": float(np.trace(kalman.P)),
        "unchecked_sensors": unchecked,
    }
