# SPDX-License-Identifier: MIT
"""`bulwark analyze` as a program, and its promise held against the running estimator."""

import csv
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from blw import canonical, kalman
from blw.analysis import security
from blw.build import simulator
from blw.design import Design, document, json_text, plant_tables
from blw.errors import DesignError
from blw.model import Model, parse
from blw.modes import modes_of

ROOT = Path(__file__).resolve().parents[2]
MODELS = ROOT / "host_sim" / "models"
STEPS = 60

BLIND = """
name = "pair"
dt_s = 1.0
[plant]
A = [[1.0, 0.1], [0.0, 1.0]]
C = [[1.0, 0.0], [1.0, 0.0]]
Q = [0.1, 0.1]
R = [0.1, 0.1]
"""


def analyze(*arguments: object) -> subprocess.CompletedProcess:
    environment = os.environ | {"PYTHONPATH": str(ROOT / "tools")}
    return subprocess.run([sys.executable, "-m", "blw", "analyze", *map(str, arguments)],
                          capture_output=True, text=True, env=environment, timeout=300)


def test_analyze_given_paper_example_prints_the_ratios_that_fail():
    done = analyze(MODELS / "liu5.toml", "--json", "--method", "lasso", "--method", "kalman")
    assert (done.returncode, done.stderr) == (0, "")
    found = json.loads(done.stdout)
    assert found["methods"]["lasso"]["ratio"] == pytest.approx(
        [0.431, 1.687, 1.146, 0.758, 0.438], abs=6e-4)
    assert not found["methods"]["lasso"]["secure"]
    assert found["methods"]["lasso"]["reason"].endswith("y2 (1.687), y3 (1.146)")
    assert not found["methods"]["kalman"]["secure"]
    assert found["methods"]["kalman"]["ratio"] == [None] * 5


def test_analyze_given_pendulum_tells_what_is_safe():
    done = analyze(MODELS / "pendulum.toml", "--json", "--method", "lasso", "--method", "canonical")
    found = json.loads(done.stdout)
    assert (found["sparse_observability_index"], found["max_attacked"]) == (2, 1)
    assert found["methods"]["lasso"]["ratio"][3] == pytest.approx(52.7, abs=0.05)
    assert found["methods"]["canonical"]["secure"]
    assert max(found["methods"]["canonical"]["ratio"]) < 1.0
    assert found["methods"]["canonical"]["footprint"]["ram_bytes"] > 0
    assert found["advice"] == []


def test_analyze_reports_in_plain_words_within_a_terminal():
    done = analyze(MODELS / "pendulum.toml", "--method", "lasso", "--method", "canonical")
    assert done.returncode == 0
    assert "Sparse observability: index 2" in done.stdout
    assert "Against 1 lying sensor, safe: canonical; not safe: lasso." in done.stdout
    assert max(map(len, done.stdout.splitlines())) <= 100
    assert "\r" not in done.stdout + done.stderr


def test_analyze_given_too_few_sensors_says_what_to_add(tmp_path):
    file = tmp_path / "pair.toml"
    file.write_text(BLIND)
    done = analyze(file, "--json", "--method", "kalman", "--method", "canonical")
    found = json.loads(done.stdout)
    assert (found["sparse_observability_index"], found["max_attacked"]) == (1, 0)
    assert not found["methods"]["canonical"]["secure"]
    assert [(change["kind"], change["count"]) for change in found["advice"]] == [
        ("add", 1), ("protect", 1), ("assume_less", 0)]
    assert "add 1 sensor: another y1" in found["verdict"]


@pytest.mark.parametrize(("text", "message"), [
    (BLIND.replace("[1.0, 0.0]]", "[1.0]]"), "plant.C row 2 has 1 numbers, expected 2"),
    (BLIND.replace("C = [[1.0, 0.0], [1.0, 0.0]]", "C = [[0.0, 1.0], [0.0, 1.0]]"),
     "no sensor sees the mode 1"),
    (BLIND + "[method.canonical]\nweight = [1.0]\n", "did you mean 'weights'?"),
])
def test_analyze_given_bad_model_says_so_in_one_line(tmp_path, text, message):
    file = tmp_path / "bad.toml"
    file.write_text(text)
    done = analyze(file)
    assert done.returncode == 2
    assert done.stderr.startswith("bulwark: ") and done.stderr.count("\n") == 1
    assert message in done.stderr


def random_model(seed: int) -> Model:
    """Modes on the unit circle and inside, each seen by some sensors only; p = 1."""
    generator = np.random.default_rng(seed)
    n, m = int(generator.integers(1, 4)), int(generator.integers(3, 6))
    J = np.diag(generator.choice([1.0, 0.98, -0.97, 0.9], n, replace=False))
    T = np.linalg.qr(generator.standard_normal((n, n)))[0]
    C = generator.uniform(0.5, 2.0, (m, n)) * (generator.random((m, n)) < 0.7)
    C[generator.integers(m)] = 1.0
    return parse({"name": "random", "dt_s": 1.0, "attack": {"p": 1}, "plant": {
        "A": (T @ J @ T.T).tolist(), "C": (C @ T.T).tolist(), "Q": [0.01] * n, "R": [0.01] * m,
    }}, "random")


def displacement(folder: Path, design: Path, model: Model, sensor: int, mode: np.ndarray,
                 size: float) -> float:
    """How far the sensor moves the last estimate by claiming that the state is size * mode."""
    y = np.zeros((STEPS + 1, model.m))
    for k in range(STEPS + 1):
        y[k, sensor] = size * model.C[sensor] @ np.linalg.matrix_power(model.A, k - STEPS) @ mode
    with (folder / "log.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["k", "t_s", *model.sensors])
        writer.writerows([[k, float(k), *row.tolist()] for k, row in enumerate(y)])
    subprocess.run([simulator("f64"), "replay", folder / "log.csv", "--design", design, "--method",
                    "canonical", "--out", folder / "out"], check=True, capture_output=True)
    with (folder / "out" / "canonical.csv").open(newline="") as file:
        last = list(csv.DictReader(file))[-1]
    return float(np.linalg.norm([float(last[state]) for state in model.states]))


@pytest.mark.parametrize("seed", range(10))
def test_sensor_moves_canonical_without_limit_exactly_if_its_ratio_says_so(tmp_path, seed):
    model = random_model(seed)
    try:
        gains = kalman.steady_state(model.A, model.C, model.W, model.R)
        modes = modes_of(model.A, model.C)
        designed = canonical.design(model, gains, canonical.Options(gamma=1.0))
    except DesignError as error:
        pytest.skip(str(error))
    design = tmp_path / "design.json"
    whole = Design(model, plant_tables(model, gains), {
        "kalman": kalman.design(model, gains, kalman.Options()), "canonical": designed})
    design.write_text(json_text(document(whole)))
    weights = canonical.default_weights(model)
    for j in range(model.n):
        column = modes.observed[:, [j]]
        ratios = security.mode_ratios(column, weights, model.units, 1)
        sensor = int(np.argmax([ratio.lower for ratio in ratios]))
        if not column[sensor]:
            continue
        near, far = (displacement(tmp_path, design, model, sensor, modes.X[:, j], size)
                     for size in (1e4, 2e4))
        if ratios[sensor].secure:
            assert max(near, far) < 20.0
        else:
            assert far == pytest.approx(2.0 * near, rel=1e-2) and near > 5e3
