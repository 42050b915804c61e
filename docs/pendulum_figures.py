# SPDX-License-Identifier: MIT
"""Figures 3 and 4 of [N] as tables, from the C library in the simulator: docs/canonical.md.

    PYTHONPATH=tools build/venv/bin/python docs/pendulum_figures.py
"""

import json
import subprocess
import tempfile
import tomllib
from pathlib import Path
from typing import Any

import numpy as np

from blw import canonical, canonical_form, kalman
from blw.build import ROOT, simulator
from blw.design import Design, document, json_text, plant_tables
from blw.l1_tuning import BenignLoss
from blw.local_filters import local_filters
from blw.model import parse
from blw.modes import modes_of

MODEL = ROOT / "host_sim" / "models" / "pendulum.toml"
QUARTER_TURN = np.pi / 2
STEPS = 20_000

SCENARIO = """
model = "pendulum.toml"
steps = {steps}
seed  = {seed}
diverged_at = 1e12
[controller]
kind   = "feedback"
method = "truth"
gain   = [[-0.604, -1.678, -39.514, -9.721]]
[[attack]]
sensor = "angle"
kind   = "uniform"
value  = {size}
"""


def mean_square_errors(gamma: float, size: float, steps: int = STEPS,
                       **options: Any) -> dict[str, float]:
    """Mean square error of `canonical`, `kalman` and `oracle` over tr P, with the angle sensor
    shifted by a uniform random number within +-size in every step."""
    model = parse(tomllib.loads(MODEL.read_text()), str(MODEL))
    gains = kalman.steady_state(model.A, model.C, model.W, model.R)
    methods = {
        "kalman": kalman.design(model, gains, kalman.Options()),
        "canonical": canonical.design(model, gains, canonical.Options(gamma=gamma, **options)),
    }
    whole = Design(model, plant_tables(model, gains), methods)
    scenario = SCENARIO.format(steps=steps, seed=1, size=max(size, 1e-9))
    with tempfile.TemporaryDirectory(prefix="bulwark.") as name:
        folder = Path(name)
        (folder / "pendulum.toml").write_text(MODEL.read_text())
        (folder / "scenario.toml").write_text(scenario)
        (folder / "pendulum.json").write_text(json_text(document(whole)))
        subprocess.run([simulator("f64"), "run", folder / "scenario.toml", "--design",
                        folder / "pendulum.json", "--method", "canonical", "--out", folder / "out"],
                       check=True, stdout=subprocess.DEVNULL)
        summary = json.loads((folder / "out" / "summary.json").read_text())
    return {method: figures["mse"]["during"] / float(np.trace(gains.P))
            for method, figures in summary["methods"].items()}


def benign_of_admm(gamma: float, rho: float) -> float:
    """Mean square error over tr P without attack of the minimiser that ADMM with penalty rho
    converges to; it has many with weights 1."""
    model = parse(tomllib.loads(MODEL.read_text()), str(MODEL))
    gains = kalman.steady_state(model.A, model.C, model.W, model.R)
    filters = local_filters(model, gains)
    form = canonical_form.choose(filters, modes_of(model.A, model.C), "jordan")
    fused = canonical.fusion(np.ones(model.m), filters, form)
    loss = BenignLoss(fused.reduced, fused.groups, fused.F, float(np.trace(gains.P)), rho, 3000,
                      samples=10_000)
    return 1.0 + loss(gamma)


def main() -> None:
    """Print the tables."""
    print("Fig. 3: MSE / tr P\ngamma     benign  attacked   kalman   oracle")
    for gamma in (0.1, 0.3, 1.0, 5.0, 20.0, 50.0):
        benign = mean_square_errors(gamma, 0.0, variant="printed")
        attacked = mean_square_errors(gamma, QUARTER_TURN, variant="printed")
        print(f"{gamma:5g} {benign['canonical']:10.3f} {attacked['canonical']:9.1f}"
              f" {attacked['kalman']:8.1f} {attacked['oracle']:8.1f}")
    print("\nbenign, minimiser of ADMM with rho 0.02 and 0.2")
    for gamma in (0.3, 1.0, 5.0):
        print(f"{gamma:5g} {benign_of_admm(gamma, 0.02):10.3f} {benign_of_admm(gamma, 0.2):9.3f}")
    print("\nFig. 4: MSE / tr P at gamma 5\n size  canonical   kalman")
    for size in (0.0, 0.25, 0.5, 1.0, QUARTER_TURN, 5.0, 20.0, 100.0):
        found = mean_square_errors(5.0, size, variant="printed")
        print(f"{size:5.2f} {found['canonical']:10.1f} {found['kalman']:8.1f}")


if __name__ == "__main__":
    main()
