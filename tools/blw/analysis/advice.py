# SPDX-License-Identifier: MIT
"""The smallest changes that make a model 2p-sparse observable: sensors to add, or to protect.

Without that no estimator survives p lying units; with it `canonical`, `guard` and the methods that
search over sets do.  A sensor to add is a copy of one that is there or sees one state alone.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, combinations_with_replacement

import numpy as np

from blw.analysis.observability import sparse_index
from blw.model import Model
from blw.modes import Modes

#: Index computations for one kind of change.
TRIALS = 20_000

#: Alternatives that are told.
SHOWN = 6


@dataclass(frozen=True)
class Change:
    """`add` or `protect`, the smallest number, and the choices of that size (at most SHOWN)."""

    kind: str
    count: int
    choices: list[list[str]]

    def text(self) -> str:
        """One sentence."""
        verb = {"add": "add", "protect": "protect (and name as strong)"}[self.kind]
        noun = "sensor" if self.count == 1 else "sensors"
        choices = " or ".join(", ".join(choice) for choice in self.choices)
        return f"{verb} {self.count} {noun}: {choices}"


def advise(model: Model, modes: Modes, progress: Callable[[str], None]) -> list[Change]:
    """The smallest additions and the smallest protections, where a search finds them."""
    found = [_smallest("add", _additions(model, modes), progress),
             _smallest("protect", _protections(model, modes), progress)]
    return [change for change in found if change is not None]


Trial = tuple[list[str], bool]


def _smallest(kind: str, trials: Iterator[Trial],
              progress: Callable[[str], None]) -> Change | None:
    """The first successful choices of one size, among TRIALS in order of size."""
    choices: list[list[str]] = []
    for number, (choice, enough) in enumerate(trials):
        if number >= TRIALS or (choices and len(choice) > len(choices[0])):
            break
        if number % 50 == 0:
            progress(f"sensors to {kind}: {len(choice)} at a time, choice {number + 1}")
        if enough and len(choices) < SHOWN:
            choices.append(choice)
    return Change(kind, len(choices[0]), choices) if choices else None


def _additions(model: Model, modes: Modes) -> Iterator[Trial]:
    """Ever larger choices of new sensors, each a unit of its own."""
    labels, rows = _candidates(model, modes)
    for size in range(1, 2 * model.p + 2):
        for chosen in combinations_with_replacement(range(len(rows)), size):
            C = np.vstack([model.C, rows[list(chosen)]])
            units = model.units + [[model.m + k] for k in range(size)]
            index = sparse_index(Modes(modes.form, modes.A, C).modes, units)
            yield [labels[k] for k in chosen], index.lower >= 2 * model.p


def _candidates(model: Model, modes: Modes) -> tuple[list[str], np.ndarray]:
    """Sensors that help with the weakest modes: copies first, then single states; of those that
    see the same modes only the first."""
    labels = [f"another {name}" for name in model.sensors]
    labels += [f"one for {name}" for name in model.states]
    rows = np.vstack([model.C, np.eye(model.n)])
    seen = np.array([Modes(modes.form, modes.A, rows).modes[k].seen
                     for k in range(len(modes.modes))]).T
    if any(mode.dimension > 1 for mode in modes.modes):
        return labels, rows
    _, first = np.unique(seen, axis=0, return_index=True)
    kept = [k for k in np.sort(first) if not _dominated(seen, k)]
    return [labels[k] for k in kept], rows[kept]


def _dominated(seen: np.ndarray, k: int) -> bool:
    """Another candidate sees all that k sees and more."""
    return bool(np.any(np.all(seen >= seen[k], axis=1) & np.any(seen > seen[k], axis=1)))


def _protections(model: Model, modes: Modes) -> Iterator[Trial]:
    """Ever larger sets of present sensors that an attacker cannot reach."""
    for size in range(1, model.m + 1):
        for chosen in combinations(range(model.m), size):
            yield [model.sensors[i] for i in chosen], _survives(model, modes, chosen)


def _survives(model: Model, modes: Modes, protected: Sequence[int]) -> bool:
    index = sparse_index(modes.modes, model.units, protected)
    left = sum(1 for unit in model.units if not set(unit) <= set(protected))
    return index.lower >= min(2 * model.p, left)
