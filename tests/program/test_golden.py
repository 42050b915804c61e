# SPDX-License-Identifier: MIT
"""The whole chain, design tool and simulator, against the reference estimates of `lasso`.

In the golden files u(k) drives x(k-1) to x(k) and the estimator starts at x(-1) = 0; a log counts
one row later and has a first row for the initial state.
"""

import csv
import json
import os
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from blw.build import simulator
from blw.design import Design, design_all, document, json_text
from blw.model import Model, parse

SHARED = Path(os.environ.get("BULWARK_SHARED", Path(__file__).parents[3] / "shared"))
CASES = [
    ("paper0", "0.28"), ("paper0", "0.75"), ("paper0", "2"), ("paper1", "1"), ("paper1", "30"),
    ("complex", "0.5"), ("complex", "3"), ("complex", "10"), ("jordanA", "1"), ("jordanA", "10"),
]
#: Largest error in standard deviations of the Kalman estimate.
TOLERANCE = {"f64": 1e-6, "f32": 1e-3}


@pytest.mark.parametrize("precision", ["f64", "f32"])
@pytest.mark.parametrize(("name", "gamma"), CASES)
def test_active_set_reproduces_reference(
    tmp_path: Path, name: str, gamma: str, precision: str
) -> None:
    golden = load(name)
    model = build(golden, {"gamma": float(gamma)})
    check(golden, replayed(tmp_path, golden, model, precision), gamma, TOLERANCE[precision])


@pytest.mark.parametrize(("name", "gamma"), [("paper1", "30"), ("complex", "3")])
def test_admm_reproduces_reference(tmp_path: Path, name: str, gamma: str) -> None:
    golden = load(name)
    model = build(golden, {"gamma": float(gamma), "engine": "admm", "tolerance": 1e-3})
    check(golden, replayed(tmp_path, golden, model, "f64"), gamma, TOLERANCE["f64"])


def test_kalman_reproduces_reference(tmp_path: Path) -> None:
    golden = load("paper0")
    rows = replayed(tmp_path, golden, build(golden, {"gamma": 1.0}), "f64", "kalman")
    assert np.abs(estimates(golden, rows) - golden["x_kalman"]).max() < 1e-12


def load(name: str) -> dict[str, Any]:
    path = SHARED / "golden" / f"{name}.json"
    if not path.is_file():
        pytest.skip(f"no {path}: set BULWARK_SHARED")
    return json.loads(path.read_text())


def build(golden: dict[str, Any], options: dict[str, Any]) -> Model:
    plant = {key: golden["model"][key] for key in ("A", "Bu", "B", "C", "Q", "R")}
    mapping = {"name": "golden", "dt_s": 1.0, "plant": plant, "attack": {"p": 1},
               "method": {"lasso": options}}
    return parse(mapping, "golden")


def replayed(
    folder: Path, golden: dict[str, Any], model: Model, precision: str, method: str = "lasso"
) -> list[dict[str, str]]:
    return replay(folder, golden, design_all(model, ["kalman", "lasso"]), precision, method)


def replay(
    folder: Path, golden: dict[str, Any], designed: Design, precision: str, method: str
) -> list[dict[str, str]]:
    """What the simulator makes of the golden measurements, one row per y."""
    model = designed.model
    design, log = folder / "golden.json", folder / "log.csv"
    design.write_text(json_text(document(designed)))
    with log.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["k", "t_s", *model.sensors, *model.inputs])
        writer.writerow([0, 0.0, *[""] * model.m, *golden["u"][0]])
        inputs = [*golden["u"][1:], [0.0] * model.l]
        for k, (y, u) in enumerate(zip(golden["y"], inputs), start=1):
            writer.writerow([k, float(k), *y, *u])
    subprocess.run([simulator(precision), "replay", log, "--design", design, "--method", method,
                    "--out", folder / "out"], check=True, capture_output=True, timeout=300)
    with (folder / "out" / f"{method}.csv").open(newline="") as file:
        return [row for row in csv.DictReader(file) if row["k"] != "0"]


def estimates(golden: dict[str, Any], rows: list[dict[str, str]]) -> np.ndarray:
    states = [f"x{i + 1}" for i in range(len(golden["model"]["A"]))]
    return np.array([[float(row[state]) for state in states] for row in rows])


def check(
    golden: dict[str, Any], rows: list[dict[str, str]], gamma: str, tolerance: float
) -> None:
    """Estimates where the minimiser is unique, and the outcome of the certificate everywhere."""
    reference = golden["jordan"]["gamma"][gamma]
    sigma = np.sqrt(np.diag(golden["kalman"]["P"]))
    unique = np.array(reference["unique"])
    assert unique.any()
    error = np.abs(estimates(golden, rows) - reference["x"]) / sigma
    assert error[unique].max() < tolerance
    assert [row["status"] == "kalman" for row in rows] == reference["certificate"]
    assert all(row["iterations"] == "0" for row in rows if row["status"] == "kalman")
    assert {row["status"] for row in rows} <= {"kalman", "converged"}
