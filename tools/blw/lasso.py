# SPDX-License-Identifier: MIT
"""Method `lasso`: local filters and l1 fusion of [L], tables of blw_lasso.h.

    minimise over x, mu, nu:  1/2 mu' W^-1 mu + gamma sum_g w_g |nu_g|,   zeta = G x + mu + nu

w_g = 1 for a real mode and sqrt2 for a complex pair, whose two rows are one group.
"""

from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from blw import admm_tuning, l1, margin, straight
from blw.design import Designed
from blw.errors import ModelError
from blw.kalman import Kalman
from blw.l1_tuning import BenignLoss
from blw.local_filters import LocalFilters, local_filters
from blw.model import Model
from blw.tables import Struct, table

Array = NDArray[np.float64]

NAME = "lasso"
GAPS = "counted once"

#: Options that choose gamma; at most one is given.
GAMMA_KEYS = ("gamma", "recovery_probability", "benign_loss")

#: Mean square error without attack above that of the Kalman filter, as a part of it.
DEFAULT_BENIGN_LOSS = 0.1

#: Bound on the Newton steps of one solve: those that converge need about 6.
NEWTON_STEPS = 64
#: Smoothing of the passes before them, in benign standard deviations of zeta.
NEWTON_KAPPA = 0.2
#: They and the tableau work with W: above this cond(W) float32 is better served by pivots on Z.
COND_COARSE = 1e10

#: Bound on the pivots of one solve, for each row of zeta.
PIVOTS = 4
PIVOTS_IF_PAIRED = 8

#: Passes per row that the device keeps back from ADMM for the exact solve on the support.
SUPPORT_RESERVE = 2


@dataclass(frozen=True)
class Options:
    """[method.lasso] of a model file."""

    gamma: float | None = field(default=None, metadata={"gt": 0.0})
    recovery_probability: float | None = field(default=None, metadata={"gt": 0.0, "le": 0.999})
    benign_loss: float | None = field(default=None, metadata={"gt": 0.0, "le": 10.0})
    max_iterations: int | None = field(default=None, metadata={"ge": 1, "le": 65535})
    #: wanted error of x_hat in benign standard deviations; only admm needs it
    tolerance: float = field(default=1e-6, metadata={"ge": 1e-12, "le": 1.0})
    engine: Literal["auto", "active_set", "admm"] = "auto"


@dataclass(frozen=True, eq=False)
class Fusion:
    """What tells one l1 fusion of the local filters from another."""

    reduced: l1.Reduced
    groups: l1.Groups
    F: Array  #: [n x N] unscaled
    response: Array  #: [m x r] unscaled stationary answer to a constant bias of 1 on each sensor
    filter_scale: Array  #: [m r] of the local filters
    P: Array | None = None  #: [m x r x r] from scaled local states to scaled fused ones
    ambiguous: bool = False


def design(model: Model, kalman: Kalman, options: Options) -> Designed:
    """Tables and figures of `lasso` for one model.  Raises ModelError, DesignError."""
    check_options(options, model, NAME)
    filters = local_filters(model, kalman)
    groups = l1.sensor_groups(filters.form.groups(), model.m, filters.r)
    reduced_form = l1.reduced(filters.W, filters.G, spans(filters, model.m))
    response = np.tile(steady_response(filters), (model.m, 1))
    fusion = Fusion(reduced_form, groups, filters.F, response, reduced_form.scale)
    return assemble(NAME, fusion, filters, model, kalman, options)


def assemble(
    name: str, fusion: Fusion, filters: LocalFilters, model: Model, kalman: Kalman, options: Options
) -> Designed:
    """Tables blw_lasso_model_t and figures of one fusion; chooses gamma and the engine."""
    reduced_form, groups = fusion.reduced, fusion.groups
    gamma, figures = choose_gamma(fusion, model, float(np.trace(kalman.P)), options)
    problem = admm_tuning.Problem(reduced_form, groups, fusion.F, gamma, fusion.response)
    active_set = choose_active_set(problem, fusion.P is not None, filters.cond_W)
    engine, engine_figures = choose_engine(problem, kalman, options, active_set)
    P = None if fusion.P is None else table(fusion.P, "[m][r x r] to canonical coordinates")
    tables = Struct(
        "blw_lasso_model_t",
        name,
        {
            "jordan": jordan_struct(f"{name}_jordan", filters, fusion.filter_scale, model),
            "l1": l1.struct(f"{name}_l1", reduced_form, groups, fusion.F, gamma, engine),
            "P": P,
            "ambiguous": int(fusion.ambiguous),
        },
        method=name,
    )
    info = {**figures, **engine_figures, **filter_figures(filters)}
    info["scale"] = reduced_form.scale.tolist()
    info["unchecked_sensors"] = unchecked_sensors(reduced_form, model)
    N, d = reduced_form.Z.shape
    return Designed(tables, info, mem=(model.n, model.m, N, d, groups.count, int(P is not None)))


def steady_response(filters: LocalFilters) -> Array:
    """[r] where a local filter settles under a constant sample of 1."""
    return np.linalg.solve(np.eye(filters.r) - filters.form.J, filters.form.b)


def check_options(options: Any, model: Model, name: str) -> None:
    """Refuse options that contradict each other."""
    given = [key for key in GAMMA_KEYS if getattr(options, key) is not None]
    if len(given) > 1:
        raise ModelError(f"method.{name}: give {' or '.join(given)}, not both")


def spans(filters: LocalFilters, sensors: int) -> list[slice]:
    """Rows that share one scale: every Jordan block of every sensor."""
    return [
        slice(i * filters.r + block.rows.start, i * filters.r + block.rows.stop)
        for i in range(sensors)
        for block in filters.form.blocks
    ]


def unchecked_sensors(reduced_form: l1.Reduced, model: Model) -> list[str]:
    """Sensors with a local state that no other sensor can contradict."""
    r = reduced_form.scale.size // model.m
    return [model.sensors[i] for i in sorted({row // r for row in reduced_form.unchecked})]


def disturbed(fusion: Fusion, model: Model) -> float:
    """How far the disturbances within noise_margin move |l_g| / w_g, margin (2)."""
    form, groups, r = fusion.reduced, fusion.groups, fusion.response.shape[1]
    settled = np.zeros((form.scale.size, model.m))
    for i, answer in enumerate(fusion.response):
        settled[i * r : (i + 1) * r, i] = form.scale[i * r : (i + 1) * r] * answer
    M, bounds = form.S @ settled, margin.sigma(model)
    spans = zip(groups.first[:-1], groups.first[1:], strict=True)
    moved = np.array([margin.largest(M[first:last], bounds) for first, last in spans])
    return float(np.max(moved / l1.thresholds(form, groups, 1.0)))


def choose_gamma(
    fusion: Fusion, model: Model, trace_P: float, options: Any
) -> tuple[float, dict[str, Any]]:
    """gamma as given, from the wanted probability of returning exactly the Kalman estimate, also
    under the disturbances within noise_margin, or from the wanted loss without attack."""
    reduced_form, groups = fusion.reduced, fusion.groups
    samples = l1.recovery_statistic(reduced_form, groups)
    loss = BenignLoss(reduced_form, groups, fusion.F, trace_P)
    gamma = options.gamma
    if options.recovery_probability is not None:
        gamma = float(np.quantile(samples, options.recovery_probability) + disturbed(fusion, model))
    elif gamma is None:
        gamma = loss.gamma_for(options.benign_loss or DEFAULT_BENIGN_LOSS, samples[-1])
    figures = {
        "gamma": gamma,
        "benign_loss": loss(gamma),
        "recovery_probability": l1.probability(samples, gamma),
        "recovery_union_bound": l1.union_bound(reduced_form, groups, gamma),
        "gamma_for_recovery": {
            str(p): float(np.quantile(samples, p)) for p in (0.5, 0.9, 0.99)
        },
    }
    return gamma, figures


def choose_active_set(problem: admm_tuning.Problem, canonical: bool, cond_W: float) -> l1.Engine:
    """The active set for a problem: pivots on the tableau, or Newton steps on all groups at once
    where a local state may be a complex pair.

    In canonical coordinates few groups are ever attacked: there, pivots on Z are fewer and cheaper
    than Newton steps.
    """
    N = problem.reduced.Z.shape[0]
    paired = problem.groups.count < N
    if cond_W > COND_COARSE or (paired and canonical):
        return l1.Engine(l1.ACTIVE_SET, (PIVOTS_IF_PAIRED if paired else PIVOTS) * N)
    if not paired:
        return l1.Engine(l1.TABLEAU, PIVOTS * N)
    c = l1.thresholds(problem.reduced, problem.groups, problem.gamma)
    M = l1.smoothed(problem.reduced, problem.groups, c, NEWTON_KAPPA)
    return l1.Engine(l1.NEWTON, NEWTON_STEPS, NEWTON_KAPPA, M)


def choose_engine(
    problem: admm_tuning.Problem, kalman: Kalman, options: Any, active_set: l1.Engine
) -> tuple[l1.Engine, dict[str, Any]]:
    """Engine and its bound on work; only `admm` is tuned, and only on request."""
    N, d = problem.reduced.Z.shape
    if options.engine != "admm":
        bound = options.max_iterations or active_set.max_iterations
        return replace(active_set, max_iterations=bound), {
            "engine": "active_set",
            "max_iterations": bound,
        }
    sigma = np.sqrt(np.diag(kalman.P))
    tuned = admm_tuning.tune(problem, sigma, options.tolerance)
    bound = options.max_iterations or min(65535, tuned.iterations + SUPPORT_RESERVE * N)
    M = np.linalg.inv(problem.reduced.S + tuned.rho * np.eye(N))
    figures = {
        "engine": "admm",
        "max_iterations": bound,
        "admm_rho": tuned.rho,
        "admm_iterations_simulated": tuned.worst,
        "admm_converged": tuned.converged,
        "admm_advice": admm_tuning.advice(tuned, N, d),
    }
    return l1.Engine(l1.ADMM, bound, tuned.rho, (M + M.T) / 2.0), figures


def jordan_struct(suffix: str, filters: LocalFilters, scale: Array, model: Model) -> Struct:
    """Tables blw_jordan_model_t; scale [m r] is constant over every Jordan block of a sensor."""
    r, J = filters.r, filters.form.J
    m, l = model.m, model.l
    b, D = scale * np.tile(filters.form.b, m), scale[:, None] * filters.D

    def diagonal(offset: int) -> Array:
        band = np.zeros(r)
        entries = np.diag(J, offset)
        band[-offset if offset < 0 else 0 :][: entries.size] = entries
        return band

    return Struct(
        "blw_jordan_model_t",
        suffix,
        {
            "r": r,
            "m": m,
            "l": l,
            "J0": table(diagonal(0), "[r] diagonal of J"),
            "J1": table(diagonal(1), "[r] J(i, i+1)"),
            "J2": table(diagonal(2), "[r] J(i, i+2)"),
            "Jm": table(diagonal(-1), "[r] J(i, i-1)"),
            "b": table(b, f"[{m} {r}] input vectors"),
            "D": table(D, f"[{m} {r} x {l}] known inputs"),
            "G": table(scale[:, None] * filters.G, f"[{m} {r} x {model.n}] zeta = G x"),
            "step": straight.jordan_step(J, b, D),
        },
    )


def filter_figures(filters: LocalFilters) -> dict[str, Any]:
    """What a reader wants to know about the local filters."""
    return {
        "local_states": filters.r,
        "eigenvalues": [
            {
                "re": block.eigenvalue.real,
                "im": abs(block.eigenvalue.imag),
                "chain": block.length,
                "multiplicity": block.multiplicity,
            }
            for block in filters.form.blocks
        ],
        "cluster_tolerance": filters.form.tolerance,
        "derogatory": filters.form.derogatory,
        "cond_W": filters.cond_W,
    }
