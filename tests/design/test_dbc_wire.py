# SPDX-License-Identifier: MIT
"""The DBC and wire.py against the C code: cantools decodes what blw_wire encodes, and back."""

import ctypes
import itertools
import shutil
import subprocess
from pathlib import Path

import cantools
import pytest
from test_dbc import plant

from blw import dbc, wire

ROOT = Path(__file__).resolve().parents[2]
KINDS = {"measurement": 2, "input": 3, "estimate": 4, "zeta": 5}


class Frame(ctypes.Structure):
    _fields_ = [("t_us", ctypes.c_uint64), ("id", ctypes.c_uint16), ("len", ctypes.c_uint8),
                ("data", ctypes.c_uint8 * 64)]

    def bytes(self) -> bytes:
        return bytes(self.data[:self.len])


class Sync(ctypes.Structure):
    _fields_ = [("k", ctypes.c_uint32), ("model", ctypes.c_uint32)]


class Values(ctypes.Structure):
    _fields_ = [("kind", ctypes.c_uint8), ("sensor", ctypes.c_uint8), ("first", ctypes.c_uint8),
                ("count", ctypes.c_uint8), ("seq", ctypes.c_uint16), ("valid", ctypes.c_uint16),
                ("value", ctypes.c_float * 14)]


class Status(ctypes.Structure):
    _fields_ = [("seq", ctypes.c_uint16), *((name, ctypes.c_uint8) for name in (
        "outcome", "flags", "events", "iterations", "estimate"))]


class Sensors(ctypes.Structure):
    _fields_ = [("seq", ctypes.c_uint16), *((name, ctypes.c_uint8) for name in (
        "group", "excluded", "missing", "rejected", "suspicious"))]


@pytest.fixture(scope="module")
def c(tmp_path_factory) -> ctypes.CDLL:
    """blw_wire as a shared library."""
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        pytest.skip("no C compiler")
    library = tmp_path_factory.mktemp("wire") / "wire.so"
    subprocess.run([compiler, "-shared", "-fPIC", "-std=c99", "-o", library,
                    f"-I{ROOT}/port/include", f"-I{ROOT}/lib/include",
                    *sorted((ROOT / "port" / "src").glob("blw_wire*.c"))], check=True)
    loaded = ctypes.CDLL(str(library))
    loaded.blw_wire_put_values.restype = ctypes.c_bool
    return loaded


@pytest.fixture(scope="module")
def known() -> cantools.database.Database:
    return cantools.database.load_string(dbc.text(plant(n=20, m=20, l=3)), "dbc")


def put(c, kind: str, first: int, values: list[float], seq: int = 7, valid: int = 0xFFFF,
        fd: bool = False, sensor: int = 0) -> Frame:
    frame = Frame()
    said = Values(KINDS[kind], sensor, first, len(values), seq, valid & (1 << len(values)) - 1,
                  (ctypes.c_float * 14)(*values))
    assert c.blw_wire_put_values(ctypes.byref(said), int(fd), ctypes.byref(frame))
    return frame


def decode(known, frame: Frame) -> dict:
    return known.decode_message(frame.id, frame.bytes())


def test_c_frames_of_single_values_are_decoded_by_the_dbc(c, known):
    for i, name in enumerate(plant(n=20, m=20, l=3).sensors):
        said = decode(known, put(c, "measurement", i, [0.5 - i], seq=65535))
        assert (said[dbc.label(name)], said["seq"], said["valid"]) == (0.5 - i, 65535, 1)
    said = decode(known, put(c, "input", 2, [4.0], valid=0))
    assert (said["u3"], said["valid"]) == (4.0, 0)
    assert decode(known, put(c, "zeta", 5, [2.5], sensor=1))["state"] == 5
    assert decode(known, put(c, "estimate", 18, [1.0, -2.0])) == {"x19": 1.0, "x20": -2.0}


def test_c_frames_of_can_fd_are_decoded_by_the_dbc(c, known):
    said = decode(known, put(c, "measurement", 14, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0], valid=0b101,
                             fd=True))
    assert (said["s15_m_s"], said["valid"], said["count"]) == (4.0, 0b101, 6)
    assert decode(known, put(c, "input", 0, [1.0, 2.0, 3.0], fd=True))["u3"] == 3.0
    assert decode(known, put(c, "estimate", 0, [9.0] * 14, fd=True))["x14"] == 9.0


def test_python_makes_the_same_frames_as_c(c):
    frame = Frame()
    for i, value in itertools.product((0, 63), (1.5, -0.0, 1e30)):
        for kind, base in (("measurement", wire.ID_MEASUREMENT), ("input", wire.ID_INPUT)):
            frame = put(c, kind, i, [value], seq=70000 % wire.SEQ)
            assert frame.id == base + i
            assert frame.bytes() == wire.put_value(base, i, 70000, value)
    frame = put(c, "estimate", 4, [1.0, 2.0])
    assert (frame.id, frame.bytes()) == (wire.ID_ESTIMATE + 2, wire.put_estimate([1.0, 2.0]))
    c.blw_wire_put_sync(ctypes.byref(Sync(70000, 0xABCDEF)), ctypes.byref(frame))
    assert (frame.id, frame.bytes()) == (wire.ID_SYNC, wire.put_sync(70000, 0xABCDEF))
    x_hat = [1.0, 2.0, 3.0]
    check = c.blw_wire_sum_values(0, (ctypes.c_float * 3)(*x_hat), 3)
    c.blw_wire_put_status(ctypes.byref(Status(9, 2, 3, 0, 255, check)), ctypes.byref(frame))
    assert (frame.id, frame.bytes()) == (wire.ID_STATUS, wire.put_status(9, 2, 3, 999, x_hat))
    c.blw_wire_put_sensors(ctypes.byref(Sensors(9, 1, 1, 2, 4, 8)), ctypes.byref(frame))
    assert (frame.id, frame.bytes()) == (wire.ID_SENSORS + 1, wire.put_sensors(1, 9, (1, 2, 4, 8)))


def test_python_reads_the_frames_of_c(c):
    for fd, values in ((False, [2.0]), (True, [1.0, 2.0, 3.0])):
        frame = put(c, "measurement", 14, values, valid=0b011, fd=fd)
        said = wire.get_values(frame.id, frame.bytes())
        assert (said.base, said.first, said.seq) == (wire.ID_MEASUREMENT, 14, 7)
        assert said.value == [v if j < 2 else None for j, v in enumerate(values)]
