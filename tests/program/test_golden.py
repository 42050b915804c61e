# SPDX-License-Identifier: MIT
"""The whole chain, design tool and simulator, against the reference estimates of `lasso`."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shared_data
from golden_case import build, estimates, replay

from blw.design import design_all
from blw.model import Model

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
    golden = shared_data.golden(name)
    model = build(golden, "lasso", {"gamma": float(gamma)})
    check(golden, replayed(tmp_path, golden, model, precision), gamma, TOLERANCE[precision])


@pytest.mark.parametrize(("name", "gamma"), [("paper1", "30"), ("complex", "3")])
def test_admm_reproduces_reference(tmp_path: Path, name: str, gamma: str) -> None:
    golden = shared_data.golden(name)
    model = build(golden, "lasso", {"gamma": float(gamma), "engine": "admm", "tolerance": 1e-3})
    check(golden, replayed(tmp_path, golden, model, "f64"), gamma, TOLERANCE["f64"])


def test_kalman_reproduces_reference(tmp_path: Path) -> None:
    golden = shared_data.golden("paper0")
    rows = replayed(tmp_path, golden, build(golden, "lasso", {"gamma": 1.0}), "f64", "kalman")
    assert np.abs(estimates(golden, rows) - golden["x_kalman"]).max() < 1e-12


def replayed(
    folder: Path, golden: dict[str, Any], model: Model, precision: str, method: str = "lasso"
) -> list[dict[str, str]]:
    return replay(folder, golden, design_all(model, ["kalman", "lasso"]), precision, method)


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
