# SPDX-License-Identifier: MIT
"""Method `decentral`: one filter per sensor, chi-square test, search; tables of blw_decentral.h.

[D] with two corrections: the statistic has mu_J - n degrees of freedom, and an excluded sensor can
come back.  `variant = "printed"` keeps mu_J, the density in place of the survival probability, the
5 % of its section 5, and never readmits.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import comb
from typing import Any, Literal

import numpy as np

from blw import chi2, margin
from blw.decentral_filters import LocalFilters, local_filters, warm_up
from blw.decentral_fusion import (
    Fusion,
    Node,
    candidates,
    check_redundancy,
    cholesky,
    excluded_sets,
    fuse,
    removal_tree,
)
from blw.design import Designed
from blw.errors import DesignError
from blw.kalman import Kalman
from blw.model import Model
from blw.semidefinite import root
from blw.tables import Index, Link, Real, Struct, Table, index, table

NAME = "decentral"
GAPS = "weighted"

FALSE_ALARM = 1e-3
FALSE_ALARM_PRINTED = 0.05
READMIT = 20

#: Most sets of sensors that a search may compare.
_MAX_SETS = 20_000

#: A recursion in float32 needs the scaled factor of P to be this far from singular.
_SQUARE_ROOT_MIN = 3e-5

_INDEX_MAX = 65535


@dataclass(frozen=True)
class Options:
    """[method.decentral] of a model file."""

    #: probability of an alarm per step without attack; default 1e-3, printed: 0.05
    false_alarm: float | None = field(default=None, metadata={"gt": 0.0, "lt": 1.0})
    #: full-set passes in a row after which excluded sensors come back; 0: never
    readmit: int | None = field(default=None, metadata={"ge": 0, "le": 65535})
    #: restart the filter of an excluded sensor that tells the truth again
    reseed: bool = False
    gains: Literal["steady", "recursive"] = "steady"
    variant: Literal["corrected", "printed"] = "corrected"
    #: steps that a sensor may be missing before it is left out like an attacked one
    #: default: until three samples of the sensor that sends least should have come
    max_gap: int | None = field(default=None, metadata={"ge": 1, "le": 65535})
    #: limits of the device; one that is not given does not limit
    max_flash_bytes: int | None = field(default=None, metadata={"gt": 0})
    max_ram_bytes: int | None = field(default=None, metadata={"gt": 0})
    max_multiply_adds: int | None = field(default=None, metadata={"gt": 0})


def design(model: Model, kalman: Kalman, options: Options) -> Designed:
    """Tables and figures of `decentral` for one model.  Raises DesignError."""
    count = comb(len(model.units), model.p)
    if count > _MAX_SETS:
        raise DesignError(f"p = {model.p} of {len(model.units)} sensors or groups makes {count} "
                          f"sets to compare, at most {_MAX_SETS} are supported")
    _check_options(model, options)
    filters = local_filters(model)
    check_redundancy(model, filters)
    fusion = fuse(filters)
    sets, most_rows = excluded_sets(model, filters)
    tree = removal_tree(filters, fusion, sets)
    ranking = _Ranking(model, filters, tree, options, _disturbed(model, filters, fusion))
    P0 = kalman.P if model.P0 is None else model.P0
    steady = options.gains == "steady"
    engine = (_steady_struct(filters, fusion, tree, options.reseed, model.weight) if steady
              else _recursive_struct(model, filters, fusion, P0))
    mu = int(filters.first[-1])
    tables = Struct("blw_decentral_model_t", NAME, {
        "mu": mu,
        "rows": most_rows,
        "warm_up": warm_up(filters, fusion.N, P0) if steady else 0,
        "readmit": _readmit(options),
        "max_gap": model.silence if options.max_gap is None else options.max_gap,
        "reseed": int(options.reseed),
        "first": index(filters.first, "[m + 1] first row of every sensor, then mu"),
        "Phi": table(filters.Phi, "[mu x n] stacked bases Z_i'"),
        "scale": table(_innovation_scale(model, filters, fusion, ranking.false_alarm),
                       "[m] innovation to 1 at its threshold"),
        "sets": _sets_struct(model, tree),
        "ranking": ranking.struct(),
        "gains": Link(f"blw_decentral_{options.gains}_ops", options.gains),
        "steady": engine if steady else None,
        "recursive": None if steady else engine,
    }, method=NAME)
    mem = (model.n, model.m, mu, most_rows, 0 if steady else 1)
    footprint = _footprint(model, filters, tables, mem)
    _check_limits(footprint, options)
    info = _info(model, filters, tree, ranking, options)
    info |= {"warm_up": tables.members["warm_up"], "footprint": footprint}
    return Designed(tables, info, mem=mem)


def _check_options(model: Model, options: Options) -> None:
    """Refuse what a recursion cannot serve."""
    if options.gains == "recursive" and options.reseed:
        raise DesignError("reseed needs gains = \"steady\": a recursion would have to change P too")
    if options.gains == "recursive" and np.any(model.rate < 1.0):
        raise DesignError("plant.rate needs gains = \"steady\": a recursion would have to know the "
                          "rate at every step")


class _Ranking:
    """Thresholds by degrees of freedom, and the comparison of sets that differ in them."""

    def __init__(self, model: Model, filters: LocalFilters, tree: list[Node], options: Options,
                 delta: float):
        printed = options.variant == "printed"
        self.false_alarm = options.false_alarm or (FALSE_ALARM_PRINTED if printed else FALSE_ALARM)
        wanted = set(candidates(model))
        rows = {node.sensors: sum(int(filters.mu[i]) for i in node.sensors) for node in tree}
        ranked = sorted({rows[sensors] for sensors in wanted})
        others = sorted(set(rows.values()) - set(ranked))
        self.removed = ranked + others
        base = int(filters.first[-1]) - (0 if printed else model.n)
        self.dof = [base - gone for gone in self.removed]
        self.thr = [margin.chi2_threshold(self.false_alarm, max(dof, 1), delta)
                    for dof in self.dof]
        self.offsets = None
        if len(ranked) > 1:
            dofs = self.dof[:len(ranked)]
            self.offsets = chi2.offsets([chi2.density_offset(dof) if printed
                                         else chi2.survival_offset(dof, max(dofs))
                                         for dof in dofs], max(dofs))

    def struct(self) -> Struct:
        """blw_decentral_ranking_t."""
        knots = self.offsets.knots if self.offsets else []
        c = self.offsets.c if self.offsets else []
        return Struct("blw_decentral_ranking_t", f"{NAME}_ranking", {
            "n_dof": len(self.dof), "n_ranked": len(c), "n_knots": len(knots),
            "removed": index(self.removed, "[n_dof] rows left out"),
            "thr": table(self.thr, "[n_dof] thresholds of g"),
            "knots": table(knots, "[n_knots] of g"),
            "c": table(c, "[n_ranked x n_knots] the smallest g + c(g) is most plausible"),
        })

    def threshold_of(self, rows: int) -> tuple[int, float]:
        """Degrees of freedom and threshold of a set with so many rows left out."""
        place = self.removed.index(rows)
        return self.dof[place], self.thr[place]


def _disturbed(model: Model, filters: LocalFilters, fusion: Fusion) -> float:
    """How far the disturbances within noise_margin move w = N z, margin (2).  Without some of the
    sensors it is less, since w is then projected."""
    settled = np.zeros((len(filters.K), model.m))
    for i, F in enumerate(filters.F):
        rows = filters.rows(i)
        settled[rows, i] = np.linalg.solve(np.eye(len(F)) - F, filters.K[rows])
    return margin.largest(fusion.N @ settled, margin.sigma(model))


def _readmit(options: Options) -> int:
    if options.variant == "printed":
        return 0
    return READMIT if options.readmit is None else options.readmit


def _innovation_scale(model: Model, filters: LocalFilters, fusion: Fusion,
                      false_alarm: float) -> np.ndarray:
    """[m] 1 / (sigma_i sqrt(thr)): y_i - C_i (A x_hat + Bu u) has the deviation sigma_i."""
    P = fusion.Psi @ filters.P @ fusion.Psi.T
    S = model.C @ (model.A @ P @ model.A.T + model.W) @ model.C.T + model.sample_R
    bound = np.sqrt(np.diag(S) * chi2.threshold(false_alarm, 1)) + margin.sigma(model)
    return 1.0 / bound


def _sets_struct(model: Model, tree: list[Node]) -> Struct:
    place = {node.sensors: number for number, node in enumerate(tree)}
    wanted = [place[sensors] for sensors in candidates(model)]
    return Struct("blw_decentral_sets_t", f"{NAME}_sets", {
        "n_sets": len(tree), "n_candidates": len(wanted),
        "parent": index([node.parent for node in tree], "[n_sets] the set without its last sensor"),
        "sensor": index([node.sensors[-1] if node.sensors else 0 for node in tree],
                        "[n_sets] the last sensor"),
        "candidate": index(np.array(wanted, dtype=int), "[n_candidates] sets to compare"),
    })


def _steady_struct(filters: LocalFilters, fusion: Fusion, tree: list[Node], reseed: bool,
                   weight: np.ndarray) -> Struct:
    mu, first = int(filters.first[-1]), filters.first
    d = len(fusion.N)
    upper = [fusion.N[r, r:] for r in range(d)]
    Q = [fusion.Q[i][:fusion.rows(first, i)].T.ravel() for i in range(len(filters.S))]
    H = [np.linalg.inv(R).T[np.tril_indices(len(R))] for R in fusion.R] if reseed else [[]]
    M = [np.concatenate([np.append(X, T[:r + 1]) for r, (X, T) in enumerate(zip(node.X, node.T))])
         if len(node.sensors) > 1 else np.zeros(0) for node in tree]
    at = np.cumsum([0] + [len(part) for part in M])
    if at[-1] > _INDEX_MAX:
        raise DesignError(f"the removal tables of {len(tree)} sets have {at[-1]} numbers, at most "
                          f"{_INDEX_MAX} are supported; lower p or merge sensors into groups")
    return Struct("blw_decentral_steady_t", f"{NAME}_steady", {
        "d": d,
        "F": table(np.concatenate([F.ravel() for F in filters.F]), "[mu_i x mu_i] per sensor"),
        "K": table(filters.K * np.repeat(weight, filters.mu), "[mu] gains on samples"),
        "N": table(np.concatenate(upper), f"[{d} x {mu}] upper trapezoid, packed by rows"),
        "Psi": table(fusion.Psi, "[n x mu] x_hat = Psi z"),
        "Q": table(np.concatenate(Q), "[mu_i x min(first[i + 1], d)] per sensor, N_i = Q_i R_i"),
        "Y": table(np.hstack(fusion.Y).T, "[mu x n] stacked Y_i'"),
        "H": table(np.concatenate(H), "R_i^-1 transposed, packed lower, per sensor"),
        "at": index(at, "[n_sets + 1] where the part of a set in M begins"),
        "M": table(np.concatenate(M), "rows of [X T] to the diagonal of T, per set of two or more"),
    })


def _recursive_struct(model: Model, filters: LocalFilters, fusion: Fusion,
                      P0: np.ndarray) -> Struct:
    """The factors of a square-root recursion.  Raises DesignError if float32 cannot carry it."""
    L = cholesky(filters)
    smallest = float(np.min(np.abs(np.diag(L)) / np.sqrt(np.diag(filters.P))))
    if smallest < _SQUARE_ROOT_MIN:
        raise DesignError("recursive gains need a square root of P that float32 can invert, but "
                          f"its smallest relative pivot is {smallest:.2g} (at least "
                          f"{_SQUARE_ROOT_MIN:g}); use gains = \"steady\"")
    R = np.linalg.cholesky(model.R)
    return Struct("blw_decentral_recursive_t", f"{NAME}_recursive", {
        "S": table(np.concatenate([S.ravel() for S in filters.S]), "[mu_i x mu_i] per sensor"),
        "t": table(np.concatenate(filters.t), "[mu] y_i = t_i z_i"),
        "V": table(filters.Phi @ root(model.W), "[mu x n] V V' = Phi W Phi'"),
        "E": table(R[np.tril_indices(model.m)], "[m (m + 1) / 2] E E' = R, packed lower"),
        "L0": table(filters.Phi @ root(P0), "[mu x n] L0 L0' = Phi P0 Phi'"),
        "Psi": table(fusion.Psi, "[n x mu] steady-state fusion, for the first steps"),
    })


def _footprint(model: Model, filters: LocalFilters, tables: Struct,
               mem: tuple[int, ...]) -> dict[str, int]:
    """Bytes for float32 tables and memory, and multiply-adds of a step."""
    n, m, mu, rows, recursive = mem
    local = int(np.sum(filters.mu**2)) + mu + m * n + n * (n + model.l)
    count = tables.members["sets"].members["n_candidates"]
    if recursive:
        width = mu + n + m
        fit = mu * mu * n // 2 + 2 * mu * n * n
        typical = local + mu * (local // m) + mu * mu * width + fit + mu * n
        search = count * (mu * mu * rows // 2 + 2 * mu * (n + rows) ** 2)
    else:
        d = mu - n
        statistic = d * mu - d * (d - 1) // 2 + d
        typical = local + statistic + 2 * n * mu
        search = count * (statistic + d * rows + 2 * rows * rows)
    return {"flash_bytes": _flash(tables), "ram_bytes": 4 * _mem_len(*mem),
            "multiply_adds_typical": typical, "multiply_adds_worst": 2 * typical + search}


def _mem_len(n: int, m: int, mu: int, rows: int, recursive: int) -> int:
    """BLW_DECENTRAL_MEM."""
    work = mu * (mu + 1) // 2 + (mu + 1) * (mu + n + m) if recursive else mu - n + rows
    return 3 * n + 3 * m + 2 * mu + work


def _flash(struct: Struct) -> int:
    """Bytes of the tables of a struct: 4 a number, 2 an index."""
    total = 0
    for value in struct.members.values():
        if isinstance(value, Struct):
            total += _flash(value)
        elif isinstance(value, Table):
            total += 4 * value.array.size
        elif isinstance(value, Index):
            total += 2 * value.array.size
        elif isinstance(value, Real):
            total += 4
    return total


def _check_limits(footprint: dict[str, int], options: Options) -> None:
    limits = {"flash_bytes": options.max_flash_bytes, "ram_bytes": options.max_ram_bytes,
              "multiply_adds_worst": options.max_multiply_adds}
    for name, limit in limits.items():
        if limit is not None and footprint[name] > limit:
            figures = ", ".join(f"{key} {value}" for key, value in footprint.items())
            raise DesignError(f"needs {name} {footprint[name]}, more than the limit {limit} "
                              f"({figures})")


def _info(model: Model, filters: LocalFilters, tree: list[Node], ranking: _Ranking,
          options: Options) -> dict[str, Any]:
    """What a reader wants to know."""
    sets = []
    for node in tree:
        dof, thr = ranking.threshold_of(sum(int(filters.mu[i]) for i in node.sensors))
        sets.append({"excluded": [model.sensors[i] for i in node.sensors], "dof": dof,
                     "threshold": thr, "trace_P": node.trace_P})
    L = cholesky(filters)
    return {
        "mu": filters.mu.tolist(),
        "false_alarm": ranking.false_alarm,
        "readmit": _readmit(options),
        "variant": options.variant,
        "gains": options.gains,
        "trace_P": tree[0].trace_P,
        "spectral_radius": [float(np.abs(np.linalg.eigvals(F)).max()) for F in filters.F],
        "cond_P": float(np.linalg.cond(L) ** 2),
        "knots": 0 if ranking.offsets is None else len(ranking.offsets.knots),
        "sets": sets,
    }
