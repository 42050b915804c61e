# SPDX-License-Identifier: MIT
"""The whole chain, design tool and simulator, against the reference estimates of `guard`."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shared_data
import tomli_w
from conftest import Run
from golden_case import build, estimates, replay
from sim_case import columns, summary

from blw.design import design_all, document, json_text
from blw.model import load

CASES = [("paper0", "3"), ("complex", "2"), ("jordanA", "3"), ("paper1", "3")]
#: Largest error in standard deviations of the Kalman estimate.
TOLERANCE = {"f64": 1e-8, "f32": 1e-3}


@pytest.mark.parametrize("precision", ["f64", "f32"])
@pytest.mark.parametrize(("name", "k"), CASES)
def test_guard_reproduces_reference(tmp_path: Path, name: str, k: str, precision: str) -> None:
    golden = shared_data.golden(name)
    reference = golden["glr"]["k"][k]
    model = build(golden, "guard", {"k": float(k), "exclude": reference["tau_hi"]})
    designed = design_all(model, ["kalman", "guard"])
    rows = replay(tmp_path, golden, designed, precision, "guard")
    sensors = [f"y{i + 1}" for i in range(len(golden["model"]["C"]))]
    sigma = np.sqrt(np.diag(golden["kalman"]["P"]))
    error = np.abs(estimates(golden, rows) - reference["x_hybrid"]) / sigma
    assert error.max() < TOLERANCE[precision]
    assert [row["status"].split("+")[0] == "kalman" for row in rows] == reference["certificate"]
    assert [row["excluded"] for row in rows] == [
        ";".join(sensors[i] for i in excluded) for excluded in reference["excluded"]
    ]


def hardly_checked(n: int, m: int, seed: int) -> dict[str, Any]:
    """A plant with close modes: what some sensors see of them the others can hardly check."""
    C = np.random.default_rng(seed).standard_normal((m, n))
    plant = {"A": np.diag(np.linspace(0.9, 0.99, n)).tolist(), "C": C.tolist(), "Q": [1.0] * n,
             "R": [0.1] * m}
    return {"name": "hardly", "dt_s": 0.1, "plant": plant, "attack": {"p": 1}}


@pytest.mark.parametrize(("n", "m", "seed"), [(6, 4, 1), (9, 6, 1)])
def test_run_given_sensors_that_others_hardly_check_excludes_only_the_attacked(
    tmp_path: Path, blw_sim: Run, n: int, m: int, seed: int
) -> None:
    """|e_i| of such a sensor is far above 64 k without any attack; that is not a gross one."""
    design, model, scenario = (tmp_path / name for name in ("d.json", "hardly.toml", "run.toml"))
    model.write_text(tomli_w.dumps(hardly_checked(n, m, seed)))
    design.write_text(json_text(document(design_all(load(model), ["kalman", "guard"]))))
    scenario.write_text(f"""
        model = "{model}"
        steps = 1500
        [[attack]]
        sensor = "y1"
        kind = "bias"
        value = 1e5
        from = 1000
        to = 1300
    """)
    done = blw_sim("run", scenario, "--design", design, "--method", "guard", "--out", tmp_path)
    assert done.returncode == 0, done.stderr
    excluded = columns(tmp_path / "guard.csv")["excluded"]
    assert not any(excluded[:999])
    assert set(excluded[999:1299]) == {"y1"}
    mse = {name: told["mse"] for name, told in summary(tmp_path)["methods"].items()}
    assert mse["guard"]["during"] < 2.0 * mse["oracle"]["during"]
