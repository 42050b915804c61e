# SPDX-License-Identifier: MIT
"""The whole chain, design tool and simulator, against the reference estimates of `guard`."""

from pathlib import Path

import numpy as np
import pytest
import shared_data
from golden_case import build, estimates, replay

from blw.design import design_all

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
