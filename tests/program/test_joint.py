# SPDX-License-Identifier: MIT
"""The whole chain for `joint`: design tool, C library and simulator."""

import dataclasses
import json
import subprocess
from pathlib import Path

import numpy as np
import pytest
from sim_case import CART, MODELS, SCENARIOS, columns, numbers, summary

from blw.build import simulator
from blw.design import design_all, document, json_text
from blw.model import Model, load, parse

PAIRS = [["y1", ["y3", "y4"]], ["y2", ["y3", "y5"]]]
#: Largest error of an estimate; the estimates are of magnitude 1 to 10.
TOLERANCE = {"f64": 1e-9, "f32": 1e-4}


def write_design(folder: Path, model: Model, **options: object) -> Path:
    changed = dataclasses.replace(model, methods={"joint": options})
    path = folder / "design.json"
    path.write_text(json_text(document(design_all(changed, ["kalman", "joint"]))))
    return path


def replay(folder: Path, design: Path, samples: np.ndarray, precision: str) -> Path:
    """Replay samples [T, m], NaN = missing, the first row being that of the initial state."""
    log = folder / "log.csv"
    lines = ["k,t_s," + ",".join(f"y{i + 1}" for i in range(samples.shape[1]))]
    for k, row in enumerate(samples):
        cells = ["" if np.isnan(value) else repr(float(value)) for value in row]
        lines.append(",".join([str(k), repr(5.0 * k), *cells]))
    log.write_text("\n".join(lines) + "\n")
    subprocess.run([simulator(precision), "replay", log, "--design", design, "--method", "joint",
                    "--out", folder / "out"], check=True, capture_output=True, timeout=300)
    return folder / "out" / "joint.csv"


@pytest.fixture
def golden(shared: Path) -> dict:
    return json.loads((shared / "golden" / "fdi_ieee4.json").read_text())


def golden_model(golden: dict) -> Model:
    plant = {key: golden["system"][key] for key in ("A", "C", "Q", "R", "P0")}
    return parse({"name": "ieee4", "dt_s": 5.0, "plant": plant,
                  "attack": {"p": 1, "strong": ["y3", "y4", "y5"]}}, "ieee4")


@pytest.mark.parametrize("precision", ["f32", "f64"])
@pytest.mark.parametrize(("name", "variant", "gains"), [
    ("paper", "printed", "schedule"), ("exact", "corrected", "schedule"),
    ("exact", "corrected", "recursive")])
def test_replay_given_golden_samples_yields_its_estimates(golden, tmp_path, name, variant, gains,
                                                          precision):
    design = write_design(tmp_path, golden_model(golden), pairs=PAIRS, eta=golden["eta"],
                          variant=variant, gains=gains, tolerance=1e-11)
    path = replay(tmp_path, design, np.array(golden["y"]), precision)
    want, locals_ = np.array(golden[name]["fused"]), np.array(golden[name]["X"])
    np.testing.assert_allclose(numbers(path, ["x1", "x2", "x3", "x4"]), want[1:],
                               rtol=TOLERANCE[precision], atol=TOLERANCE[precision])
    np.testing.assert_allclose(numbers(path, ["theta:y1", "theta:y2"]), locals_[:, 1:, 4].T,
                               rtol=TOLERANCE[precision], atol=TOLERANCE[precision])
    if name == "exact":
        PX = golden["exact"]["checkpoints"]["200"]["PX"]
        np.testing.assert_allclose(numbers(path, ["theta_sd:y1", "theta_sd:y2"])[-1],
                                   [np.sqrt(P[4][4]) for P in PX], rtol=1e-6)


@pytest.mark.parametrize("gains", ["schedule", "recursive"])
def test_replay_given_gaps_and_spikes_stays_finite_and_recovers(tmp_path, gains):
    model = load(MODELS / "grid4.toml")
    generator = np.random.default_rng(5)
    x, clean = np.zeros(4), []
    for _ in range(401):
        x = model.A @ x + generator.standard_normal(4) * np.sqrt(np.diag(model.W))
        clean.append(model.C @ x + generator.standard_normal(5) * np.sqrt(0.1))
    samples = np.array(clean)
    samples[100:200:7, 0] = 3e5          # 1e6 standard deviations of the noise
    samples[120:180:5, 3] = np.nan
    samples[150:153] = np.nan
    design = write_design(tmp_path, model, pairs=PAIRS, gains=gains)
    calm = numbers(replay(tmp_path, design, np.array(clean), "f32"), model.states)
    path = replay(tmp_path, design, samples, "f32")
    rough = numbers(path, model.states)
    assert np.isfinite(rough).all()
    np.testing.assert_allclose(rough[-50:], calm[-50:], atol=1e-3)
    status = columns(path)["status"]
    assert status[150] == "converged+missing+degraded+blind"
    assert status[300] == "converged"


def test_run_given_grid4_attack_estimates_state_and_signal(blw_sim, tmp_path):
    design = write_design(tmp_path, load(MODELS / "grid4.toml"), pairs=PAIRS, eta=1.0)
    done = blw_sim("run", SCENARIOS / "grid4_attack.toml", "--design", design, "--out", tmp_path)
    assert done.returncode == 0, done.stderr
    mse = {name: scores["mse"]["all"] for name, scores in summary(tmp_path)["methods"].items()}
    assert mse["joint"] == pytest.approx(0.406, rel=0.05)
    assert mse["joint"] < mse["kalman"] / 3
    assert "does as well" in summary(tmp_path)["methods"]["joint"]["verdict"]
    assert "verdict" not in summary(tmp_path)["methods"]["kalman"]
    rows = columns(tmp_path / "joint.csv")
    assert list(rows)[-4:] == ["theta:y1", "theta:y2", "theta_sd:y1", "theta_sd:y2"]
    assert "theta:y1" not in columns(tmp_path / "kalman.csv")
    pulse = rows["k"].index("50")
    assert float(rows["theta:y2"][pulse]) == pytest.approx(3.0, abs=2.0)
    assert float(rows["suspicion:y2"][pulse]) > 0.5


def test_run_given_no_attack_keeps_the_false_alarm_rate(tmp_path):
    design = write_design(tmp_path, load(MODELS / "grid4.toml"), pairs=PAIRS, false_alarm=0.01)
    scenario = tmp_path / "quiet.toml"
    scenario.write_text(f'model = "{MODELS / "grid4.toml"}"\nsteps = 20000\n')
    subprocess.run([simulator("f32"), "run", scenario, "--design", design, "--method", "joint",
                    "--out", tmp_path], check=True, capture_output=True, timeout=300)
    scores = summary(tmp_path)["methods"]["joint"]
    # two sensors at half the rate each, which are correlated, so the sum is an upper bound
    assert 0.006 < scores["false_alarm_rate"] < 0.0115
    info = json.loads(design.read_text())["methods"]["joint"]["info"]
    assert scores["mse"]["all"] == pytest.approx(info["trace_P_no_attack"], rel=0.03)


@pytest.mark.parametrize("gains", ["schedule", "recursive"])
def test_run_given_a_known_input_predicts_with_it(tmp_path, gains):
    path = tmp_path / "cart.toml"
    path.write_text(CART + f'strong = ["b", "c"]\n[method.joint]\ngains = "{gains}"\n')
    scenario = tmp_path / "wave.toml"
    scenario.write_text('model = "cart.toml"\nsteps = 4000\n[controller]\nkind = "wave"\n'
                        '[[controller.wave]]\ninput = "force_N"\nshape = "sine"\n'
                        'value = 20.0\nperiod_s = 3.0\n')
    design = tmp_path / "design.json"
    design.write_text(json_text(document(design_all(load(path), ["kalman", "joint"]))))
    done = subprocess.run([simulator("f64"), "run", scenario, "--design", design, "--method",
                           "joint", "--out", tmp_path], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    info = json.loads(design.read_text())["methods"]["joint"]["info"]
    mse = summary(tmp_path)["methods"]["joint"]["mse"]["all"]
    assert mse == pytest.approx(info["trace_P_no_attack"], rel=0.15)


def test_sweep_prints_errors_against_eta(bulwark):
    done = bulwark("joint", "sweep", MODELS / "grid4.toml", "--size", "3", "--json")
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert [row["eta"] for row in result["rows"]] == [0.01, 0.1, 1.0, 10.0, 100.0]
    assert "does as well" in result["verdict"]
    assert "one sample" in bulwark("joint", "sweep", MODELS / "grid4.toml").stdout


def test_sweep_given_a_model_without_strong_sensors_is_refused(bulwark, refused):
    assert "attack.strong" in refused(bulwark("joint", "sweep", MODELS / "liu5.toml"))
