# SPDX-License-Identifier: MIT
"""Foreign logs on the model's grid: candump through a signal map, our own frames, LCM."""

import math
import shutil
import struct

import lcm
import numpy as np
import pytest

from blw import wire
from blw.errors import BulwarkError
from blw.logs import candump, lcm_log, lcm_types, signal_map
from blw.logs.steps import Names

NAMES = Names(["v", "acc"], ["u"], ["x"], 0.1)
DBC = '''VERSION ""
BU_: car
BO_ 10 Speed: 3 car
 SG_ Kmh : 0|16@1+ (0.01,0) [0|0] "km/h" car
 SG_ Ok : 16|1@1+ (1,0) [0|0] "" car
BO_ 11 Imu: 2 car
 SG_ Ax : 0|16@1- (0.001,0) [0|0] "m/s2" car
'''
MAP = '''dbc = ["car.dbc"]
[signals]
v = { signal = "Speed.Kmh", unit_factor = 0.5, offset = 1.0, valid = "Ok", channel = "can0" }
acc = { signal = "Imu.Ax", combine = "mean" }
'''

needs_lcm_gen = pytest.mark.skipif(shutil.which("lcm-gen") is None,
                                   reason="lcm-gen (liblcm-bin) is not installed")


@pytest.fixture
def foreign(tmp_path):
    """Read a candump log given as text through MAP."""
    (tmp_path / "car.dbc").write_text(DBC)
    (tmp_path / "map.toml").write_text(MAP)

    def read(text: str):
        (tmp_path / "car.log").write_text(text)
        sources = signal_map.load(tmp_path / "map.toml", [], NAMES)
        return candump.read_foreign(tmp_path / "car.log", sources, NAMES)
    return read


@pytest.fixture
def own(tmp_path):
    """Read frames (identifier, data) as a candump log."""
    def read(*sent: tuple[int, bytes]):
        text = "".join(f"({k}.000000) can0 {identifier:03X}#{data.hex()}\n"
                       for k, (identifier, data) in enumerate(sent))
        (tmp_path / "own.log").write_text(text)
        return candump.read_own(tmp_path / "own.log", NAMES)
    return read


def speed(kmh: float, ok: int = 1) -> str:
    return (struct.pack("<H", round(100 * kmh)) + bytes([ok])).hex()


def acceleration(ax: float) -> str:
    return struct.pack("<h", round(1000 * ax)).hex()


def y(k: int, value: float | None, sensor: int = 0) -> tuple[int, bytes]:
    return wire.ID_MEASUREMENT + sensor, wire.put_value(wire.ID_MEASUREMENT, sensor, k, value)


def test_foreign_log_given_mixed_rates_lands_on_the_grid(foreign):
    steps = foreign(f"(100.00) can0 7FF#\n"
                    f"(100.02) can0 00A#{speed(10)}\n(100.10) can0 00A#{speed(20)}\n"
                    f"(100.11) can0 00B#{acceleration(1)}\n(100.15) can0 00B#{acceleration(2)}\n"
                    f"(100.31) can0 00A#{speed(30)}\n")
    assert steps.first == 0
    np.testing.assert_allclose(steps.t_s, 0.1 * np.arange(5))
    np.testing.assert_allclose(steps.signals[:, 0], [np.nan, 11, np.nan, np.nan, 16])
    np.testing.assert_allclose(steps.signals[:, 1], [np.nan, np.nan, 1.5, np.nan, np.nan])
    assert steps.text().splitlines()[:3] == ["k,t_s,v,acc,u", "0,0.0,,,0.0", "1,0.1,11.0,,0.0"]


def test_foreign_log_takes_only_valid_samples_of_the_right_channel(foreign):
    steps = foreign(f"(1.0) can0 00A#{speed(10)}\n(1.1) can1 00A#{speed(20)}\n"
                    f"(1.2) can0 00A#{speed(30, ok=0)}\n(1.3) can0 00B#{acceleration(0)}\n")
    np.testing.assert_allclose(steps.signals[:, 0], [np.nan, 6, np.nan, np.nan])


@pytest.mark.parametrize("line, message", [
    ("(1.0) can0 00A#12", "car.log:2: Speed: "),
    ("(1.0) can0", "car.log:2: not a line of candump -L"),
    ("(1.0) can0 00A#1", "car.log:2: not a line of candump -L"),
    ("(1.0) can0 00A#E8031", "car.log:2: not a line of candump -L"),
    ("(1.0) can0 00A##0E803010", "car.log:2: not a line of candump -L"),
    ("(1.0) can0 00A#xy", "car.log:2: not a line of candump -L"),
    ("1.0,can0,00A,12", "car.log:2: not a line of candump -L"),
    ("(nan) can0 00A#00", "car.log:2: the time is nan"),
    ("(1e12) can0 00A#000001", "car.log: spans 1e+12 s"),
])
def test_foreign_log_given_a_bad_line_names_it(foreign, line, message):
    with pytest.raises(BulwarkError, match="^.*" + message.replace("+", r"\+")):
        foreign(f"(0.9) can0 00A#{speed(1)}\n{line}\n")


def test_foreign_log_given_an_extended_identifier_takes_it_for_another_message(foreign):
    steps = foreign(f"(1.0) can0 00A#{speed(10)}\n(1.1) can0 0000000A#{speed(20)}\n"
                    f"(1.2) can0 00A##1{speed(30)}\n")
    np.testing.assert_allclose(steps.signals[1:, 0], [6, 16])


@pytest.mark.parametrize("flags", [0x20000000, 0x20000080])
def test_foreign_log_given_error_and_remote_frames_leaves_them_out(foreign, flags):
    steps = foreign(f"(1.0) can0 00A#{speed(10)}\n(1.1) can0 {flags + 10:08X}#0004000000000000\n"
                    f"(1.1) can0 00A#R\n(1.1) can0 00A#R3\n(1.2) can0 00A#{speed(30)} R\n")
    np.testing.assert_allclose(steps.signals[1:, 0], [6, 16])


def test_foreign_log_without_known_frames_refuses(foreign):
    with pytest.raises(BulwarkError, match="no frame of any message in the signal map"):
        foreign("(1.0) can0 123#00\n")


@pytest.mark.parametrize("old, new, message", [
    ("[signals]", "[signal]", r"unknown key 'signal'; did you mean 'signals'"),
    ("acc =", "ac =", "unknown key 'ac'; did you mean 'acc'"),
    ("Imu.Ax", "Imu.Ay", "no signal 'Ay' in Imu; known: Ax"),
    ("Imu.Ax", "Imo.Ax", "no message 'Imo'; did you mean 'Imu'"),
    ('"Ok"', '"Kk"', "valid: no signal 'Kk'"),
    ('"mean"', '"max"', "combine must be 'last' or 'mean'"),
    ("0.5", '"0.5"', "unit_factor must be a finite number"),
    ('["car.dbc"]', '"car.dbc"', "dbc must be a list of files"),
    ('["car.dbc"]', '["map.toml"]', "not a DBC"),
    ('dbc = ["car.dbc"]', "", "no DBC"),
    ('dbc = ["car.dbc"]', "= 3", "map.toml: "),
])
def test_signal_map_given_a_mistake_says_where(tmp_path, old, new, message):
    (tmp_path / "car.dbc").write_text(DBC)
    (tmp_path / "map.toml").write_text(MAP.replace(old, new))
    with pytest.raises(BulwarkError, match=message):
        signal_map.load(tmp_path / "map.toml", [], NAMES)


def test_own_frames_are_placed_by_their_step(own):
    steps = own(y(9, 1.0), y(11, 2.0), y(10, 5.0), y(10, None, 1),
                (wire.ID_INPUT, wire.put_value(wire.ID_INPUT, 0, 9, 0.5)), y(11, 7.0, 1))
    assert steps.first == 8 and not steps.dropped
    np.testing.assert_allclose(steps.t_s, [0.8, 0.9, 1.0, 1.1])
    np.testing.assert_array_equal(steps.signals[:, 0], [np.nan, 1, 5, 2])
    np.testing.assert_array_equal(steps.signals[:, 1], [np.nan, np.nan, np.nan, 7])
    assert [row.split(",")[4] for row in steps.text().splitlines()[1:]] == ["0.5"] * 4


def test_own_frames_given_a_sequence_that_wraps_go_on(own):
    sync = (wire.ID_SYNC, wire.put_sync(131070, 0))
    steps = own(sync, y(131070, 1.0), y(131072, 2.0))
    assert steps.first == 131069
    np.testing.assert_array_equal(steps.signals[:, 0], [np.nan, 1, np.nan, 2])


def test_own_frames_given_damage_count_what_is_left_out(own):
    identifier, data = y(2, 3.0)
    damaged = (identifier, bytes([data[0] ^ 1]) + data[1:])
    steps = own(y(1, 1.0), y(1, 1.0), damaged, y(3, 1.0), y(3, 4.0), y(4, 2.0),
                (wire.ID_MEASUREMENT + 7, wire.put_value(wire.ID_MEASUREMENT, 7, 4, 1.0)))
    np.testing.assert_array_equal(steps.signals[:, 0], [np.nan, 1, np.nan, np.nan, 2])
    assert sorted(steps.dropped.values()) == [1, 1, 1]


def test_own_frames_given_extended_identifiers_are_somebody_elses(own):
    identifier, data = y(1, 9.0)
    steps = own(y(1, 1.0), (0x80000000 + identifier, data))
    np.testing.assert_array_equal(steps.signals[1, 0], 1)
    assert not steps.dropped


def test_own_frames_of_can_fd_hold_several_values(own):
    data = wire.sealed(wire.FD_MEASUREMENT,
                       struct.pack("<HHBBBBff", 5, 0b10, 2, 0, 0, 0, 1.0, 2.0))
    steps = own((wire.FD_MEASUREMENT, data))
    np.testing.assert_array_equal(steps.signals[1, :2], [np.nan, 2])


def test_own_log_without_measurements_refuses(own):
    with pytest.raises(BulwarkError, match="no measurement frame of this model"):
        own((0x7FF, b""))


def event_log(path, *messages: tuple[str, dict]) -> None:
    log = lcm.EventLog(str(path), "w", overwrite=True)
    for number, (kind, fields) in enumerate(messages):
        message = getattr(lcm_types.types(), f"{kind}_t")()
        for name, value in fields.items():
            setattr(message, name, value)
        log.write_event(number, lcm_types.CHANNELS[kind], message.encode())
    log.close()


def measurement(seq: int, values: list[float], valid: list[bool]) -> tuple[str, dict]:
    return "measurement", {"seq": seq, "m": len(values), "y": values, "valid": valid}


@needs_lcm_gen
def test_lcm_log_is_read_by_step(tmp_path):
    event_log(tmp_path / "a.lcm", measurement(5, [1.0, 2.0], [True, False]),
              ("input", {"seq": 5, "l": 1, "u": [0.5]}),
              ("truth", {"seq": 5, "n": 1, "x": [9.0], "m": 2, "a": [0.0, 0.0]}),
              measurement(7, [math.nan, 3.0], [True, True]))
    steps = lcm_log.read(tmp_path / "a.lcm", NAMES)
    assert steps.first == 4
    np.testing.assert_array_equal(steps.signals[1], [1, np.nan, 0.5])
    np.testing.assert_array_equal(steps.signals[3], [np.nan, 3, np.nan])
    np.testing.assert_array_equal(steps.states[:, 0], [np.nan, 9, np.nan, np.nan])
    assert steps.text().splitlines()[0] == "k,t_s,v,acc,u,x:x"


@needs_lcm_gen
def test_lcm_log_given_damage_says_where(tmp_path):
    path = tmp_path / "a.lcm"
    event_log(path, measurement(1, [1.0, 2.0], [True, True]),
              measurement(2, [1.0, 2.0], [True, True]))
    whole = path.read_bytes()
    half = len(whole) // 2
    assert whole[half:half + 4] == lcm_log.SYNC_WORD
    cases = [(whole[:-3], "cut off or garbled after event 1"),
             (b"k,t_s\n" + whole, "not an LCM event log"),
             (whole[:half] + b"\0" * 4 + whole[half + 4:], "or garbled after event 1, at byte 89"),
             (whole.replace(b"BLW_MEASUREMENT", b"BLW_MEASUREMENT"[::-1]), "has no message on"),
             (whole[:43] + b"\xff" + whole[44:], "event 1 on BLW_MEASUREMENT: does not decode")]
    for data, message in cases:
        path.write_bytes(data)
        with pytest.raises(BulwarkError, match=message):
            lcm_log.read(path, NAMES)


@needs_lcm_gen
def test_lcm_log_given_another_plant_refuses(tmp_path):
    event_log(tmp_path / "a.lcm", measurement(1, [1.0], [True]))
    with pytest.raises(BulwarkError, match="event 1 on BLW_MEASUREMENT: has 1 values, the model 2"):
        lcm_log.read(tmp_path / "a.lcm", NAMES)
