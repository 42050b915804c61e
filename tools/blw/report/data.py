# SPDX-License-Identifier: MIT
"""What `run` and `replay` left in a folder, read and checked, aligned to the steps of log.csv."""
from __future__ import annotations

import json
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blw.errors import BulwarkError
from blw.report.csv_file import CsvFile
from blw.report.series import Array, runs

METHODS = (
    "oracle", "kalman", "lasso", "canonical", "joint", "decentral", "bank", "guard"
)
"""The order in which methods appear everywhere; others follow by name."""

TRACK_HEAD = ["k", "t_s", "status"]
TRACK_MIDDLE = ["statistic", "threshold", "iterations", "bound", "excluded"]
SUSPICION = "suspicion:"
ATTACK_BRIDGE = 2
"""An attack signal that is exactly 0 for this many steps has not ended."""


@dataclass(frozen=True)
class Track:
    """Output of one method over the T steps of the log; NaN, "" and False where it has no row."""

    name: str
    status: NDArray[np.str_]  # [T]
    x_hat: Array  # [T, n], units of the states
    statistic: Array  # [T]
    threshold: Array  # [T], 0 if the method has no test
    iterations: Array  # [T]
    bound: Array  # [T]
    excluded: NDArray[np.bool_]  # [T, m]
    suspicion: Array  # [T, m], 0 .. 1
    extra: dict[str, Array] = field(default_factory=dict)  # further columns by name, [T] each

    @property
    def present(self) -> NDArray[np.bool_]:
        """[T] steps for which the method gave an estimate."""
        return self.status != ""

    @property
    def alarm(self) -> NDArray[np.bool_]:
        """[T] steps whose statistic failed its test; a NaN statistic fails."""
        return self.present & self.tested & ~(self.statistic <= self.threshold)

    @property
    def tested(self) -> NDArray[np.bool_]:
        """[T] steps in which the method tested anything."""
        return self.threshold > 0.0


@dataclass(frozen=True)
class Recording:
    """One run or replay: T steps, n states, m sensors, l inputs."""

    directory: Path
    k: NDArray[np.int64]  # [T]
    t_s: Array  # [T]
    states: list[str]
    sensors: list[str]
    inputs: list[str]
    y: Array  # [T, m], NaN = missing
    u: Array  # [T, l]
    x: Array | None  # [T, n] true states, None in a replay
    a: Array | None  # [T, m] injected attack, 0 = none; None if unknown
    tracks: dict[str, Track]
    summary: dict[str, Any]
    windows: list[tuple[int, int, list[str]]]  # attacked rows [start, stop), sensors

    @cached_property
    def attacked(self) -> NDArray[np.bool_]:
        """[T, m] true where a sensor is under attack.

        Within a window of the summary that names the sensor: from the first to the last step at
        which its signal was changed, or the whole window if it never was (samples withheld).
        """
        flags = np.zeros(self.y.shape, dtype=bool)
        if self.a is not None:
            for i, signal in enumerate(self.a.T):
                for start, stop in runs(np.abs(signal) > 0.0, ATTACK_BRIDGE):
                    flags[start:stop, i] = True
        for start, stop, names in self.windows:
            for i in (self.sensors.index(name) for name in names):
                changed = start + np.flatnonzero(flags[start:stop, i])
                first, last = (changed[0], changed[-1] + 1) if len(changed) > 0 else (start, stop)
                flags[first:last, i] = True
        return flags

    @cached_property
    def episodes(self) -> list[tuple[int, int]]:
        """Row intervals [start, stop) in which any sensor is under attack."""
        if self.windows:
            return [(start, stop) for start, stop, _ in self.windows]
        return runs(self.attacked.any(axis=1))

    @property
    def targets(self) -> list[list[str]]:
        """The sensors that are attacked in each episode."""
        hits = [self.attacked[start:stop].any(axis=0) for start, stop in self.episodes]
        return [[s for s, flag in zip(self.sensors, hit) if flag] for hit in hits]

    @property
    def runs(self) -> int:
        """Runs that the summary covers; the CSV files hold the first."""
        return int(self.summary.get("runs", 1))

    @property
    def yardstick(self) -> str | None:
        """What errors are read against: "truth", "oracle" if no truth is known, or nothing."""
        if self.x is not None:
            return "truth"
        return "oracle" if "oracle" in self.tracks else None

    @property
    def base(self) -> Array | None:
        """[T, n] the states that errors are read against."""
        return self.tracks["oracle"].x_hat if self.yardstick == "oracle" else self.x

    def error(self, name: str) -> Array | None:
        """[T, n] estimate minus base; None without a base, and for the base itself."""
        if self.base is None or name == self.yardstick:
            return None
        return self.tracks[name].x_hat - self.base

    def compared(self) -> list[str]:
        """Methods for which error() is not None, in order."""
        return [name for name in self.tracks if self.error(name) is not None]


def load(directory: Path) -> Recording:
    """Read log.csv, summary.json and every method's CSV.

    Raises BulwarkError naming file, line and column if one is missing, broken or does not fit.
    """
    if not directory.is_dir():
        raise BulwarkError(f"{directory}: no such folder")
    log = CsvFile.read(directory / "log.csv")
    paths = _track_paths(directory)
    if not paths:
        raise BulwarkError(f"{directory}: no method's output (<method>.csv) beside log.csv")
    states, sensors = _layout(CsvFile.read(paths[0]))
    known = {"k", "t_s", *sensors}
    inputs = [c for c in log.header if c not in known and ":" not in c]
    summary = _summary(directory / "summary.json")
    rows = {k: row for row, k in enumerate(log.integers("k").tolist())}
    a = _optional(log, "a:", sensors, 0.0)
    return Recording(
        directory=directory,
        k=log.integers("k"),
        t_s=log.times("t_s"),
        states=states,
        sensors=sensors,
        inputs=inputs,
        y=log.numbers(sensors),
        u=log.numbers(inputs),
        x=_optional(log, "x:", states, np.nan),
        a=None if a is None else np.nan_to_num(a),
        tracks={path.stem: _track(CsvFile.read(path), states, sensors, rows) for path in paths},
        summary=summary,
        windows=_windows(directory / "summary.json", summary, rows, sensors),
    )


def _track_paths(directory: Path) -> list[Path]:
    """The CSV files of methods, in the order of METHODS; foreign CSV files are left alone."""
    found = {}
    for path in sorted(directory.glob("*.csv")):
        if path.stem in METHODS or (path.stem != "log" and _looks_like_track(path)):
            found[path.stem] = path
    ranked = sorted(found, key=lambda s: (METHODS.index(s) if s in METHODS else len(METHODS), s))
    return [found[stem] for stem in ranked]


def _looks_like_track(path: Path) -> bool:
    with path.open(encoding="utf-8", errors="replace") as file:
        return file.readline().startswith(",".join(TRACK_HEAD) + ",")


def _layout(table: CsvFile) -> tuple[list[str], list[str]]:
    """States and sensors that the header of a method's CSV names."""
    head = len(TRACK_HEAD)
    if table.header[:head] != TRACK_HEAD or not set(TRACK_MIDDLE) <= set(table.header):
        wanted = ",".join([*TRACK_HEAD, "<states>", *TRACK_MIDDLE, SUSPICION + "<sensor>..."])
        raise BulwarkError(f"{table.path}:1: the header is not {wanted}")
    states = table.header[head : table.header.index(TRACK_MIDDLE[0])]
    sensors = [c[len(SUSPICION) :] for c in table.header if c.startswith(SUSPICION)]
    return states, sensors


def _optional(log: CsvFile, prefix: str, names: list[str], absent: float) -> Array | None:
    """[T, len(names)] from the columns prefix + name, `absent` for one that is not there; None if
    there is not even one."""
    if not any(column.startswith(prefix) for column in log.header):
        return None
    out = np.full((len(log.rows), len(names)), absent)
    for i, name in enumerate(names):
        if prefix + name in log.header:
            out[:, i] = log.numbers([prefix + name])[:, 0]
    return out


def _track(table: CsvFile, states: list[str], sensors: list[str], rows: dict[int, int]) -> Track:
    if _layout(table) != (states, sensors):
        raise BulwarkError(f"{table.path}:1: states and sensors differ from those of the others")
    steps = table.integers("k")
    unknown = [k for k in steps.tolist() if k not in rows]
    if unknown:
        line = steps.tolist().index(unknown[0]) + 2
        raise BulwarkError(f"{table.path}:{line}: step {unknown[0]} is not in log.csv")
    at = np.array([rows[k] for k in steps.tolist()], dtype=np.intp)
    suspicion = [SUSPICION + sensor for sensor in sensors]
    plain = [c for c in TRACK_MIDDLE if c != "excluded"]
    used = {*TRACK_HEAD, *TRACK_MIDDLE, *states, *suspicion}
    spread = _Spread(len(rows), at)
    middle = {c: spread(table.numbers([c])[:, 0], np.nan) for c in plain}
    return Track(
        name=table.path.stem,
        status=spread(np.array(table.column("status")), ""),
        x_hat=spread(table.numbers(states), np.nan),
        excluded=spread(table.sets("excluded", sensors), False),
        suspicion=spread(table.numbers(suspicion), np.nan),
        extra={c: spread(table.numbers([c])[:, 0], np.nan) for c in table.header if c not in used},
        **middle,
    )


@dataclass(frozen=True)
class _Spread:
    """Puts the rows of a method at their steps of the log."""

    length: int
    at: NDArray[np.intp]

    def __call__(self, values: NDArray, empty: Any) -> NDArray:
        out = np.full((self.length, *values.shape[1:]), empty, dtype=values.dtype)
        out[self.at] = values
        return out


def _summary(path: Path) -> dict[str, Any]:
    if not path.exists():
        return {}
    try:
        summary = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise BulwarkError(f"{path}: {error}") from error
    methods = summary.get("methods", {}) if isinstance(summary, dict) else None
    if not isinstance(methods, dict) or not all(isinstance(m, dict) for m in methods.values()):
        raise BulwarkError(f"{path}: an object with an object of objects 'methods' is wanted")
    return summary


def _windows(
    path: Path, summary: dict[str, Any], rows: dict[int, int], sensors: list[str]
) -> list[tuple[int, int, list[str]]]:
    """The summary's attack windows as rows of the log."""
    out = []
    for window in summary.get("attack_windows", []):
        try:
            start, last = rows[window["from_k"]], rows[window["to_k"] - 1]
            names = [sensors[sensors.index(name)] for name in window["sensors"]]
        except (KeyError, TypeError, ValueError) as error:
            raise BulwarkError(f"{path}: attack_windows do not fit log.csv: {error}") from error
        out.append((start, last + 1, names))
    return out
