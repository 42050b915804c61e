# SPDX-License-Identifier: MIT
"""Figures 2 to 5 of [J] as tables: the model grid4 with white noise on y1 and false samples on y2.

`computed` follows from the covariances; `simulated` is the C library, in float, on the scenario
grid4_pulses, 500 repetitions of the paper's run in a row.
"""

import dataclasses
import json
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blw import joint_analysis as analysis
from blw import kalman, model
from blw.build import ROOT, simulator
from blw.design import design_all, document, json_text
from blw.errors import BulwarkError
from blw.joint_recursion import Pair
from blw.model import Model

Array = NDArray[np.float64]

MODEL = ROOT / "host_sim/models/grid4.toml"
SCENARIO = ROOT / "host_sim/scenarios/grid4_pulses.toml"
PAIRS = (Pair(0, (2, 3)), Pair(1, (2, 4)))
ETAS = (0.01, 0.1, 1.0, 10.0)
WHITE, PULSE = 5.0, 3.0
FIRST_PULSE, PERIOD = 50, 100
AFTER = (0, 1, 2, 5)
VARIANTS = ("printed", "corrected")

#: What a simulation of the paper's run gave elsewhere; [J] itself prints curves only.
REFERENCE_PEAK = dict(zip(ETAS, (5.4, 1.26, 0.32, 0.31), strict=True))
REFERENCE = {"local y1": 0.914, "local y2": 0.569, "fused, printed": 0.416,
             "fused, corrected": 0.408, "strong Kalman": 0.4075, "central Kalman": 0.397}


@dataclasses.dataclass(frozen=True, eq=False)
class Run:
    """One simulation: squared error of the state by method, the attack on y2 and its estimate."""

    mse: dict[str, float]
    rmse_state: list[float]
    attack: Array
    theta: Array | None


def figures() -> dict[str, Any]:
    """All tables.  Raises StepFailed if the simulator cannot be built."""
    grid = model.load(MODEL)
    found = kalman.steady_state(grid.A, grid.C, grid.W, grid.R)
    fused = {variant: simulate(grid, {"variant": variant}, compare=True) for variant in VARIANTS}
    first = simulate(grid, {"pairs": names(grid, PAIRS[:1])}, compare=True)
    second = simulate(grid, {"pairs": names(grid, PAIRS[1:])})
    return {
        "figure_2": [figure_2(grid, found.P, eta) for eta in ETAS],
        "figure_3": {name: {"rms_error": rmse, "rms_state": size}
                     for name, rmse, size in zip(grid.states, fused["corrected"].rmse_state,
                                                 state_sizes(grid), strict=True)},
        "figure_4": figure_4(grid, found.P, fused, first, second),
        "figure_5": {name: first.mse[name]
                     for name in ("joint", "augmented", "augmented_blind", "adaptive")},
    }


def names(grid: Model, pairs: tuple[Pair, ...]) -> list[list[Any]]:
    """Pairs as the model file writes them."""
    return [[grid.sensors[pair.weak], [grid.sensors[i] for i in pair.strong]] for pair in pairs]


def figure_2(grid: Model, P0: Array, eta: float) -> dict[str, Any]:
    """Mean squared error of theta on y2 at the false sample and in the steps after it."""
    computed = {}
    for variant in VARIANTS:
        step = analysis.transient(grid, PAIRS, P0, np.full(2, eta), variant == "printed")[-1]
        computed[variant] = analysis.pulse_errors(grid, PAIRS, step, PULSE, PERIOD)[:, 1]
    ran = simulate(grid, {"eta": eta})
    pulses = np.arange(FIRST_PULSE - 1, len(ran.attack) - max(AFTER), PERIOD)
    errors = np.array([(ran.theta - ran.attack)[pulses + after] ** 2 for after in AFTER])
    return {
        "eta": eta,
        "steps_after": list(AFTER),
        **{variant: errors_of[list(AFTER)].tolist() for variant, errors_of in computed.items()},
        "simulated": errors.mean(axis=1).tolist(),
        "standard_error": (errors.std(axis=1, ddof=1) / np.sqrt(pulses.size)).tolist(),
        "no_attack": float(computed["corrected"][-1]),
        "reference_peak": REFERENCE_PEAK[eta],
    }


def figure_4(grid: Model, P0: Array, fused: dict[str, Run], first: Run,
             second: Run) -> list[dict[str, Any]]:
    """Mean squared error of the state, local and fused, and of the filters to compare with."""
    eta = np.ones(2)
    variance = np.array([WHITE, PULSE**2 / PERIOD])
    both = fused["corrected"].mse
    computed = {}
    for variant in VARIANTS:
        step = analysis.transient(grid, PAIRS, P0, eta, variant == "printed")[-1]
        computed[variant] = analysis.performance(grid, PAIRS, step, variance)
    local = computed["corrected"].local
    rows = [
        ("local y1", local[0], first.mse["joint"]),
        ("local y2", local[1], second.mse["joint"]),
        *((f"fused, {variant}", computed[variant].fused, fused[variant].mse["joint"])
          for variant in VARIANTS),
        ("strong Kalman", analysis.strong_filter(grid, (2, 3, 4)), both["strong_kalman"]),
        ("central Kalman, eta", analysis.central_filter(grid, PAIRS, eta), None),
        ("central Kalman", analysis.central_filter(grid, PAIRS, eta, variance),
         both["central_kalman"]),
        ("oracle", None, first.mse["oracle"]),
        ("kalman, undefended", None, first.mse["kalman"]),
    ]
    return [{"estimator": name, "computed": None if c is None else float(c), "simulated": s,
             "reference": REFERENCE.get(name)} for name, c, s in rows]


def state_sizes(grid: Model) -> list[float]:
    """[n] standard deviations of the states themselves."""
    P = np.zeros_like(grid.A)
    for _ in range(analysis.MAX_STEPS):
        P = grid.A @ P @ grid.A.T + grid.W
    return np.sqrt(np.diag(P)).tolist()


def simulate(grid: Model, options: dict[str, Any], compare: bool = False) -> Run:
    """Design with these options in place of the model's, and run the scenario."""
    table = {**grid.methods.get("joint", {}), **options}
    changed = dataclasses.replace(grid, methods={"joint": table})
    text = json_text(document(design_all(changed, ["kalman", "joint"])))
    with tempfile.TemporaryDirectory(prefix="bulwark.") as folder:
        design, out = Path(folder) / "grid4.json", Path(folder) / "out"
        design.write_text(text, encoding="utf-8")
        command = [simulator("f32"), "run", SCENARIO, "--design", design, "--out", out,
                   "--method", "joint", *(["--compare"] if compare else [])]
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode != 0:
            raise BulwarkError(f"{SCENARIO}: {done.stderr.strip() or 'the simulation failed'}")
        return read_run(out)


def read_run(out: Path) -> Run:
    """What blw_sim wrote."""
    methods = json.loads((out / "summary.json").read_text(encoding="utf-8"))["methods"]
    attack = column(out / "log.csv", "a:y2")[1:]
    return Run({name: scores["mse"]["all"] for name, scores in methods.items()},
               methods["joint"]["rmse_state"]["all"], attack, column(out / "joint.csv", "theta:y2"))


def column(path: Path, name: str) -> Array | None:
    """A column of a CSV file, an empty cell being 0; None if there is no such column."""
    with path.open(encoding="utf-8") as file:
        header = file.readline().rstrip("\n").split(",")
        if name not in header:
            return None
        at = header.index(name)
        return np.array([float(line.rstrip("\n").split(",")[at] or 0.0) for line in file])


def text(result: dict[str, Any]) -> str:
    """The tables for a terminal."""
    lines = ["Figure 2: mean squared error of the attack estimate on y2, one false sample of 3",
             f"{'eta':>6} {'':>10} " + " ".join(f"{f'{k} after':>8}" for k in AFTER)
             + f" {'no attack':>10} {'peak elsewhere':>15}"]
    for row in result["figure_2"]:
        for kind in (*VARIANTS, "simulated"):
            values = " ".join(f"{value:8.3f}" for value in row[kind])
            last = f" {row['no_attack']:10.3f} {row['reference_peak']:15g}"
            lines.append(f"{row['eta']:6g} {kind:>10} {values}"
                         + (last if kind == "corrected" else ""))
    lines += ["", "Figure 3: root mean square of the states and of the fused estimate's errors"]
    lines += [f"  {name:8} {row['rms_state']:8.3f} {row['rms_error']:8.3f}"
              for name, row in result["figure_3"].items()]
    lines += ["", "Figure 4: mean squared error of the state, white noise of variance 5 on y1",
              f"{'':20} {'computed':>10} {'simulated':>10} {'reference':>10}"]
    lines += [f"{row['estimator']:20} " + " ".join(
        f"{'-' if row[key] is None else format(row[key], '.4f'):>10}"
        for key in ("computed", "simulated", "reference")) for row in result["figure_4"]]
    lines += ["", "Figure 5: mean squared error of the state, estimators on the sensors of pair y1"]
    lines += [f"{name:20} {value:10.4f}" for name, value in result["figure_5"].items()]
    return "\n".join(lines)
