# SPDX-License-Identifier: MIT
"""`bulwark recorded`: the recorded sets in the shared data, and folders that are wrong."""

import json

import numpy as np
import pytest
from sim_case import columns

MAP = """
dbc = ["{dbc}"]
[signals]
w_fl = {{ signal = "WHEEL_SPEEDS.WHEEL_SPEED_FL", unit_factor = {kmh}, channel = "can0" }}
w_fr = {{ signal = "WHEEL_SPEEDS.WHEEL_SPEED_FR", unit_factor = {kmh}, channel = "can0" }}
w_rl = {{ signal = "WHEEL_SPEEDS.WHEEL_SPEED_RL", unit_factor = {kmh}, channel = "can0" }}
w_rr = {{ signal = "WHEEL_SPEEDS.WHEEL_SPEED_RR", unit_factor = {kmh}, channel = "can0" }}
v_esp = {{ signal = "SPEED.SPEED", unit_factor = {kmh}, channel = "can0" }}
v_dsu = {{ signal = "DSU_SPEED.FORWARD_SPEED", unit_factor = {kmh}, channel = "can1" }}
ax_228 = {{ signal = "ACCELEROMETER.ACCEL_X", channel = "can0" }}
ax_024 = {{ signal = "KINEMATICS.ACCEL_X", channel = "can0" }}
"""


@pytest.fixture(scope="session")
def data(shared):
    folder = shared / "data"
    if not folder.is_dir():
        pytest.skip(f"no {folder}")
    return folder


def run(bulwark, folder, out, kept, *methods):
    """Figures of the only case that keeps the named attacks."""
    attacks = json.loads((folder / "public" / "attacks.json").read_text())
    out.mkdir()
    chosen = [attack for attack in attacks if attack["id"].split("_")[0] in kept]
    (out / "attacks.json").write_text(json.dumps(chosen))
    words = [word for method in methods for word in ("--method", method)]
    done = bulwark("recorded", folder, "--out", out, "--attacks", out / "attacks.json", "--json",
                   *words)
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert told == json.loads((out / "recorded.json").read_text())
    return told["cases"]


def test_recorded_car_with_lossy_frames_is_estimated_nearly_as_by_the_oracle(bulwark, data,
                                                                             tmp_path):
    case, = run(bulwark, data / "rav4_verifiedcan", tmp_path / "out", {"P1", "P2", "P6"},
                "guard", "decentral", "bank")
    assert case["p"] == {"sensors": 2, "groups": 1}
    assert min(case["rate"]) < 0.1 and case["noise_margin"] == 0.5
    for name in ("guard", "decentral", "bank"):
        told = case["methods"][name]
        assert told["median_to_oracle"] < 2.0
        assert told["worst"] < 0.040  # of the brute-force bank in the data's description
        assert told["stuck"] == [] and told["detected"] >= 2
    assert case["methods"]["kalman"]["worst"] > 0.4


def test_recorded_car_given_a_masqueraded_frame_meets_the_design_by_groups(bulwark, data,
                                                                           tmp_path):
    case, = run(bulwark, data / "rav4_comma2k19", tmp_path / "out", {"P4", "P5"}, "decentral",
                "guard")
    assert [replay["count"] for replay in case["attacks"]] == ["sensors", "groups"]
    for name in ("decentral", "guard"):
        told = case["methods"][name]
        assert told["worst"] < 0.091 and told["detected"] == 2 and told["stuck"] == []


def test_recorded_car_without_redundancy_promises_detection_only(bulwark, data, tmp_path):
    case, = run(bulwark, data / "css_obd_gnss", tmp_path / "out", {"P2"}, "guard", "decentral")
    assert case["p"] == {"sensors": 0, "groups": 0}
    for name in ("guard", "decentral"):
        assert case["methods"][name]["detected"] == 1
        assert case["clean"][0]["methods"][name]["wrong_exclusions"] == 0.0


def test_replay_of_a_car_s_candump_equals_its_decoded_grid(bulwark, data, tmp_path):
    folder = data / "rav4_verifiedcan"
    prepared = bulwark("import", folder / "model.json", "--out", tmp_path / "car.toml", "--log",
                       folder / "public" / "drive1_part1_grid20ms.csv")
    assert prepared.returncode == 0, prepared.stderr
    assert bulwark("design", tmp_path / "car.toml", "--method", "kalman", "--out",
                   tmp_path).returncode == 0
    (tmp_path / "map.toml").write_text(MAP.format(dbc=folder / "dbc" / "rav4_subset.dbc",
                                                  kmh=1.0 / 3.6))
    done = bulwark("replay", folder / "public" / "drive1_part1.log", "--format", "candump",
                   "--map", tmp_path / "map.toml", "--design",
                   tmp_path / "rav4_verifiedcan.json", "--method", "kalman", "--out",
                   tmp_path / "out")
    assert done.returncode == 0, done.stderr
    grid = columns(folder / "public" / "drive1_part1_grid20ms.csv")
    found = columns(tmp_path / "out" / "log.csv")
    for name in ("w_fl", "w_rr", "v_esp", "v_dsu", "ax_228", "ax_024"):
        wanted, got = grid[name], found[name][:len(grid[name])]
        assert [cell == "" for cell in got] == [cell == "" for cell in wanted]
        sent = [i for i, cell in enumerate(wanted) if cell != ""]
        np.testing.assert_allclose(np.array([float(got[i]) for i in sent]),
                                   np.array([float(wanted[i]) for i in sent]), rtol=1e-5,
                                   atol=1e-5)


@pytest.mark.parametrize("files, message", [
    ({}, "no attacks.json in it"),
    ({"attacks.json": "[]"}, "no model*.json with a log"),
    ({"attacks.json": "{}", "model.json": '{"sensors": ["a"]}', "l.csv": "t,a\n"},
     "A is missing"),
    ({"attacks.json": "[]", "model.json": "3"}, "must be an object"),
])
def test_recorded_given_a_wrong_folder_refuses(bulwark, refused, tmp_path, files, message):
    folder = tmp_path / "set"
    folder.mkdir()
    for name, text in files.items():
        (folder / name).write_text(text)
    assert message in refused(bulwark("recorded", folder, "--out", tmp_path / "out"))
    assert not (tmp_path / "out").exists()
