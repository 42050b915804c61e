# SPDX-License-Identifier: MIT
"""LCM event logs, as lcm-logger writes and lcm-logplayer plays them."""

import math
import struct
from pathlib import Path

import lcm
import numpy as np

from blw.errors import BulwarkError
from blw.logs.lcm_types import CHANNELS, types
from blw.logs.steps import MOST_STEPS, Names, Steps

#: Each event of a log begins with this, big-endian.
SYNC_WORD = bytes.fromhex("eda1da01")

#: Sync word, number, time in us, lengths of the channel's name and of the data.
HEADER = struct.Struct(">IQQii")


def read(path: Path, names: Names) -> Steps:
    """Measurements, inputs and truth by their step.  Raises BulwarkError."""
    package = types()
    rows = {"measurement": {}, "input": {}, "truth": {}}
    kinds = {CHANNELS[kind]: kind for kind in rows}
    for number, event in enumerate(events(path), start=1):
        kind = kinds.get(event.channel)
        if kind is None:
            continue
        where = f"{path}: event {number} on {event.channel}"
        try:
            message = getattr(package, f"{kind}_t").decode(event.data)
        except (ValueError, IndexError, struct.error) as error:
            raise BulwarkError(f"{where}: does not decode: {error}") from None
        rows[kind][message.seq] = _checked(where, kind, message, names)
    if not rows["measurement"]:
        raise BulwarkError(f"{path}: has no message on {CHANNELS['measurement']}")
    return _steps(path, rows, names)


def events(path: Path) -> list[lcm.Event]:
    """Every event.  Raises BulwarkError if the log is no log, or ends within an event."""
    check_framing(path)
    log = lcm.EventLog(str(path), "r")
    try:
        return list(log)
    finally:
        log.close()


def check_framing(path: Path) -> None:
    """Refuse what the library would only complain about on standard error."""
    size = path.stat().st_size
    at, count = 0, 0
    with path.open("rb") as file:
        while at < size:
            file.seek(at)
            head = file.read(HEADER.size)
            if head[:len(SYNC_WORD)] != SYNC_WORD[:len(head)]:
                where = f" after event {count}, at byte {at}" if count else ""
                raise BulwarkError(f"{path}: not an LCM event log, or garbled{where}")
            lengths = HEADER.unpack(head)[3:] if len(head) == HEADER.size else (size, 0)
            at += HEADER.size + sum(lengths)
            if min(lengths) < 0 or at > size:
                raise BulwarkError(f"{path}: cut off or garbled after event {count}")
            count += 1


def _checked(where: str, kind: str, message, names: Names) -> list[float]:
    """The numbers of a message, NaN where there is none."""
    if kind == "measurement":
        sent, wanted = message.y, names.sensors
        values = [y if ok and math.isfinite(y) else math.nan
                  for y, ok in zip(message.y, message.valid, strict=True)]
    elif kind == "input":
        sent, wanted, values = message.u, names.inputs, list(message.u)
    else:
        sent, wanted, values = message.x, names.states, list(message.x)
    if len(sent) != len(wanted):
        raise BulwarkError(f"{where}: has {len(sent)} values, the model {len(wanted)}")
    return values


def _steps(path: Path, rows: dict[str, dict[int, list[float]]], names: Names) -> Steps:
    known = [k for kind in rows.values() for k in kind]
    first = max(0, min(min(rows["measurement"]) - 1, min(known)))
    last = max(known)
    if min(known) < 0 or last - first > MOST_STEPS:
        raise BulwarkError(f"{path}: its steps go from {min(known)} to {last}")
    columns = {"measurement": len(names.sensors), "input": len(names.inputs),
               "truth": len(names.states)}
    tables = {kind: np.full((last - first + 1, width), math.nan)
              for kind, width in columns.items()}
    for kind, table in tables.items():
        for k, values in rows[kind].items():
            table[k - first] = values
    return Steps(names, first, names.dt_s * np.arange(first, last + 1),
                 np.hstack([tables["measurement"], tables["input"]]),
                 tables["truth"] if rows["truth"] else None)
