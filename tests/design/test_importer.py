# SPDX-License-Identifier: MIT
"""Import of identified models, their attacks and their log columns."""

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest
from shared_data import SHARED

from blw import cli, importer, model
from blw.report.csv_file import CsvFile

DATA = SHARED / "data"
RECORDED = ["rav4_verifiedcan/model.json", "rav4_comma2k19/model.json", "css_obd_gnss/model.json",
            "quad_mimu/model_roll.json", "quad_mimu/model_pitch.json"]

RAW = {
    "A": [[1, 0.1], [0, 0.9]], "C": [[1, 0], [0, 1], [1, 0]], "Q": [[0.1, 0], [0, 0.2]],
    "R": [1, 2, 3], "sensors": ["w_fl", "ax", "w_fr"], "dt": 0.1,
    "states": ["v [m/s]", "a [m/s^2]"], "offset": [0, 0.5, 0], "P0": [[1, 0], [0, 1]],
    "groups": {"frame_0AA": ["w_fl", "w_fr"], "frame_228": ["ax"]},
    "p_max_groups": 0, "p_max_sensors": 1,
}
ATTACK = {"id": "P1", "t0": 5, "t1": 9, "sensors": ["ax"], "type": "bias", "value": -1.2}


@pytest.fixture()
def source(tmp_path) -> Path:
    path = tmp_path / "car" / "model.json"
    path.parent.mkdir()
    path.write_text(json.dumps(RAW))
    return path


def refuse(capsys, *arguments: object) -> str:
    assert cli.main(["import", *map(str, arguments)]) == 2
    message = capsys.readouterr().err
    assert message.startswith("bulwark: ") and message.count("\n") == 1
    return message


def test_import_given_model_writes_an_equal_model_file(source, tmp_path, capsys):
    out = tmp_path / "car.toml"
    assert cli.main(["import", str(source), "--out", str(out)]) == 0
    assert str(out) in capsys.readouterr().out
    found = model.load(out)
    assert (found.name, found.dt_s, found.p) == ("car", 0.1, 0)
    assert found.states == ["v_m_s", "a_m_s2"]
    assert found.groups == [["w_fl", "w_fr"]]
    np.testing.assert_array_equal(found.A, RAW["A"])
    np.testing.assert_array_equal(found.R, np.diag(RAW["R"]))
    np.testing.assert_array_equal(found.offset, RAW["offset"])
    np.testing.assert_array_equal(found.P0, np.eye(2))


def test_import_given_model_chooses_coordinates_that_bear_lost_samples(source, tmp_path):
    out = tmp_path / "car.toml"
    assert cli.main(["import", str(source), "--out", str(out)]) == 0
    assert tomllib.loads(out.read_text())["method"]["canonical"]["coordinates"] == "steady"


def test_import_given_options_overrides_name_p_and_groups(source, tmp_path):
    out = tmp_path / "car.toml"
    arguments = ["import", str(source), "--out", str(out)]
    assert cli.main([*arguments, "--name", "fiat", "--no-groups"]) == 0
    found = model.load(out)
    assert (found.name, found.p, found.groups) == ("fiat", 1, [])
    assert cli.main([*arguments, "--p", "1"]) == 0
    assert model.load(out).p == 1


@pytest.mark.parametrize("kind, expected", [
    ("bias", "bias"), ("ramp", "ramp"), ("scale", "scale"), ("freeze", "stuck"),
    ("noise", "white"), ("replay", "replay"), ("sine", "sine"), ("drop", "drop")])
def test_attack_files_given_every_kind_translates_it(source, kind, expected):
    plant = model.parse(importer.model_mapping(RAW, "m", "car", None, True), "m")
    raw = [ATTACK | {"type": kind, "period": 2.5, "seed": 7}]
    attack = tomllib.loads(importer.attack_files(raw, "a.json", plant)["P1.toml"])["attack"][0]
    expected_value = {} if expected in ("stuck", "drop") else {"value": -1.2}
    assert attack == {"id": "P1", "kind": expected, "sensors": ["ax"], "t0_s": 5, "t1_s": 9,
                      "period_s": 2.5, "seed": 7} | expected_value


def test_import_given_attacks_writes_one_file_each_for_known_sensors(source, tmp_path):
    attacks = tmp_path / "attacks.json"
    attacks.write_text(json.dumps([ATTACK, ATTACK | {"id": "P2", "sensors": ["laser"]}]))
    out = tmp_path / "attacks"
    assert cli.main(["import", str(source), "--out", str(tmp_path / "car.toml"),
                     "--attacks", str(attacks), "--out-attacks", str(out)]) == 0
    assert [path.name for path in out.iterdir()] == ["P1.toml"]


def test_import_given_out_map_writes_a_column_map(source, tmp_path):
    out = tmp_path / "map.toml"
    assert cli.main(["import", str(source), "--out", str(tmp_path / "car.toml"),
                     "--out-map", str(out), "--time-column", "time"]) == 0
    mapping = tomllib.loads(out.read_text())
    assert mapping == {"time": "time", "first_row": "sample",
                       "columns": {name: name for name in RAW["sensors"]}}


@pytest.mark.parametrize("key", ["A", "C", "Q", "R", "sensors", "dt"])
def test_import_given_missing_key_names_it(source, tmp_path, capsys, key):
    source.write_text(json.dumps({name: value for name, value in RAW.items() if name != key}))
    out = tmp_path / "car.toml"
    assert f"model.json: {key} is missing" in refuse(capsys, source, "--out", out)
    assert not out.exists()


@pytest.mark.parametrize("text, message", [
    ("{", "not JSON"),
    ("[1]", "must be an object"),
    (json.dumps(RAW | {"R": [1, 2]}), "plant.R has 2 numbers, expected 3"),
    (json.dumps(RAW | {"A": [[1, None], [0, 1]]}),
     "plant.A row 1, column 2, must be a number, not None"),
    (json.dumps(RAW | {"A": [[1, float("nan")], [0, 1]]}), "plant.A row 1, column 2, is nan"),
    (json.dumps(RAW | {"groups": [1]}), "groups must map names to lists of sensors"),
    (json.dumps(RAW | {"states": 3}), "states must be a list"),
])
def test_import_given_malformed_model_says_what_and_where(source, tmp_path, capsys, text, message):
    source.write_text(text)
    out = tmp_path / "car.toml"
    assert message in refuse(capsys, source, "--out", out)
    assert not out.exists()


@pytest.mark.parametrize("raw, message", [
    ({}, "must be a list of attacks"),
    ([5], "attack 1: must be an object"),
    ([{"id": "a"}], "attack 1: t0 is missing"),
    ([ATTACK | {"type": "emp"}], "attack 1: unknown type 'emp'; known: bias"),
    ([ATTACK | {"sensors": "ax"}], "attack 1: sensors must be a list of names, not 'ax'"),
    ([ATTACK | {"t0": "late"}], "attack 1: t0 must be a finite number"),
    ([ATTACK | {"value": [1, None]}], "attack 1: value must be a finite number, or one per"),
    ([ATTACK | {"sensors": ["laser"]}], "no attack is on a sensor of the model 'car'"),
    ([{key: ATTACK[key] for key in ATTACK if key != "value"}], "value is missing"),
])
def test_import_given_malformed_attacks_writes_nothing(source, tmp_path, capsys, raw, message):
    attacks = tmp_path / "attacks.json"
    attacks.write_text(json.dumps(raw))
    out = tmp_path / "car.toml"
    assert message in refuse(capsys, source, "--out", out, "--attacks", attacks,
                             "--out-attacks", tmp_path / "attacks")
    assert not out.exists()


def test_import_given_attacks_without_folder_refuses(source, tmp_path, capsys):
    assert "go together" in refuse(capsys, source, "--out", tmp_path / "c.toml", "--attacks", "a")


@pytest.mark.parametrize("name", RECORDED)
def test_import_given_recorded_model_is_accepted(name, tmp_path):
    if not (DATA / name).is_file():
        pytest.skip(f"no {name} in BULWARK_SHARED")
    out = tmp_path / "model.toml"
    attacks = (DATA / name).parent / "public" / "attacks.json"
    arguments = ["import", str(DATA / name), "--out", str(out)]
    if "pitch" not in name:
        arguments += ["--attacks", str(attacks), "--out-attacks", str(tmp_path / "attacks")]
    assert cli.main(arguments) == 0
    raw = json.loads((DATA / name).read_text())
    found = model.load(out)
    np.testing.assert_array_equal(found.C, raw["C"])
    assert found.p == raw["p_max_groups"]


def test_log_given_a_byte_order_mark_and_spaces_reads_as_replay_does(tmp_path):
    log = tmp_path / "log.csv"
    log.write_bytes(b'\xef\xbb\xbfw_fl, ax, "w_fr"\r\n1.5, , 3\r\n')
    values = CsvFile.read(log).numbers(RAW["sensors"])
    np.testing.assert_array_equal(values, [[1.5, np.nan, 3.0]])
