# SPDX-License-Identifier: MIT
"""The figures that a report states, per method and phase, in the form of summary.json.

With e(k) = x_hat(k) - x(k), k >= 1 (k = 0 is the initial state):  MSE = mean of |e|^2,  RMSE its
root.  Phases: `before` the first attack, `during` any attack, `after` = every other step, `all`.
The simulator's summary.json is taken where it has a method, for it may cover many runs; what it
lacks is computed here from the CSV files, by the same definitions (host_sim/src/score.h).
"""
from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from blw.report.data import Recording, Track
from blw.report.series import Array

PHASES = ("before", "during", "after", "all")
DIGITS = 6
"""Significant digits of figures in JSON; the page shows three."""

ERRORS = ("mse", "mse_se", "rmse", "rmse_state", "ratio_to_oracle")
DECISIONS = ("detection_delay_steps", "detection_delay_s", "attacks_detected", "false_alarm_rate",
             "false_alarm_rate_before", "missed_exclusions", "wrong_exclusions", "kalman_rate")
EXCLUSIONS = ("missed_exclusions", "wrong_exclusions")

Figures = dict[str, Any]
Masks = dict[str, NDArray[np.bool_]]


def phases(recording: Recording) -> Masks:
    """[T] masks of every phase; the first three make up `all`."""
    scored = recording.k > 0
    during = np.zeros(len(scored), dtype=bool)
    for start, stop in recording.episodes:
        during[start:stop] = True
    first = recording.episodes[0][0] if recording.episodes else len(scored)
    early = np.arange(len(scored)) < first
    return {
        "before": scored & early & ~during,
        "during": scored & during,
        "after": scored & ~during & ~early,
        "all": scored,
    }


def collect(recording: Recording) -> dict[str, Figures]:
    """{method: figures}; what means nothing for a method is None: errors of the oracle if they are
    read against the oracle, decisions of a method that tests nothing, exclusions of one that never
    excludes."""
    stated = recording.summary.get("methods", {})
    masks = phases(recording)
    table = {}
    for name, track in recording.tracks.items():
        table[name] = {**_compute(recording, track, masks), **stated.get(name, {})}
        if recording.error(name) is None:
            table[name].update(dict.fromkeys(ERRORS))
        if not track.tested.any():
            table[name].update(dict.fromkeys(DECISIONS))
        if not track.excluded.any():
            table[name].update(dict.fromkeys(EXCLUSIONS))
    for values in table.values():
        if "ratio_to_oracle" not in values:
            values["ratio_to_oracle"] = _ratios(values, table.get("oracle"))
    return table


def _compute(recording: Recording, track: Track, masks: Masks) -> Figures:
    return {
        **_errors(recording.error(track.name), masks),
        **_detection(recording, track, masks),
        **_exclusion(recording, track, masks["all"]),
        **_work(track, masks),
    }


def _errors(error: Array | None, masks: Masks) -> Figures:
    if error is None:
        return dict.fromkeys(ERRORS)
    states = {p: [_mean(column[mask]) for column in (error**2).T] for p, mask in masks.items()}
    mse = {p: _sum_known(values) for p, values in states.items()}
    return {
        "mse": mse,
        "rmse": {p: _root(value) for p, value in mse.items()},
        "rmse_state": {p: [_root(value) for value in values] for p, values in states.items()},
    }


def _ratios(values: Figures, oracle: Figures | None) -> Figures | None:
    if values["mse"] is None or oracle is None or oracle["mse"] is None:
        return None
    out: Figures = dict.fromkeys(PHASES)
    for phase in PHASES:
        mine, best = values["mse"][phase], oracle["mse"][phase]
        if mine is not None and best:
            out[phase] = mine / best
    return out


def _detection(recording: Recording, track: Track, masks: Masks) -> Figures:
    """Delay = steps from the start of an attack to its detection; mean over attacks detected."""
    quiet = masks["all"] & ~masks["during"]
    there = np.isfinite(recording.y)
    alarm = track.alarm | (track.excluded & there).any(axis=1)
    caught = track.alarm | (track.excluded & recording.attacked).any(axis=1)
    hits = [np.flatnonzero(caught[start:stop]) for start, stop in recording.episodes]
    delays = np.array([float(hit[0]) for hit in hits if len(hit) > 0])
    return {
        "detection_delay_steps": _mean(delays),
        "attacks_detected": _share(len(delays), len(hits)),
        "false_alarm_rate": _mean(alarm[quiet & track.present].astype(float)),
        "false_alarm_rate_before": _mean(alarm[masks["before"] & track.present].astype(float)),
    }


def _exclusion(recording: Recording, track: Track, scored: NDArray[np.bool_]) -> Figures:
    """Samples that were there: honest ones excluded (wrong), attacked ones not (missed)."""
    there = np.isfinite(recording.y) & (scored & track.present)[:, np.newaxis]
    attacked, honest = there & recording.attacked, there & ~recording.attacked
    return {
        "missed_exclusions": _share(np.sum(attacked & ~track.excluded), np.sum(attacked)),
        "wrong_exclusions": _share(np.sum(honest & track.excluded), np.sum(honest)),
    }


def _work(track: Track, masks: Masks) -> Figures:
    kalman = np.char.startswith(track.status, "kalman").astype(float)
    iterations = track.iterations[masks["all"] & np.isfinite(track.iterations)]
    most = int(iterations.max()) if len(iterations) > 0 else None
    return {
        "kalman_rate": {p: _mean(kalman[mask & track.present]) for p, mask in masks.items()},
        "iterations": {"mean": _mean(iterations), "max": most},
    }


def _share(cases: int, tries: int) -> Figures:
    return {"count": int(cases), "of": int(tries), "rate": float(cases / tries) if tries else None}


def _mean(values: Array) -> float | None:
    finite = values[np.isfinite(values)]
    return float(finite.mean()) if len(finite) > 0 else None


def _sum_known(values: list[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return sum(known) if known else None


def _root(value: float | None) -> float | None:
    return None if value is None else float(np.sqrt(value))


def rounded(value: Any) -> Any:
    """Every float in nested lists and dictionaries at DIGITS significant digits."""
    if isinstance(value, dict):
        return {key: rounded(item) for key, item in value.items()}
    if isinstance(value, list):
        return [rounded(item) for item in value]
    if isinstance(value, float):
        return float(f"{value:.{DIGITS}g}") if np.isfinite(value) else None
    return value


def as_json(recording: Recording) -> Figures:
    """What --json prints: the figures of the page and what they were computed from."""
    k = recording.k
    attacks = [
        {"sensors": names, "from_k": int(k[start]), "to_k": int(k[stop - 1]) + 1}
        for (start, stop), names in zip(recording.episodes, recording.targets)
    ]
    return rounded(
        {
            "directory": str(recording.directory),
            "name": recording.summary.get("name"),
            "model_sha256": recording.summary.get("model_sha256"),
            "seed": recording.summary.get("seed"),
            "runs": recording.runs,
            "steps": int(np.sum(k > 0)),
            "states": recording.states,
            "sensors": recording.sensors,
            "inputs": recording.inputs,
            "errors_against": recording.yardstick,
            "attacks": attacks,
            "methods": collect(recording),
        }
    )
