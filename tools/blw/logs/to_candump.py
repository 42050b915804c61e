# SPDX-License-Identifier: MIT
"""A run as the frames that plant and node would have put on a classic CAN bus (blw_wire.h)."""

from collections.abc import Iterator
from pathlib import Path

import can
import numpy as np

from blw import wire
from blw.logs.words import outcome_and_flags
from blw.report.data import Recording, Track

CHANNEL = "can0"

#: Frames of a step follow each other at the pace of 1 Mbit/s.
FRAME_S = 130e-6

SUSPICIOUS = 0.5


def write(recording: Recording, track: Track, path: Path) -> None:
    """Every step: sync, measurements, inputs, then estimate, status and sensors."""
    model_id = wire.model_id(str(recording.summary.get("model_sha256", "")))
    with can.CanutilsLogWriter(path, channel=CHANNEL) as log:
        for row, k in enumerate(recording.k.tolist()):
            frames = [(wire.ID_SYNC, wire.put_sync(k, model_id)), *_samples(recording, row, k)]
            if track.present[row]:
                frames += _answer(recording, track, row, k)
            for number, (identifier, data) in enumerate(frames):
                log.on_message_received(can.Message(
                    timestamp=_time(recording, row, number, len(frames)), channel=CHANNEL,
                    arbitration_id=identifier, is_extended_id=False, data=data))


def _time(recording: Recording, row: int, number: int, count: int) -> float:
    """Frames spread over the beginning of their step, or over all of it if they are many."""
    dt_s = float(recording.summary.get("dt_s", count * FRAME_S))
    first = float(recording.t_s[0])
    return float(recording.t_s[row]) - min(first, 0.0) + number * min(FRAME_S, dt_s / (count + 1))


def _samples(recording: Recording, row: int, k: int) -> Iterator[tuple[int, bytes]]:
    """y(k), and the u(k-1) that led to it."""
    signals = [(wire.ID_MEASUREMENT, recording.y[row])]
    if row > 0:
        signals.append((wire.ID_INPUT, recording.u[row - 1]))
    for base, values in signals:
        for i, value in enumerate(values.tolist()):
            if value == value:
                yield base + i, wire.put_value(base, i, k, value)


def _answer(recording: Recording, track: Track, row: int, k: int) -> list[tuple[int, bytes]]:
    x_hat = track.x_hat[row].tolist()
    frames = [(wire.ID_ESTIMATE + j // 2, wire.put_estimate(x_hat[j:j + 2]))
              for j in range(0, len(x_hat), 2)]
    outcome, flags = outcome_and_flags(str(track.status[row]))
    iterations = int(track.iterations[row])
    frames.append((wire.ID_STATUS, wire.put_status(k, outcome, flags, iterations, x_hat)))
    bits = (track.excluded[row], np.isnan(recording.y[row]), np.zeros(len(recording.sensors)),
            track.suspicion[row] > SUSPICIOUS)
    for group in range((len(recording.sensors) + 7) // wire.SENSORS_PER_FRAME):
        masks = tuple(_mask(part[8 * group:8 * group + 8]) for part in bits)
        frames.append((wire.ID_SENSORS + group, wire.put_sensors(group, k, masks)))
    return frames


def _mask(bits: np.ndarray) -> int:
    return sum(1 << i for i, bit in enumerate(bits) if bit)
