# SPDX-License-Identifier: MIT
"""What every method promises for one model and p attacked units (a sensor, or a group of them).

`ratio` is [L] Theorem 4 / [N] Theorem 1 where a method has such a condition: a sensor's entry is
the largest ratio over the sets of p units that contain it.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations, islice
from math import comb
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blw import canonical, gaps, l1, options
from blw.analysis.l1_ratio import UNBOUNDED, ZERO, Ratio, RatioProblem
from blw.analysis.observability import Index, sparse_index
from blw.kalman import Kalman, mode_text
from blw.local_filters import local_filters
from blw.model import Model
from blw.modes import Modes

Array = NDArray[np.float64]
Progress = Callable[[str], None]

#: Linear programs for one method.
PROGRAMS = 4000


@dataclass(frozen=True)
class Verdict:
    """Whether p attacked units can move a method's estimate by a bounded amount only."""

    secure: bool
    reason: str
    ratio: list[Ratio] = field(default_factory=list)  #: per sensor; empty: no such condition

    def to_json(self, sensors: int) -> dict[str, Any]:
        """`ratio` is null where it is unbounded or does not exist."""
        shown = self.ratio or [UNBOUNDED] * sensors
        result = {"secure": self.secure, "ratio": [_finite(item.lower) for item in shown],
                  "reason": self.reason}
        if not all(item.exact for item in self.ratio):
            result["ratio_upper"] = [_finite(item.upper) for item in shown]
        return result


@dataclass(frozen=True, eq=False)
class Case:
    """A model with what all verdicts about it need."""

    model: Model
    kalman: Kalman
    modes: Modes
    index: Index  #: over units
    progress: Progress = lambda text: None
    refused: Mapping[str, str] = field(default_factory=dict)  #: method -> why it has no design

    @property
    def p(self) -> int:
        return self.model.p

    @property
    def sparse(self) -> bool:
        """2p-sparse observable."""
        return self.index.lower >= 2 * self.p


def verdicts(case: Case, names: Iterable[str]) -> dict[str, Verdict]:
    """Verdict of every named method that this module knows.  Raises DesignError if a method has no
    design and `case` does not say so."""
    known = {"kalman": _kalman, "lasso": _lasso, "canonical": _canonical, "joint": _joint,
             "decentral": _by_search, "bank": _by_search, "guard": _guard}
    return {name: known[name](case) if name not in case.refused
            else Verdict(False, f"refused: {case.refused[name]}")
            for name in names if name in known}


def _kalman(case: Case) -> Verdict:
    if case.p == 0:
        return Verdict(True, "no sensor is attacked (p = 0)")
    return Verdict(False, "it has no defence: one lying sensor moves the estimate without limit")


def _lasso(case: Case) -> Verdict:
    if case.p == 0:
        return Verdict(True, "no sensor is attacked (p = 0)", [ZERO] * case.model.m)
    filters = local_filters(*gaps.cautious(case.model, case.kalman))
    m, r = case.model.m, filters.r
    groups = l1.sensor_groups(filters.form.groups(), m, r)
    rows = [weight * filters.G[first:last]
            for first, last, weight in zip(groups.first, groups.first[1:], groups.weight)]
    per_sensor = len(rows) // m
    found = _search_sets(case, [rows[i * per_sensor : (i + 1) * per_sensor] for i in range(m)])
    return _judged(found, case, "[L] Theorem 4")


def _search_sets(case: Case, rows: Sequence[Sequence[Array]]) -> list[Ratio]:
    """Per sensor the ratio over all sets of p units, or bounds of it."""
    units, p = case.model.units, case.p
    found = [ZERO] * case.model.m
    total = comb(len(units), p)
    tried = min(total, PROGRAMS // 8)
    limit = max(8, PROGRAMS // tried)
    for number, chosen in enumerate(islice(combinations(units, p), tried)):
        case.progress(f"lasso: set {number + 1} of {total}")
        inside = [i for unit in chosen for i in unit]
        outside = [i for i in range(case.model.m) if i not in inside]
        if _blind(case, inside):
            ratio = UNBOUNDED
        else:
            ratio = RatioProblem([g for i in inside for g in rows[i]],
                                 [g for i in outside for g in rows[i]]).solve(limit)
        for i in inside:
            found[i] = found[i] | ratio
    if tried < total:
        found = [Ratio(ratio.lower, np.inf) for ratio in found]
    return found


def _blind(case: Case, lost: Sequence[int]) -> bool:
    """Whether some mode is seen by none of the sensors that are left."""
    rest = [i for i in range(case.model.m) if i not in lost]
    return sparse_index(case.modes.modes, [rest]).lower < 0


def _canonical(case: Case) -> Verdict:
    given = options.parse(canonical.Options, case.model.methods.get(canonical.NAME, {}),
                          f"{case.model.path or case.model.name}: method.{canonical.NAME}")
    weights = canonical.sensor_weights(case.model, given)
    return _judged(mode_ratios(case.modes.observed, weights, case.model.units, case.p), case,
                   "[N] Theorem 4")


def mode_ratios(observed: Array, weights: Array, units: Sequence[Sequence[int]],
                p: int) -> list[Ratio]:
    """Per sensor the ratio of the canonical form: the worst over its coordinates.

    observed [m x n], weights [m].  H is diagonal, so a set of units has in each coordinate the
    weight of its sensors that observe it, and the worst set with a unit adds the p - 1 heaviest.
    """
    found = np.zeros(len(weights))
    heavy = np.array([[weights[unit] @ observed[unit, j] for unit in map(list, units)]
                      for j in range(observed.shape[1])])
    for per_unit in np.unique(heavy, axis=0):
        for number, unit in enumerate(units):
            others = np.sort(np.delete(per_unit, number))[::-1]
            taken = (per_unit[number] + others[: p - 1].sum()) if p > 0 else 0.0
            rest = per_unit.sum() - taken
            ratio = taken / rest if rest > 1e-12 else (np.inf if taken > 0.0 else 0.0)
            found[list(unit)] = np.maximum(found[list(unit)], ratio)
    return [Ratio(ratio, ratio) for ratio in found.tolist()]


def _judged(found: list[Ratio], case: Case, theorem: str) -> Verdict:
    """Verdict from the ratios of all sensors."""
    names = case.model.sensors
    if all(ratio.secure for ratio in found):
        worst = max(ratio.upper for ratio in found)
        bound = "the largest ratio is" if all(r.exact for r in found) else "the ratios are at most"
        return Verdict(True, f"{theorem} holds: {bound} {worst:.4g} < 1", found)
    broken = [f"{name} ({_shown(ratio.lower)})" for name, ratio in zip(names, found)
              if ratio.lower >= 1.0 - 1e-9]
    if broken:
        return Verdict(False, f"{theorem} fails for an attack on " + ", ".join(broken), found)
    open_ = [name for name, ratio in zip(names, found) if ratio.undecided]
    return Verdict(False, f"{theorem} could not be decided for " + ", ".join(open_), found)


def _by_search(case: Case) -> Verdict:
    if case.sparse:
        return Verdict(True, f"{2 * case.p}-sparse observable (index {case.index.lower}): the"
                             " honest sensors single out one state")
    return Verdict(False, _too_few(case))


def _guard(case: Case) -> Verdict:
    """Penalty per sensor: for p = 1 the triangle inequality gives the condition for every A."""
    lasting = sparse_index((mode for mode in case.modes.modes if mode.persists), case.model.units)
    if lasting.lower < 2 * case.p:
        return Verdict(False, _too_few(case))
    how = "by its penalty" if case.p <= 1 else "by its search over sets"
    return Verdict(True, f"{how}: every mode that does not die out is seen by more than"
                         f" {2 * case.p} units")


def _joint(case: Case) -> Verdict:
    strong = [case.model.sensors.index(name) for name in case.model.strong]
    if not strong:
        return Verdict(False, "no sensor is named as strong")
    lasting = [mode for mode in case.modes.modes if mode.persists]
    if sparse_index(lasting, [strong]).lower < 0:
        return Verdict(False, "the strong sensors alone do not see every mode that lasts")
    return Verdict(True, "as long as the strong sensors are honest, which nothing in the method"
                         " checks; they see every mode that lasts")


def _too_few(case: Case) -> str:
    weakest = case.index.weakest
    mode = f"the mode {mode_text(weakest)} is" if weakest is not None else "its modes are"
    return (f"{2 * case.p}-sparse observability is needed, the index is {case.index.lower}: {mode}"
            " seen by too few")


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _shown(value: float) -> str:
    return f"{value:.4g}" if np.isfinite(value) else "without limit"
