# SPDX-License-Identifier: MIT
"""The signal map of a foreign CAN log: which DBC signal is which sensor, in which unit.

    dbc = ["car.dbc"]                # optional, relative to the map; or --dbc
    [signals]
    v_esp = "SPEED.SPEED"
    w_fl = { signal = "WHEEL_SPEEDS.WHEEL_SPEED_FL", unit_factor = 0.2777777777777778 }
    acc = { signal = "gnss_imu.AccelerationY", unit_factor = -1.0, offset = 0.0, channel = "can1",
            valid = "ImuValid", combine = "mean" }

value = unit_factor * signal + offset.  `valid` names a signal of the same message that is not 0
where the sample counts; `combine` says what several samples in one step become, "last" or "mean".
"""

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import cantools
import textparser
from cantools.database import Database
from cantools.database.can import Message

from blw import options
from blw.errors import BulwarkError
from blw.logs.steps import Names


@dataclass(frozen=True)
class Entry:
    """One line of [signals]."""

    signal: str = ""
    unit_factor: float = 1.0
    offset: float = 0.0
    channel: str | None = None
    valid: str | None = None
    combine: Literal["last", "mean"] = "last"


@dataclass(frozen=True)
class Source:
    """Where the values of one column come from."""

    column: int
    message: Message
    signal: str
    entry: Entry


def load(path: Path, databases: Sequence[Path], names: Names) -> list[Source]:
    """The sources of a map; databases come before those that the map names.

    Raises BulwarkError.
    """
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except (UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise BulwarkError(f"{path}: {error}") from None
    options.check_keys(content, ("dbc", "signals"), str(path))
    named = content.get("dbc", [])
    if not isinstance(named, list) or not all(isinstance(item, str) for item in named):
        raise BulwarkError(f"{path}: dbc must be a list of files, not {named!r}")
    signals = content.get("signals")
    if not isinstance(signals, Mapping) or not signals:
        raise BulwarkError(f"{path}: [signals] must name the signal of every sensor")
    options.check_keys(signals, names.signals, f"{path}: signals")
    database = _database([*databases, *(path.parent / item for item in named)], path)
    return [_source(f"{path}: signals.{name}", entry, names.signals.index(name), database)
            for name, entry in signals.items()]


def _database(paths: Sequence[Path], where: Path) -> Database:
    if not paths:
        raise BulwarkError(f"{where}: no DBC: give --dbc, or `dbc` in the map")
    database = Database()
    for path in paths:
        try:
            database.add_dbc_file(path, encoding="cp1252")
        except (cantools.Error, textparser.Error, ValueError) as error:
            raise BulwarkError(f"{path}: not a DBC: {error}") from None
    return database


def _source(where: str, raw: Any, column: int, database: Database) -> Source:
    entry = options.parse(Entry, {"signal": raw} if isinstance(raw, str) else raw, where)
    message, signal = _find(where, entry.signal, database)
    if entry.valid is not None:
        _member(f"{where}.valid", message, entry.valid)
    return Source(column, message, signal, entry)


def _find(where: str, name: str, database: Database) -> tuple[Message, str]:
    message_name, _, signal = name.partition(".")
    known = [message.name for message in database.messages]
    if message_name not in known:
        raise BulwarkError(f"{where}: no message '{message_name}'; "
                           f"{options.suggestion(message_name, known)}")
    message = database.get_message_by_name(message_name)
    _member(where, message, signal)
    return message, signal


def _member(where: str, message: Message, signal: str) -> None:
    known = [each.name for each in message.signals]
    if signal not in known:
        raise BulwarkError(f"{where}: no signal '{signal}' in {message.name}; "
                           f"{options.suggestion(signal, known)}")
