# SPDX-License-Identifier: MIT
"""A run as an LCM event log: lcm-logplayer sends it as plant and node would have.

A node that hears it makes the same steps; `utime` counts from the initial state.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import lcm
import numpy as np

from blw import wire
from blw.logs.lcm_types import CHANNELS, types
from blw.logs.words import outcome_and_flags
from blw.report.data import Recording, Track


def write(recording: Recording, track: Track, path: Path) -> None:
    """Every step: sync, input, truth, measurement, estimate, and an alarm where there is news."""
    model = wire.model_id(str(recording.summary.get("model_sha256", "")))
    log = lcm.EventLog(str(path), "w", overwrite=True)
    try:
        for row in range(len(recording.k)):
            utime = round(1e6 * float(recording.t_s[row] - min(recording.t_s[0], 0.0)))
            for kind, fields in _messages(recording, track, row, model):
                log.write_event(utime, CHANNELS[kind],
                                _encoded(kind, {"utime": utime, **fields}))
    finally:
        log.close()


def _encoded(kind: str, fields: dict[str, Any]) -> bytes:
    message = getattr(types(), f"{kind}_t")()
    for name, value in fields.items():
        setattr(message, name, value)
    return message.encode()


def _messages(recording: Recording, track: Track, row: int,
              model: int) -> Iterator[tuple[str, dict[str, Any]]]:
    yield "sync", {"k": int(recording.k[row]), "model": model}
    seq, m = {"seq": int(recording.k[row])}, {"m": len(recording.sensors)}
    y = recording.y[row]
    if len(recording.inputs) > 0 and row > 0:  # the one that led here
        u = np.nan_to_num(recording.u[row - 1]).tolist()
        yield "input", {"seq": int(recording.k[row - 1]), "l": len(u), "u": u}
    if recording.x is not None:
        a = np.zeros(len(y)) if recording.a is None else recording.a[row]
        x = recording.x[row].tolist()
        yield "truth", seq | m | {"n": len(x), "x": x, "a": np.nan_to_num(a).tolist()}
    yield "measurement", seq | m | {"y": y.tolist(), "valid": (~np.isnan(y)).tolist()}
    if track.present[row]:
        yield "estimate", seq | m | _estimate(track, row)
        if _news(track, row):
            yield "alarm", seq | m | _verdict(track, row)


def _verdict(track: Track, row: int) -> dict[str, Any]:
    return {"method": track.name, "excluded": track.excluded[row].tolist(),
            "statistic": float(track.statistic[row]), "threshold": float(track.threshold[row])}


def _estimate(track: Track, row: int) -> dict[str, Any]:
    outcome, flags = outcome_and_flags(str(track.status[row]))
    x_hat = track.x_hat[row].tolist()
    return _verdict(track, row) | {
        "n": len(x_hat), "x_hat": x_hat, "suspicion": track.suspicion[row].tolist(),
        "outcome": outcome, "flags": flags, "iterations": int(track.iterations[row]),
        "bound": float(track.bound[row])}


def _news(track: Track, row: int) -> bool:
    """A test that fails after one that passed, or another set of excluded sensors."""
    before = max(row - 1, 0)
    fails = bool(track.alarm[row]) and not (row > 0 and bool(track.alarm[before]))
    return fails or bool((track.excluded[row] != track.excluded[before]).any())
