# SPDX-License-Identifier: MIT
"""A run as MCAP with JSON messages and their JSON Schemas, for Foxglove, Lichtblick, PlotJuggler.

Topics: /measurement, /input, /truth, /attack, and for every method /METHOD/estimate,
/METHOD/decision and /METHOD/suspicion.  Signals are members with the model's names; what is not
known at a step is left out.
"""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from mcap.writer import Writer

import blw
from blw.report.data import Recording, Track

NUMBER = {"type": "number"}
STRING = {"type": "string"}
DECISION = {"status": STRING, "statistic": NUMBER, "threshold": NUMBER,
            "iterations": {"type": "integer"}, "bound": NUMBER, "alarm": {"type": "boolean"},
            "excluded": {"type": "array", "items": STRING}}


def write(recording: Recording, track: Track, path: Path) -> None:
    """All methods, whatever the track."""
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start(profile="", library=f"bulwark {blw.__version__}")
        topics = _Topics(writer)
        _register(topics, recording)
        for row in range(len(recording.k)):
            for topic, fields in _messages(recording, row):
                topics.send(topic, recording, row, fields)
        writer.finish()


class _Topics:
    """The channels of one file."""

    def __init__(self, writer: Writer):
        self._writer = writer
        self._ids: dict[str, int] = {}

    def add(self, topic: str, members: dict[str, Any]) -> None:
        """A topic whose messages have k, t_s and these members."""
        schema = {"type": "object", "title": topic.strip("/").replace("/", "."),
                  "properties": {"k": {"type": "integer"}, "t_s": NUMBER, **members},
                  "required": ["k", "t_s"]}
        schema_id = self._writer.register_schema(f"bulwark.{schema['title']}", "jsonschema",
                                                 json.dumps(schema).encode())
        self._ids[topic] = self._writer.register_channel(topic, "json", schema_id)

    def send(self, topic: str, recording: Recording, row: int, fields: dict[str, Any]) -> None:
        """One message; its time counts from the first row."""
        k, t_s = int(recording.k[row]), float(recording.t_s[row])
        time_ns = round(1e9 * (t_s - min(float(recording.t_s[0]), 0.0)))
        text = json.dumps({"k": k, "t_s": t_s, **fields}, allow_nan=False)
        self._writer.add_message(self._ids[topic], log_time=time_ns, publish_time=time_ns,
                                 data=text.encode(), sequence=k % 2**32)


def _register(topics: _Topics, recording: Recording) -> None:
    sensors = dict.fromkeys(recording.sensors, NUMBER)
    states = dict.fromkeys(recording.states, NUMBER)
    topics.add("/measurement", sensors)
    topics.add("/input", dict.fromkeys(recording.inputs, NUMBER))
    topics.add("/truth", states)
    topics.add("/attack", sensors)
    for name in recording.tracks:
        topics.add(f"/{name}/estimate", states)
        topics.add(f"/{name}/decision", DECISION)
        topics.add(f"/{name}/suspicion", sensors)


def _messages(recording: Recording, row: int) -> Iterator[tuple[str, dict[str, Any]]]:
    signals = [("/measurement", recording.sensors, recording.y),
               ("/input", recording.inputs, recording.u),
               ("/truth", recording.states, recording.x),
               ("/attack", recording.sensors, recording.a)]
    for topic, names, table in signals:
        fields = {} if table is None else _known(names, table[row])
        if fields:
            yield topic, fields
    for name, track in recording.tracks.items():
        if track.present[row]:
            yield f"/{name}/estimate", _known(recording.states, track.x_hat[row])
            yield f"/{name}/decision", _decision(recording, track, row)
            yield f"/{name}/suspicion", _known(recording.sensors, track.suspicion[row])


def _known(names: list[str], values: np.ndarray) -> dict[str, float]:
    return {name: value for name, value in zip(names, values.tolist(), strict=True)
            if np.isfinite(value)}


def _decision(recording: Recording, track: Track, row: int) -> dict[str, Any]:
    excluded = [name for name, out in zip(recording.sensors, track.excluded[row]) if out]
    numbers = _known(["statistic", "threshold", "bound"],
                     np.array([track.statistic[row], track.threshold[row], track.bound[row]]))
    return {"status": str(track.status[row]), "iterations": int(track.iterations[row]),
            "alarm": bool(track.alarm[row]), "excluded": excluded, **numbers}
