# SPDX-License-Identifier: MIT
"""Method `joint` [J]: state and attack signal from weak sensors paired with strong ones, tables of
blw_joint.h (docs/joint.md)."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from blw import joint_analysis as analysis
from blw import names
from blw.design import Designed
from blw.errors import DesignError, ModelError
from blw.joint_analysis import Step
from blw.joint_recursion import Pair, deviations
from blw.kalman import UNIT_CIRCLE, Kalman, mode_text, unobservable_modes
from blw.model import Model
from blw.semidefinite import root
from blw.tables import Struct, index, table

Array = NDArray[np.float64]

NAME = "joint"
GAPS = "ignored"

DEFAULT_ETA = 10.0   # times the variance of the weak sensor's noise
DECAYED = 1.05       # the initial error has decayed: variance over its limit
MAX_STEPS = 65535


@dataclass(frozen=True)
class Options:
    """[method.joint] of a model file."""

    #: variance of the attack that is designed for, per pair or for all
    eta: float | list[float] | None = field(default=None, metadata={"gt": 0.0})
    #: standard deviation of an attack, from which eta is chosen if it is not given
    attack_size: float | None = field(default=None, metadata={"gt": 0.0})
    #: a weak sensor and the strong ones that help it; default: every weak one with all strong ones
    pairs: list[tuple[str, list[str]]] | None = None
    gains: Literal["schedule", "recursive"] = "schedule"
    variant: Literal["corrected", "printed"] = "corrected"
    #: relative error of gains at which the schedule ends
    tolerance: float = field(default=1e-9, metadata={"ge": 1e-12, "lt": 1.0})
    max_schedule: int = field(default=100, metadata={"ge": 1, "le": MAX_STEPS})
    #: probability of statistic > threshold in a step without attack, at most
    false_alarm: float = field(default=1e-3, metadata={"gt": 0.0, "lt": 1.0})


def design(model: Model, kalman: Kalman, options: Options) -> Designed:
    """Tables and figures of `joint` for one model.  Raises ModelError, DesignError."""
    pairs, strong = resolve_pairs(model, options)
    P0 = kalman.P if model.P0 is None else model.P0
    printed = options.variant == "printed"
    heard = [pair.among(strong) for pair in pairs]
    eta, figures = choose_eta(model, heard, P0, options)
    steps = analysis.transient(model, heard, P0, eta, printed)
    zero = np.zeros(len(pairs))
    benign = analysis.performance(model, heard, steps[-1], zero)
    scale = -1 / (ndtri(options.false_alarm / len(pairs) / 2) * np.sqrt(benign.theta))
    recursive = options.gains == "recursive"
    length, left = schedule_length(model, heard, steps, options)
    members = {
        "r": len(pairs),
        "warm_up": warm_up(steps),
        **sensor_tables(model, pairs, strong),
        "scale": table(scale, "[r] theta to 1 at its threshold"),
        "schedule": None if recursive else schedule_struct(model, steps, length),
        "recursive": recursive_struct(model, P0, eta) if recursive else None,
    }
    info = {**figures, **describe(model, heard, eta, steps, benign)}
    info["pairs"] = [[model.sensors[pair.weak], [model.sensors[j] for j in pair.strong]]
                     for pair in pairs]
    info |= {"gains": options.gains, "variant": options.variant, "threshold": (1 / scale).tolist()}
    if not recursive:
        info |= {"schedule_steps": length, "schedule_error": left}
    return Designed(Struct("blw_joint_model_t", NAME, members, method=NAME), info,
                    mem=(model.n, model.m, len(pairs), int(recursive)))


def resolve_pairs(model: Model, options: Options) -> tuple[list[Pair], list[int]]:
    """The pairs, and the sensors that are strong until the caller says otherwise, as indices."""
    pairs = named_pairs(model, options.pairs) if options.pairs else default_pairs(model)
    partners = sorted({sensor for pair in pairs for sensor in pair.strong})
    strong = sorted(model.sensors.index(name) for name in model.strong) or partners
    if options.gains == "schedule":
        for sensor in partners:
            if sensor not in strong:
                raise ModelError(f"method.joint.pairs: '{model.sensors[sensor]}' is not strong; "
                                 "partners that a detector clears need gains = \"recursive\"")
    elif options.variant == "printed":
        raise ModelError("method.joint: variant = \"printed\" needs gains = \"schedule\"; its "
                         "covariances need not be positive definite, so the device cannot run it")
    for pair in pairs:
        check_detectable(model, pair, strong)
    return pairs, strong


def named_pairs(model: Model, given: list[tuple[str, list[str]]]) -> list[Pair]:
    """The pairs of the model file as indices."""
    pairs: list[Pair] = []
    for number, (weak, partners) in enumerate(given, start=1):
        where = f"method.joint.pairs, pair {number},"
        names.check_known([weak, *partners], model.sensors, where)
        if not partners:
            raise ModelError(f"{where} has no strong sensor")
        if weak in model.strong:
            raise ModelError(f"{where} has the strong sensor '{weak}' in the weak one's place")
        if any(model.sensors[pair.weak] == weak for pair in pairs):
            raise ModelError(f"{where} repeats the weak sensor '{weak}'")
        pairs.append(Pair(model.sensors.index(weak),
                          tuple(model.sensors.index(name) for name in partners)))
    return pairs


def default_pairs(model: Model) -> list[Pair]:
    """Every weak sensor with all strong ones."""
    strong = tuple(i for i, name in enumerate(model.sensors) if name in model.strong)
    if not strong:
        raise DesignError("no sensor is known to be strong; name some in attack.strong, or give "
                          "method.joint.pairs")
    if len(strong) == model.m:
        raise DesignError("every sensor is strong: there is no attack to estimate")
    return [Pair(i, strong) for i in range(model.m) if i not in strong]


def check_detectable(model: Model, pair: Pair, strong: Sequence[int]) -> None:
    """Refuse a pair whose estimator diverges."""
    rows = [sensor for sensor in pair.sensors if sensor == pair.weak or sensor in strong]
    for z in unobservable_modes(model.A, model.C[rows]):
        if abs(z) >= 1 - UNIT_CIRCLE:
            listed = ", ".join(model.sensors[sensor] for sensor in rows)
            raise DesignError(f"the sensors {listed} do not see the mode {mode_text(z)}: no "
                              "estimator can be built on them")


def choose_eta(model: Model, pairs: list[Pair], P0: Array,
               options: Options) -> tuple[Array, dict[str, Any]]:
    """eta [r] as given, or by a sweep for an attack of the given size, or from the noise."""
    printed = options.variant == "printed"
    if isinstance(options.eta, list) and len(options.eta) != len(pairs):
        raise ModelError(f"method.joint.eta has {len(options.eta)} entries, but there are "
                         f"{len(pairs)} pairs")
    if options.eta is not None:
        eta = np.broadcast_to(np.asarray(options.eta, dtype=float), len(pairs)).copy()
        return eta, {"eta": eta.tolist(), "eta_from": "given"}
    if options.attack_size is None:
        eta = DEFAULT_ETA * np.array([model.R[pair.weak, pair.weak] for pair in pairs])
        return eta, {"eta": eta.tolist(), "eta_from": "noise"}
    etas = analysis.decades(model, pairs, options.attack_size)
    rows = analysis.sweep(model, pairs, P0, etas, options.attack_size, printed)
    best = min(rows, key=lambda row: row["state_white"])["eta"]
    eta = np.full(len(pairs), best)
    return eta, {"eta": eta.tolist(), "eta_from": "sweep", "sweep": rows}


def schedule_length(model: Model, pairs: list[Pair], steps: list[Step],
                    options: Options) -> tuple[int, float]:
    """Entries of the schedule, and the largest relative error of gains where it is cut."""
    unit = deviations(steps[-1].fused)
    limit = steps[-1].flat(model, pairs, unit)
    size = np.abs(limit).max()
    errors = [float(np.abs(step.flat(model, pairs, unit) - limit).max() / size) for step in steps]
    length = 1 + max((k + 1 for k, error in enumerate(errors) if error > options.tolerance),
                     default=0)
    length = min(length, options.max_schedule)
    return length, max(errors[length - 1:])


def warm_up(steps: list[Step]) -> int:
    """Steps until the variances of all states have come to their limits."""
    limit = steps[-1].fused
    late = [k for k, step in enumerate(steps, start=1)
            if (np.maximum(step.fused, limit) > DECAYED * np.minimum(step.fused, limit)).any()]
    return min(max(late, default=0), MAX_STEPS)


def sensor_tables(model: Model, pairs: list[Pair], strong: list[int]) -> dict[str, Any]:
    """The index tables."""
    counts = [len(pair.sensors) for pair in pairs]
    listed = [sensor for pair in pairs for sensor in pair.sensors]
    return {
        "first": index(np.cumsum([0, *counts]), "[r + 1] where the sensors of each begin"),
        "sensor": index(listed, "weak sensor and partners of each estimator"),
        "strong": index([int(i in strong) for i in range(model.m)], "[m] 1 for a strong sensor"),
    }


def schedule_struct(model: Model, steps: list[Step], length: int) -> Struct:
    """blw_joint_schedule_t; the last entry is the steady state."""
    n, r = model.n, steps[-1].theta.size
    entries = [*steps[:length - 1], steps[-1]]
    gains = [np.vstack([K, Gamma]).ravel() for step in entries
             for K, Gamma in zip(step.gains.K, step.gains.Gamma, strict=True)]
    weights = [step.G[i * n:(i + 1) * n].T for step in entries for i in range(1, r)]
    return Struct("blw_joint_schedule_t", "schedule", {
        "steps": length,
        "K": table(np.concatenate(gains), f"[{length}] per estimator [{n + 2} x m_i]"),
        "G": table(np.array(weights), f"[{length}][{r - 1}][{n} x {n}]"),
        "sd": table(np.sqrt([step.theta for step in entries]), f"[{length} x {r}]"),
        "sd_gap": table(np.sqrt(steps[-1].gap), "[r] if the sample is missing"),
    })


def recursive_struct(model: Model, P0: Array, eta: Array) -> Struct:
    """blw_joint_recursive_t."""
    lower = np.tril_indices(model.n)
    return Struct("blw_joint_recursive_t", "recursive", {
        "V": table(lower_root(model.W), "[n x n] V V' = B Q B'"),
        "E": table(np.linalg.cholesky(model.R)[np.tril_indices(model.m)], "E E' = R, packed"),
        "L0": table(lower_root(P0)[lower], "L0 L0' = P0, packed"),
        "theta_sd": table(np.sqrt(eta), "[r] square roots of eta"),
    })


def lower_root(S: Array) -> Array:
    """[n, n] lower triangular L with L L' = S, S positive semidefinite."""
    L = np.linalg.qr(root(S).T)[1].T
    return np.tril(L * np.where(np.diag(L) < 0, -1.0, 1.0))


def describe(model: Model, pairs: list[Pair], eta: Array, steps: list[Step],
             benign: analysis.Performance) -> dict[str, Any]:
    """What a reader wants to know.  pairs: with the partners that are strong at the start."""
    own = analysis.performance(model, pairs, steps[-1], eta)
    unit = [analysis.performance(model, pairs, steps[-1], row) for row in np.eye(len(pairs))]
    helpers = sorted({sensor for pair in pairs for sensor in pair.strong})
    alone = analysis.strong_filter(model, helpers)
    central = analysis.central_filter(model, pairs, eta)
    listed = [model.sensors[sensor] for sensor in helpers]
    return {
        "trace_P_local": own.local.tolist(),
        "trace_P": own.fused,
        "trace_P_no_attack": benign.fused,
        "trace_P_strong_kalman": alone,
        "trace_P_central_kalman": central,
        "mse_per_attack_variance": [p.fused - benign.fused for p in unit],
        "theta_sd": np.sqrt(own.theta).tolist(),
        "theta_sd_no_attack": np.sqrt(benign.theta).tolist(),
        "unseen_by_partners": unseen_by_partners(model, pairs),
        "verdict": analysis.verdict(listed, own.fused, alone, central),
    }


def unseen_by_partners(model: Model, pairs: list[Pair]) -> dict[str, list[str]]:
    """Modes that only the weak sensor of a pair sees: an attack can imitate them."""
    found = {}
    for pair in pairs:
        unseen = [mode_text(z) for z in unobservable_modes(model.A, model.C[list(pair.strong)])
                  if abs(z) >= 1 - UNIT_CIRCLE]
        if unseen:
            found[model.sensors[pair.weak]] = unseen
    return found
