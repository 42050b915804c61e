# SPDX-License-Identifier: MIT
"""The whole chain, design tool and simulator, against the reference estimates of `guard`.

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
from blw.design import design_all, document, json_text
from blw.model import parse

SHARED = Path(os.environ.get("BULWARK_SHARED", Path(__file__).parents[3] / "shared"))
CASES = [("paper0", "3"), ("complex", "2"), ("jordanA", "3"), ("paper1", "3")]
#: Largest error in standard deviations of the Kalman estimate.
TOLERANCE = {"f64": 1e-8, "f32": 1e-3}


@pytest.mark.parametrize("precision", ["f64", "f32"])
@pytest.mark.parametrize(("name", "k"), CASES)
def test_guard_reproduces_reference(tmp_path: Path, name: str, k: str, precision: str) -> None:
    golden = load(name)
    reference = golden["glr"]["k"][k]
    rows = replayed(tmp_path, golden, {"k": float(k), "exclude": reference["tau_hi"]}, precision)
    sensors = [f"y{i + 1}" for i in range(len(golden["model"]["C"]))]
    states = [f"x{i + 1}" for i in range(len(golden["model"]["A"]))]
    x_hat = np.array([[float(row[state]) for state in states] for row in rows])
    sigma = np.sqrt(np.diag(golden["kalman"]["P"]))
    assert np.abs((x_hat - reference["x_hybrid"]) / sigma).max() < TOLERANCE[precision]
    assert [row["status"].split("+")[0] == "kalman" for row in rows] == reference["certificate"]
    assert [row["excluded"] for row in rows] == [
        ";".join(sensors[i] for i in excluded) for excluded in reference["excluded"]
    ]


def load(name: str) -> dict[str, Any]:
    path = SHARED / "golden" / f"{name}.json"
    if not path.is_file():
        pytest.skip(f"no {path}: set BULWARK_SHARED")
    return json.loads(path.read_text())


def replayed(
    folder: Path, golden: dict[str, Any], options: dict[str, float], precision: str
) -> list[dict[str, str]]:
    plant = {key: golden["model"][key] for key in ("A", "Bu", "B", "C", "Q", "R")}
    model = parse({"name": "golden", "dt_s": 1.0, "plant": plant, "attack": {"p": 1},
                   "method": {"guard": options}}, "golden")
    design, log = folder / "golden.json", folder / "log.csv"
    design.write_text(json_text(document(design_all(model, ["kalman", "guard"]))))
    with log.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["k", "t_s", *model.sensors, *model.inputs])
        writer.writerow([0, 0.0, *[""] * model.m, *golden["u"][0]])
        inputs = [*golden["u"][1:], [0.0] * model.l]
        for k, (y, u) in enumerate(zip(golden["y"], inputs), start=1):
            writer.writerow([k, float(k), *y, *u])
    subprocess.run([simulator(precision), "replay", log, "--design", design, "--method", "guard",
                    "--out", folder / "out"], check=True, capture_output=True, timeout=300)
    with (folder / "out" / "guard.csv").open(newline="") as file:
        return [row for row in csv.DictReader(file) if int(row["k"]) > 0]
