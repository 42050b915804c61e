# SPDX-License-Identifier: MIT
"""NAME.dbc: the CAN frames of one model for cantools, candump and everything else that reads DBC.

The layout is that of blw_wire.h; sensors, inputs and states have their own names and units.
"""

import re

from cantools.database import Database
from cantools.database.can import Message, Signal
from cantools.database.conversion import IdentityConversion, LinearConversion

from blw import names, wire
from blw.model import Model

#: Signals that stand beside a value in its frame.
RESERVED = ("seq", "valid", "count", "crc")

OUTCOMES = {0: "kalman", 1: "converged", 2: "bound", 3: "held"}


def text(model: Model) -> str:
    """The DBC of a model."""
    database = Database(messages(model), version=f"bulwark {model.name}")
    return database.as_dbc_string(sort_signals="default").replace("\r\n", "\n")


def messages(model: Model) -> list[Message]:
    """Every frame that a plant, a node or a sensor node of this model sends."""
    y = [(f"y_{label(name)}", name) for name in model.sensors]
    u = [(f"u_{label(name)}", name) for name in model.inputs[:wire.MAX_INPUTS]]
    found = [_sync()]
    found += [_sample(wire.ID_MEASUREMENT + i, message, name, f"measurement {name} of step seq")
              for i, (message, name) in enumerate(y)]
    found += [_zeta(wire.ID_ZETA + i, name) for i, (_, name) in enumerate(y)]
    found += [_sample(wire.ID_INPUT + i, message, name, f"input {name} that led to step seq")
              for i, (message, name) in enumerate(u)]
    found += [_estimate(j, model.states[2 * j:2 * j + 2]) for j in range((model.n + 1) // 2)]
    found += [_status()]
    found += [_sensors(g, model.sensors[8 * g:8 * g + 8]) for g in range((model.m + 7) // 8)]
    for base, prefix, signals in ((wire.FD_MEASUREMENT, "fd_y", model.sensors),
                                  (wire.FD_INPUT, "fd_u", model.inputs[:wire.MAX_INPUTS]),
                                  (wire.FD_ESTIMATE, "fd_x", model.states)):
        blocks = range((len(signals) + wire.FD_VALUES - 1) // wire.FD_VALUES)
        found += [_fd(base + b, f"{prefix}_{b}",
                      signals[wire.FD_VALUES * b:wire.FD_VALUES * (b + 1)]) for b in blocks]
    return found


def label(name: str) -> str:
    """The name of a state, sensor or input as an identifier; distinct, since enumerators are."""
    plain = re.sub(r"[^A-Za-z0-9]+", "_", name).strip("_")
    if plain in RESERVED:
        return f"{plain}_"
    return f"_{plain}" if plain[0].isdigit() else plain


def _unsigned(name: str, start: int, length: int, comment: str | None = None,
              choices: dict[int, str] | None = None) -> Signal:
    conversion = LinearConversion.factory(choices=choices) if choices else None
    return Signal(name, start=start, length=length, conversion=conversion, comment=comment)


def _float(name: str, start: int) -> Signal:
    return Signal(label(name), start=start, length=32, unit=names.unit(name) or None,
                  is_signed=True, conversion=IdentityConversion(is_float=True))


def _crc() -> Signal:
    return _unsigned("crc", 8 * wire.CRC_BYTE, 8,
                     "CRC-8 SAE J1850 over the identifier and all other bytes")


def _seq(start: int) -> Signal:
    return _unsigned("seq", start, 16, "step k modulo 65536")


def _message(identifier: int, name: str, signals: list[Signal], comment: str,
             length: int = wire.CLASSIC_LENGTH) -> Message:
    return Message(identifier, name, length, signals, comment=comment, is_extended_frame=False,
                   is_fd=length > wire.CLASSIC_LENGTH, strict=True)


def _sync() -> Message:
    signals = [_unsigned("k", 0, 32, "step that begins"),
               _unsigned("model", 32, 24, "low bits of the model's id"), _crc()]
    return _message(wire.ID_SYNC, "sync", signals, "a step begins")


def _sample(identifier: int, message: str, name: str, comment: str) -> Message:
    signals = [_float(name, 0), _seq(32), _unsigned("valid", 48, 1, "1: the value is a sample"),
               _crc()]
    return _message(identifier, message, signals, comment)


def _zeta(identifier: int, name: str) -> Message:
    signals = [_float("zeta", 0), _seq(32), _unsigned("valid", 48, 1),
               _unsigned("state", 49, 7, "number of the local state"), _crc()]
    return _message(identifier, f"zeta_{label(name)}", signals, f"local states of {name}")


def _estimate(j: int, states: list[str]) -> Message:
    signals = [_float(name, 32 * place) for place, name in enumerate(states)]
    return Message(wire.ID_ESTIMATE + j, f"x_{j}", 4 * len(states), signals,
                   comment="estimate: " + ", ".join(states), is_extended_frame=False, strict=True)


def _status() -> Message:
    signals = [_seq(0), _unsigned("outcome", 16, 8, choices=OUTCOMES),
               _unsigned("flags", 24, 8, "BLW_FLAG_... of blw_estimator.h"),
               _unsigned("events", 32, 8, "BLW_NODE_EVENT_... of blw_node.h"),
               _unsigned("iterations", 40, 8, "255: or more"),
               _unsigned("estimate_crc", 48, 8, "over the values of the estimate"), _crc()]
    return _message(wire.ID_STATUS, "status", signals, "sent after the estimate of a step")


def _sensors(group: int, sensors: list[str]) -> Message:
    signals = [_seq(0)]
    for place, what in enumerate(("excluded", "missing", "rejected", "suspicious")):
        signals += [_unsigned(f"{what}_{label(name)}", 16 + 8 * place + bit, 1)
                    for bit, name in enumerate(sensors)]
    return _message(wire.ID_SENSORS + group, f"sensors_{group}", [*signals, _crc()],
                    "what the estimator thinks of " + ", ".join(sensors))


def _fd(identifier: int, message: str, signals: list[str]) -> Message:
    head = [_seq(0), _unsigned("valid", 16, 16, "bit j: value j is a sample"),
            _unsigned("count", 32, 8), _crc()]
    values = [_float(name, 8 * wire.FD_HEAD + 32 * place) for place, name in enumerate(signals)]
    return _message(identifier, message, head + values, ", ".join(signals),
                    wire.fd_length(len(signals)))
