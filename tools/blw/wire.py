# SPDX-License-Identifier: MIT
"""The frames of blw_wire.h in Python: identifiers, checksum, values (docs/wire.md).

Tests hold this module, the DBC made from it and the C code together.
"""

import math
import struct
from dataclasses import dataclass

ID_SYNC = 0x080
ID_MEASUREMENT = 0x100
ID_ZETA = 0x140
ID_INPUT = 0x180
ID_ESTIMATE = 0x200
ID_STATUS = 0x280
ID_SENSORS = 0x281

#: The same in frames of CAN FD.
FD_MEASUREMENT = 0x090
FD_INPUT = 0x0A0
FD_ESTIMATE = 0x0C0

#: Values in one frame of CAN FD, and where they begin.
FD_VALUES = 14
FD_HEAD = 8

CLASSIC_LENGTH = 8
CRC_BYTE = 7
MAX_SENSORS = 64
MAX_INPUTS = 128
SENSORS_PER_FRAME = 8
K_END = 2**32 - 1
SEQ = 2**16

_FD_LENGTHS = (8, 12, 16, 20, 24, 32, 48, 64)


@dataclass(frozen=True)
class Values:
    """Consecutive values of one kind, base + first being the identifier of a classic frame.

    value[j] belongs to index first + j, None if it is no sample; seq = k mod 2^16.
    """

    base: int
    first: int
    seq: int
    value: list[float | None]


class FrameError(ValueError):
    """A frame that its identifier makes ours, but with a wrong length, checksum or layout."""


def crc(identifier: int, data: bytes) -> int:
    """CRC-8 SAE J1850 over the identifier and all bytes but CRC_BYTE."""
    covered = data[:CRC_BYTE] + data[CRC_BYTE + 1:]
    return _crc8(struct.pack("<H", identifier) + covered)


def crc_of_values(values: list[float]) -> int:
    """The same over the bytes of an estimate alone, as the status frame carries it."""
    return _crc8(struct.pack(f"<{len(values)}f", *values))


def sealed(identifier: int, data: bytes) -> bytes:
    """The data of a frame with its checksum set."""
    return data[:CRC_BYTE] + bytes([crc(identifier, data)]) + data[CRC_BYTE + 1:]


def fd_length(values: int) -> int:
    """Bytes of a CAN FD frame with so many values."""
    return next(length for length in _FD_LENGTHS if length >= FD_HEAD + 4 * values)


def model_id(sha256: str) -> int:
    """What a sync carries of a model: the low 24 of the first 32 bits; 0 if it is not known."""
    return int(sha256[:8] or "0", 16) & 0xFFFFFF


def put_sync(k: int, model_id: int) -> bytes:
    """Frame ID_SYNC."""
    return sealed(ID_SYNC, struct.pack("<I", k) + model_id.to_bytes(4, "little")[:3] + b"\0")


def put_value(base: int, index: int, seq: int, value: float | None) -> bytes:
    """Frame base + index of a measurement or an input."""
    number = 0.0 if value is None else value
    data = struct.pack("<fHBB", number, seq % SEQ, value is not None, 0)
    return sealed(base + index, data)


def put_estimate(values: list[float]) -> bytes:
    """Frame ID_ESTIMATE + j with one or two values."""
    return struct.pack(f"<{len(values)}f", *values)


def put_status(seq: int, outcome: int, flags: int, iterations: int, x_hat: list[float]) -> bytes:
    """Frame ID_STATUS."""
    head = struct.pack("<HBBBBB", seq % SEQ, outcome, flags, 0, min(iterations, 255),
                       crc_of_values(x_hat))
    return sealed(ID_STATUS, head + b"\0")


def put_sensors(group: int, seq: int, masks: tuple[int, int, int, int]) -> bytes:
    """Frame ID_SENSORS + group: excluded, missing, rejected, suspicious of eight sensors."""
    return sealed(ID_SENSORS + group, struct.pack("<HBBBBBB", seq % SEQ, *masks, 0, 0))


def get_values(identifier: int, data: bytes) -> Values | None:
    """A measurement or an input, classic or FD; None for any other identifier.

    Raises FrameError.
    """
    for base, size in ((ID_MEASUREMENT, MAX_SENSORS), (ID_INPUT, MAX_INPUTS)):
        if base <= identifier < base + size:
            return _classic(identifier, base, data)
    for fd, base, size in ((FD_MEASUREMENT, ID_MEASUREMENT, 5), (FD_INPUT, ID_INPUT, 10)):
        if fd <= identifier < fd + size:
            return _fd(identifier, base, FD_VALUES * (identifier - fd), data)
    return None


def get_sync(identifier: int, data: bytes) -> int | None:
    """k of a sync; None for any other identifier.  Raises FrameError."""
    if identifier != ID_SYNC:
        return None
    _check(identifier, data, len(data) == CLASSIC_LENGTH)
    return struct.unpack("<I", data[:4])[0]


def _classic(identifier: int, base: int, data: bytes) -> Values:
    _check(identifier, data, len(data) == CLASSIC_LENGTH)
    value, seq, flags = struct.unpack("<fHB", data[:CRC_BYTE])
    if flags > 1:
        raise FrameError(f"has the flags 0x{flags:02x}, of which this version knows only bit 0")
    return Values(base, identifier - base, seq, [_sample(value, bool(flags))])


def _fd(identifier: int, base: int, first: int, data: bytes) -> Values:
    count = data[4] if len(data) > 4 else 0
    sound = 0 < count <= FD_VALUES and len(data) == fd_length(count)
    _check(identifier, data, sound and data[5:7] == b"\0\0")
    seq, valid = struct.unpack("<HH", data[:4])
    values = struct.unpack(f"<{count}f", data[FD_HEAD:FD_HEAD + 4 * count])
    return Values(base, first, seq,
                  [_sample(value, bool(valid >> j & 1)) for j, value in enumerate(values)])


def _sample(value: float, valid: bool) -> float | None:
    return value if valid and math.isfinite(value) else None


def _check(identifier: int, data: bytes, right_length: bool) -> None:
    if not right_length:
        raise FrameError(f"has {len(data)} bytes, which its layout does not")
    if data[CRC_BYTE] != crc(identifier, data):
        raise FrameError(f"has the checksum 0x{data[CRC_BYTE]:02x}, its bytes make "
                         f"0x{crc(identifier, data):02x}")


def _table() -> list[int]:
    found = []
    for byte in range(256):
        for _ in range(8):
            byte = (byte << 1) ^ (0x11D if byte & 0x80 else 0)
        found.append(byte)
    return found


_CRC_TABLE = _table()


def _crc8(data: bytes) -> int:
    value = 0xFF
    for byte in data:
        value = _CRC_TABLE[value ^ byte]
    return value ^ 0xFF
