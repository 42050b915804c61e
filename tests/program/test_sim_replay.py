# SPDX-License-Identifier: MIT
"""`blw_sim replay`: gaps, foreign columns, injected attacks, a recorded drive."""

import json

import numpy as np
import pytest
from sim_case import columns, model_of, numbers, summary, write_design

HEADER = "k,t_s,a,b,c,force_N\n"
FOREIGN = "time,alpha,b,gamma,f,unused\n" + "".join(
    f"{5.0 + 0.1 * k:.1f},{100 + k},{1 + 0.01 * k},{1.5 + 0.01 * k},0.5,x\n" for k in range(6))
MAP = """
time = "time"
[columns]
a = { column = "alpha", unit_factor = 0.01 }
c = "gamma"
force_N = "f"
"""


@pytest.fixture
def replay(blw_sim, tmp_path):
    """Replay a log given as text; returns the folder of the results."""
    design = write_design(tmp_path, "cart", ("kalman", "lasso"))

    def call(text, *arguments, out="out"):
        (tmp_path / "in.csv").write_text(text)
        done = blw_sim("replay", tmp_path / "in.csv", "--design", design,
                       "--out", tmp_path / out, *arguments)
        assert done.returncode == 0, done.stderr
        return tmp_path / out
    return call


def test_replay_given_gaps_predicts_and_says_so(replay, tmp_path):
    text = HEADER + "0,0,,,,0\n1,0.1,,,,0\n2,0.2,1,,1.5,\n"
    out = replay(text)
    model = model_of(tmp_path / "cart.json")
    track = columns(out / "kalman.csv")
    assert track["status"] == ["kalman+missing+degraded+blind", "kalman+missing"]
    np.testing.assert_allclose(numbers(out / "kalman.csv", model["states"])[0],
                               model["A"] @ model["x0"], rtol=1e-6)
    assert [track[f"suspicion:{name}"] for name in "abc"] == [["1", "0"], ["1", "1"], ["1", "0"]]


def test_replay_without_truth_scores_against_the_oracle(replay):
    told = summary(replay(HEADER + "0,0,,,,0\n1,0.1,1,1,1.5,0\n2,0.2,1,1,1.6,\n"))
    assert told["errors_against"] == "oracle"
    assert told["methods"]["oracle"]["rmse"]["all"] == 0.0
    assert told["methods"]["kalman"]["rmse_state"]["all"] == pytest.approx([0.0, 0.0], abs=1e-5)
    assert told["methods"]["kalman"]["ratio_to_oracle"]["all"] is None


def test_replay_takes_columns_in_any_order_and_windows_line_ends(replay):
    plain = replay(HEADER + "0,0,,,,1\n1,0.1,1,2,3,\n", out="plain")
    mixed = replay('\ufeff"c",a,b,force_N,t_s,k\r\n,,,1,0,0\r\n3, 1 ,2,,0.1,1\r\n\r\n', out="mixed")
    assert (plain / "kalman.csv").read_bytes() == (mixed / "kalman.csv").read_bytes()


def test_replay_given_partial_truth_scores_what_is_known(replay):
    text = ("k,t_s,a,b,c,force_N,x:pos_m\n0,0,,,,0,\n1,0.1,1,1,1.5,0,1\n2,0.2,1,1,1.5,0,\n"
            "3,0.3,1,1,1.5,0,5\n")
    out = replay(text)
    told = summary(out)["methods"]["kalman"]
    x_hat = numbers(out / "kalman.csv", ["pos_m"])[:, 0]
    mse = np.mean([(x_hat[0] - 1.0) ** 2, (x_hat[2] - 5.0) ** 2])
    assert told["rmse_state"]["all"] == [pytest.approx(np.sqrt(mse), rel=1e-6), None]
    assert told["mse"]["all"] == pytest.approx(mse, rel=1e-6)


def test_replay_given_map_reads_foreign_columns(replay, tmp_path):
    (tmp_path / "map.toml").write_text(MAP)
    log = columns(replay(FOREIGN, "--map", tmp_path / "map.toml") / "log.csv")
    assert log["k"] == [str(k) for k in range(6)]
    assert log["t_s"][:2] == ["5", "5.1"]
    np.testing.assert_allclose(np.array(log["a"], dtype=float), 1.0 + 0.01 * np.arange(6))
    assert log["c"][0] == "1.5" and set(log["force_N"]) == {"0.5"}


def test_replay_given_first_row_a_sample_puts_an_initial_row_before_it(replay, tmp_path):
    (tmp_path / "map.toml").write_text('first_row = "sample"' + MAP)
    out = replay(FOREIGN, "--map", tmp_path / "map.toml")
    log = columns(out / "log.csv")
    assert log["k"] == [str(k) for k in range(7)]
    assert [log[name][0] for name in ("a", "b", "c", "force_N")] == ["", "", "", "0"]
    assert float(log["t_s"][0]) == pytest.approx(4.9)
    assert len(columns(out / "kalman.csv")["k"]) == 6


def test_replay_given_attack_changes_only_its_samples(replay, tmp_path):
    (tmp_path / "map.toml").write_text(MAP)
    (tmp_path / "attack.toml").write_text(
        '[[attack]]\nid = "one"\nsensors = ["a"]\nkind = "bias"\nvalue = 3.0\nt0_s = 5.2\n'
        't1_s = 5.4\n[[attack]]\nid = "two"\nsensor = "b"\nkind = "zero"\n')
    out = replay(FOREIGN, "--map", tmp_path / "map.toml", "--attack", tmp_path / "attack.toml",
                 "--attack-id", "one")
    log = columns(out / "log.csv")
    assert [cell != "" for cell in log["a:a"]] == [k in (2, 3) for k in range(6)]
    assert [float(cell) for cell in log["a"][2:4]] == pytest.approx([4.02, 4.03])
    assert not any(log["a:b"])
    assert columns(out / "oracle.csv")["excluded"] == ["", "a", "a", "", ""]
    assert summary(out)["attacks"] == [{"id": "one", "kind": "bias", "sensors": ["a"]}]


def test_replay_given_attack_list_in_json_reads_it(replay, tmp_path):
    attacks = [{"id": "hold", "t0": 5.2, "t1": 5.5, "sensors": ["b", "c"], "type": "freeze",
                "value": 0.0, "group": True},
               {"id": "each", "t0": 5.2, "t1": 5.5, "sensors": ["b", "c"], "type": "bias",
                "value": [1.0, 0.0]}]
    (tmp_path / "map.toml").write_text(MAP)
    (tmp_path / "attacks.json").write_text(json.dumps(attacks))
    seen = []
    for attack in ("hold", "each"):
        out = replay(FOREIGN, "--map", tmp_path / "map.toml", "--attack",
                     tmp_path / "attacks.json", "--attack-id", attack)
        seen.append(numbers(out / "log.csv", ["b", "c"])[2:5])
    np.testing.assert_allclose(seen[0], np.tile([1.01, 1.51], (3, 1)))
    np.testing.assert_allclose(seen[1], [[2.02, 1.52], [2.03, 1.53], [2.04, 1.54]])


DRIVE = "rav4_verifiedcan"


def test_recorded_drive_survives_its_attacks(blw_sim, bulwark, shared, tmp_path):
    data = shared / "data" / DRIVE
    if not data.is_dir():
        pytest.skip(f"no {data}")
    prepared = bulwark("import", data / "model.json", "--out", tmp_path / "rav4.toml",
                       "--name", "rav4", "--out-map", tmp_path / "map.toml")
    assert prepared.returncode == 0, prepared.stderr
    made = bulwark("design", tmp_path / "rav4.toml", "--method", "kalman", "--method", "lasso",
                   "--out", tmp_path)
    assert made.returncode == 0, made.stderr
    attacks = data / "public" / "attacks.json"
    for attack in json.loads(attacks.read_text()):
        done = blw_sim("replay", data / "public" / "drive1_part1_grid20ms.csv", "--design",
                       tmp_path / "rav4.json", "--map", tmp_path / "map.toml", "--attack", attacks,
                       "--attack-id", attack["id"], "--out", tmp_path / "out")
        assert done.returncode == 0, done.stderr
        told = summary(tmp_path / "out")
        window = told["attack_windows"]
        assert window[0]["from_s"] == pytest.approx(attack["t0"])
        assert window[-1]["to_s"] == pytest.approx(attack["t1"])
        assert told["methods"]["kalman"]["rmse_state"]["during"][0] < 3.0
        assert told["methods"]["lasso"]["flags"]["missing"] > 3000
