# SPDX-License-Identifier: MIT
"""`blw_sim run`: files, seeds, controllers, divergence, statistics."""

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest
from sim_case import SCENARIOS, columns, model_of, numbers, summary, write_design, write_scenario

QUIET = "steps = 50\n"
ATTACKED = 'steps = 60\n[[attack]]\nsensor = "a"\nkind = "bias"\nvalue = 3.0\nfrom = 20\nto = 40\n'


def test_version_names_the_width(blw_sim):
    done = blw_sim("--version")
    assert done.returncode == 0
    assert done.stdout.strip().endswith(("(f32)", "(f64)"))


def test_run_writes_every_file_in_the_documented_form(blw_sim, tmp_path):
    design = write_design(tmp_path, "cart", ("kalman", "lasso"))
    done = blw_sim("run", write_scenario(tmp_path, ATTACKED), "--design", design,
                   "--out", tmp_path / "out")
    assert (done.returncode, done.stderr) == (0, "")
    names = sorted(path.name for path in (tmp_path / "out").iterdir())
    assert names == ["kalman.csv", "lasso.csv", "log.csv", "oracle.csv", "summary.json"]
    log = columns(tmp_path / "out" / "log.csv")
    assert list(log) == ["k", "t_s", "a", "b", "c", "force_N", "x:pos_m", "x:vel_m_s",
                         "a:a", "a:b", "a:c"]
    assert log["k"] == [str(k) for k in range(61)]
    assert [log[name][0] for name in "abc"] == ["", "", ""]
    assert [cell != "" for cell in log["a:a"]] == [20 <= k < 40 for k in range(61)]
    track = columns(tmp_path / "out" / "lasso.csv")
    assert list(track) == ["k", "t_s", "status", "pos_m", "vel_m_s", "statistic", "threshold",
                           "iterations", "bound", "excluded", "suspicion:a", "suspicion:b",
                           "suspicion:c"]
    assert track["k"] == log["k"][1:]
    assert set(columns(tmp_path / "out" / "oracle.csv")["excluded"]) == {"", "a"}


@pytest.mark.parametrize("scenario", sorted(path.stem for path in SCENARIOS.glob("*.toml")))
def test_replay_of_a_run_gives_the_same_bytes(blw_sim, tmp_path, scenario):
    path = SCENARIOS / f"{scenario}.toml"
    content = tomllib.loads(path.read_text())
    fed_back = content.get("controller", {}).get("method", "truth")
    methods = dict.fromkeys(["kalman", "guard", "kalman" if fed_back == "truth" else fed_back])
    design = write_design(tmp_path, Path(content["model"]).stem, tuple(methods))
    run = blw_sim("run", path, "--design", design, "--out", tmp_path / "run")
    assert run.returncode == 0, run.stderr
    replay = blw_sim("replay", tmp_path / "run" / "log.csv", "--design", design,
                     "--out", tmp_path / "replay")
    assert replay.returncode == 0, replay.stderr
    for name in (*(f"{method}.csv" for method in methods), "oracle.csv", "log.csv"):
        assert ((tmp_path / "run" / name).read_bytes()
                == (tmp_path / "replay" / name).read_bytes()), name


def test_run_depends_on_the_seed_only(blw_sim, tmp_path):
    design = write_design(tmp_path, "cart")
    scenario = write_scenario(tmp_path, QUIET)
    for name, seed in (("one", 7), ("same", 7), ("other", 8)):
        assert blw_sim("run", scenario, "--design", design, "--seed", seed,
                       "--out", tmp_path / name).returncode == 0
    logs = [(tmp_path / name / "log.csv").read_bytes() for name in ("one", "same", "other")]
    assert logs[0] == logs[1] != logs[2]
    assert summary(tmp_path / "one")["seed"] == 7


def test_attack_leaves_the_noise_of_the_plant_alone(blw_sim, tmp_path):
    design = write_design(tmp_path, "cart")
    logs = []
    for text in ("steps = 60\n", ATTACKED):
        scenario = write_scenario(tmp_path, text)
        blw_sim("run", scenario, "--design", design, "--out", tmp_path / "out")
        logs.append(numbers(tmp_path / "out" / "log.csv", ["x:pos_m", "x:vel_m_s", "b", "c"]))
    np.testing.assert_array_equal(*logs)


def test_kalman_error_given_long_run_is_the_designed_covariance(blw_sim, tmp_path):
    design = write_design(tmp_path, "liu5")
    text = 'steps = 4000\nruns = 8\n[controller]\nkind = "feedback"\ngain = [[0.0, 0.0, -1.8]]\n'
    scenario = write_scenario(tmp_path, text, "liu5")
    assert blw_sim("run", scenario, "--design", design, "--out", tmp_path).returncode == 0
    figures = summary(tmp_path)["methods"]["kalman"]
    trace_P = json.loads(design.read_text())["methods"]["kalman"]["info"]["trace_P"]
    error = figures["mse_se"]["all"]
    assert 0 < error < 0.02 * trace_P
    assert abs(figures["mse"]["all"] - trace_P) < 4 * error
    assert figures["ratio_to_oracle"]["all"] == pytest.approx(1.0, abs=1e-5)


def test_runs_start_from_the_steady_error(blw_sim, tmp_path):
    design = write_design(tmp_path, "cart")
    scenario = write_scenario(tmp_path, 'steps = 1\nruns = 4000\ninitial = "steady"\n')
    assert blw_sim("run", scenario, "--design", design, "--out", tmp_path).returncode == 0
    figures = summary(tmp_path)["methods"]["kalman"]
    trace_P = json.loads(design.read_text())["methods"]["kalman"]["info"]["trace_P"]
    assert abs(figures["mse"]["all"] - trace_P) < 4 * figures["mse_se"]["all"]


def test_input_is_the_gain_times_the_estimate(blw_sim, tmp_path):
    design = write_design(tmp_path, "cart", ("kalman", "lasso"))
    scenario = write_scenario(tmp_path, QUIET + """
[controller]
kind = "feedback"
method = "lasso"
gain = [[2.0, 3.0]]
reference = [4.0, 0.0]
""")
    done = blw_sim("run", scenario, "--design", design, "--method", "kalman", "--out", tmp_path)
    assert done.returncode == 0, done.stderr
    u = numbers(tmp_path / "log.csv", ["force_N"])[1:, 0]
    x_hat = numbers(tmp_path / "lasso.csv", ["pos_m", "vel_m_s"])
    np.testing.assert_allclose(u, 2.0 * (4.0 - x_hat[:, 0]) - 3.0 * x_hat[:, 1], rtol=1e-5,
                               atol=1e-5)


def test_waves_drive_the_inputs(blw_sim, tmp_path):
    design = write_design(tmp_path, "cart")
    scenario = write_scenario(tmp_path, QUIET + """
[controller]
kind = "wave"
[[controller.wave]]
input = "force_N"
shape = "sine"
value = 2.0
period_s = 1.7
[[controller.wave]]
input = "force_N"
shape = "pulse"
value = 5.0
period_s = 1.0
width_s = 0.3
""")
    assert blw_sim("run", scenario, "--design", design, "--out", tmp_path).returncode == 0
    k = np.arange(51)
    expected = 2.0 * np.sin(2.0 * np.pi * 0.1 * k / 1.7) + 5.0 * (k % 10 < 3)
    np.testing.assert_allclose(numbers(tmp_path / "log.csv", ["force_N"])[:, 0], expected,
                               atol=1e-9)


def test_state_follows_the_model_given_no_noise(blw_sim, tmp_path):
    text = write_design(tmp_path, "cart").read_text()
    content = json.loads(text)
    content["model"]["Q"] = [[0.0, 0.0], [0.0, 0.0]]
    design = tmp_path / "quiet.json"
    design.write_text(json.dumps(content))
    scenario = write_scenario(tmp_path, 'steps = 9\ninitial = [1.0, 2.0]\n[controller]\n'
                              'kind = "wave"\nwave = [{ input = "force_N", value = 3.0 }]\n')
    assert blw_sim("run", scenario, "--design", design, "--out", tmp_path).returncode == 0
    model = model_of(design)
    x = numbers(tmp_path / "log.csv", ["x:pos_m", "x:vel_m_s"])
    assert x[0].tolist() == [1.0, 2.0]
    expected = x[:-1] @ model["A"].T + 3.0 * model["Bu"][:, 0]
    np.testing.assert_allclose(x[1:], expected, rtol=1e-12)


def test_run_given_unstable_plant_says_where_it_diverged(blw_sim, tmp_path):
    design = write_design(tmp_path, "liu5")
    scenario = write_scenario(tmp_path, "steps = 500\ndiverged_at = 1e6\n", "liu5")
    done = blw_sim("run", scenario, "--design", design, "--out", tmp_path / "out")
    assert done.returncode == 1
    assert done.stderr.count("\n") == 1
    assert "diverged in run 1 at k = " in done.stderr and "state x3" in done.stderr
    x = numbers(tmp_path / "out" / "log.csv", ["x:x1", "x:x2", "x:x3"])
    assert np.abs(x).max() <= 1e6
    told = summary(tmp_path / "out")["divergence"]
    assert (told["state"], told["k"]) == ("x3", len(x))


def test_run_given_json_prints_the_summary(blw_sim, tmp_path):
    design = write_design(tmp_path, "cart")
    done = blw_sim("run", write_scenario(tmp_path, QUIET), "--design", design, "--json",
                   "--out", tmp_path)
    assert json.loads(done.stdout) == summary(tmp_path)
