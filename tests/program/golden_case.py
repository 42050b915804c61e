# SPDX-License-Identifier: MIT
"""The golden files through design tool and simulator.

In the golden files u(k) drives x(k-1) to x(k) and the estimator starts at x(-1) = 0; a log counts
one row later and has a first row for the initial state.
"""

import csv
import subprocess
from pathlib import Path
from typing import Any

import numpy as np

from blw.build import simulator
from blw.design import Design, document, json_text
from blw.model import Model, parse


def build(golden: dict[str, Any], method: str, options: dict[str, Any]) -> Model:
    """The file's model with the options of a method."""
    plant = {key: golden["model"][key] for key in ("A", "Bu", "B", "C", "Q", "R")}
    return parse({"name": "golden", "dt_s": 1.0, "plant": plant, "attack": {"p": 1},
                  "method": {method: options}}, "golden")


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
