# SPDX-License-Identifier: MIT
"""NAME.dbc: what it says about frames made by wire, and that other tools can read it."""

import struct
import subprocess
import sys

import cantools
import pytest

from blw import dbc, model, wire

BIG = 20


def plant(n: int = 3, m: int = 2, l: int = 1) -> model.Model:  # noqa: E741
    """Many states, sensors and inputs, some with names that DBC or a frame reserves."""
    eye = [[float(i == j) for j in range(n)] for i in range(n)]
    sensors = ["crc", "2nd front-left", *(f"s{i}_m_s" for i in range(m))][:m]
    return model.parse({"name": "many", "dt_s": 0.1, "plant": {
        "A": eye, "C": [eye[i % n] for i in range(m)], "Q": [1.0] * n, "R": [1.0] * m,
        "Bu": [[1.0] * l for _ in range(n)], "sensors": sensors}}, "many")


def database(of: model.Model) -> cantools.database.Database:
    return cantools.database.load_string(dbc.text(of), "dbc")


def test_text_given_two_sensors_decodes_every_kind_of_frame():
    known = database(plant())
    frames = {
        "sync": (wire.ID_SYNC, wire.put_sync(70000, 0xABCDEF)),
        "y__2nd_front_left": (wire.ID_MEASUREMENT + 1,
                              wire.put_value(wire.ID_MEASUREMENT, 1, 70000, -1.5)),
        "u_u1": (wire.ID_INPUT, wire.put_value(wire.ID_INPUT, 0, 3, None)),
        "x_1": (wire.ID_ESTIMATE + 1, wire.put_estimate([0.25])),
        "status": (wire.ID_STATUS, wire.put_status(9, 2, 0x11, 1000, [1.0, 2.0, 0.25])),
        "sensors_0": (wire.ID_SENSORS, wire.put_sensors(0, 9, (1, 2, 0, 3))),
    }
    said = {name: known.decode_message(identifier, data)
            for name, (identifier, data) in frames.items()}
    assert {known.get_message_by_frame_id(identifier).name for identifier, _ in frames.values()} \
        == set(frames)
    assert said["sync"] == {"k": 70000, "model": 0xABCDEF, "crc": frames["sync"][1][7]}
    assert said["y__2nd_front_left"]["_2nd_front_left"] == -1.5
    assert (said["y__2nd_front_left"]["seq"], said["y__2nd_front_left"]["valid"]) == (4464, 1)
    assert said["u_u1"]["valid"] == 0
    assert said["x_1"] == {"x3": 0.25}
    assert (said["status"]["outcome"], said["status"]["iterations"]) == ("bound", 255)
    assert said["status"]["estimate_crc"] == wire.crc_of_values([1.0, 2.0, 0.25])
    assert said["sensors_0"]["excluded_crc_"] == 1
    assert said["sensors_0"]["missing__2nd_front_left"] == 1


def test_text_given_more_values_than_a_frame_holds_makes_blocks():
    many = plant(n=BIG, m=BIG, l=BIG)
    known = database(many)
    counts = {name: sum(message.name.startswith(name) for message in known.messages)
              for name in ("y_", "zeta_", "u_", "x_", "sensors_", "fd_y_", "fd_u_", "fd_x_")}
    assert counts == {"y_": 20, "zeta_": 20, "u_": 20, "x_": 10, "sensors_": 3, "fd_y_": 2,
                      "fd_u_": 2, "fd_x_": 2}
    block = known.get_message_by_name("fd_y_1")
    assert (block.frame_id, block.length) == (wire.FD_MEASUREMENT + 1, 32)
    data = struct.pack("<HHBBBB6f", 5, 0b111111, 6, 0, 0, 0, *range(6))
    assert block.decode(data)["s15_m_s"] == 3.0
    assert block.get_signal_by_name("s15_m_s").unit == "m/s"


def test_text_given_the_same_model_is_the_same():
    assert dbc.text(plant()) == dbc.text(plant())


def test_cantools_decode_given_a_candump_log_prints_the_values(tmp_path):
    (tmp_path / "many.dbc").write_text(dbc.text(plant()))
    data = wire.put_value(wire.ID_MEASUREMENT, 0, 7, 2.5)
    command = [sys.executable, "-m", "cantools", "decode", "--single-line"]
    done = subprocess.run([*command, str(tmp_path / "many.dbc")],
                          input=f"(1.000000) vcan0 100#{data.hex()}\n",
                          capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == 0
    assert "y_crc_(crc_: 2.5, seq: 7, valid: 1" in done.stdout


@pytest.mark.parametrize("count, length", [(1, 12), (4, 24), (6, 32), (7, 48), (14, 64)])
def test_fd_length_given_values_is_one_that_can_fd_has(count, length):
    assert wire.fd_length(count) == length


def test_crc_given_the_check_string_of_j1850_is_its_published_value():
    assert wire._crc8(b"123456789") == 0x4B


@pytest.mark.parametrize("bit", range(64))
def test_get_values_given_any_flipped_bit_refuses(bit):
    data = bytearray(wire.put_value(wire.ID_MEASUREMENT, 3, 1, 1.0))
    data[bit // 8] ^= 1 << bit % 8
    with pytest.raises(wire.FrameError, match="checksum"):
        wire.get_values(wire.ID_MEASUREMENT + 3, bytes(data))


@pytest.mark.parametrize("identifier, data", [
    (wire.ID_MEASUREMENT, b"1234567"), (wire.ID_INPUT, b""), (wire.FD_MEASUREMENT, b"\0" * 8),
    (wire.FD_INPUT, b"\0\0\0\0\x02\0\0\0" + b"\0" * 4), (wire.FD_MEASUREMENT, b"\0\0\0\0\xff")])
def test_get_values_given_a_wrong_length_refuses(identifier, data):
    with pytest.raises(wire.FrameError, match="bytes, which its layout does not"):
        wire.get_values(identifier, data)


def test_get_values_given_a_nan_calls_it_missing():
    data = wire.put_value(wire.ID_MEASUREMENT, 0, 0, float("nan"))
    assert wire.get_values(wire.ID_MEASUREMENT, data).value == [None]
    assert wire.get_values(0x400, data) is None
