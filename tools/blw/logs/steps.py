# SPDX-License-Identifier: MIT
"""A log on the model's grid of steps, and how samples of any rate get there.

Step k of a foreign log covers the times (t0 + (k-1) dt, t0 + k dt], t0 being its first time stamp;
row 0 is the initial state, which has no samples.
"""

import json
import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from operator import itemgetter
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from blw.errors import BulwarkError

Array = NDArray[np.float64]

#: A sample this part of a step late still belongs to it.
ROUNDING = 1e-9

#: Steps that one log may span: a wrong time stamp must not ask for all memory.
MOST_STEPS = 20_000_000


@dataclass(frozen=True)
class Names:
    """What the columns of a log are called."""

    sensors: list[str]
    inputs: list[str]
    states: list[str]
    dt_s: float

    @property
    def signals(self) -> list[str]:
        """Sensors, then inputs."""
        return self.sensors + self.inputs


@dataclass
class Steps:
    """Rows k = first, first + 1, ...: signals [T x m + l] and states [T x n]; NaN = not there.

    dropped counts frames that were not taken in, by reason.
    """

    names: Names
    first: int
    t_s: Array
    signals: Array
    states: Array | None = None
    dropped: dict[str, int] = field(default_factory=dict)

    def text(self) -> str:
        """The log as Bulwark's CSV; numbers read back exactly."""
        names, states = self.names, [] if self.states is None else self.names.states
        lines = [",".join(["k", "t_s", *names.signals, *(f"x:{name}" for name in states)])]
        inputs = held(self.signals[:, len(names.sensors):])
        cells = [self.signals[:, :len(names.sensors)], inputs]
        cells += [] if self.states is None else [self.states]
        for row, values in enumerate(np.hstack(cells).tolist()):
            shown = ["" if value != value else repr(value) for value in values]
            lines.append(",".join([str(self.first + row), repr(float(self.t_s[row])), *shown]))
        return "\n".join(lines) + "\n"


def names_of(design: Path) -> Names:
    """The names in a NAME.json of `design`.  Raises BulwarkError."""
    try:
        model = json.loads(design.read_text(encoding="utf-8"))["model"]
        return Names(model["sensors"], model["inputs"], model["states"], model["dt_s"])
    except (ValueError, KeyError, TypeError):
        raise BulwarkError(f"{design}: is no NAME.json of the design command") from None


def held(inputs: Array) -> Array:
    """[T x l] a missing input is the one before, or 0 where there was none yet."""
    found = inputs.copy()
    for row in range(len(found)):
        before = found[row - 1] if row > 0 else np.zeros(found.shape[1])
        found[row] = np.where(np.isnan(found[row]), before, found[row])
    return found


def on_grid(samples: Iterable[tuple[float, int, float]], names: Names, means: list[bool],
            where: str, start: float) -> Steps:
    """Samples (time in s, column, value) on the grid that starts at t0 = start.

    Of several samples in one step the last counts, or their mean for columns with means[column].
    Raises BulwarkError.
    """
    ordered = sorted(samples, key=itemgetter(0))
    times, columns, values = (np.array(part) for part in zip(*ordered, strict=True))
    span = (times[-1] - start) / names.dt_s
    if not span < MOST_STEPS:
        raise BulwarkError(f"{where}: spans {times[-1] - start:.6g} s, which is {span:.3g} steps "
                           f"of {names.dt_s:.6g} s; at most {MOST_STEPS} are supported")
    rows = np.maximum(np.ceil((times - start) / names.dt_s - ROUNDING).astype(int), 1)
    grid = np.full((int(rows[-1]) + 1, len(names.signals)), math.nan)
    grid[rows, columns] = values
    for column in np.flatnonzero(means):
        chosen = columns == column
        count = np.bincount(rows[chosen], minlength=len(grid))
        total = np.bincount(rows[chosen], weights=values[chosen], minlength=len(grid))
        grid[count > 0, column] = total[count > 0] / count[count > 0]
    return Steps(names, 0, names.dt_s * np.arange(len(grid)), grid)
