# SPDX-License-Identifier: MIT
"""What the simulator's tests share: designs, scenarios as text, outputs as arrays."""

import csv
import json
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import numpy as np

from blw.build import ROOT
from blw.design import design_all, document, json_text
from blw.model import load

MODELS = ROOT / "host_sim" / "models"
SCENARIOS = ROOT / "host_sim" / "scenarios"

#: Two states, three sensors, one input; sensor c has an offset and a range.
CART = """
name = "cart"
dt_s = 0.1
[plant]
states = ["pos_m", "vel_m_s"]
sensors = ["a", "b", "c"]
inputs = ["force_N"]
A = [[1.0, 0.1], [0.0, 0.9]]
Bu = [[0.0], [0.1]]
C = [[1.0, 0.0], [1.0, 0.1], [1.0, -0.1]]
Q = [0.001, 0.01]
R = [[0.1, 0.05, 0.0], [0.05, 0.2, 0.0], [0.0, 0.0, 0.1]]
x0 = [1.0, 0.0]
offset = [0.0, 0.0, 0.5]
range = [[-inf, inf], [-inf, inf], [-50.0, 50.0]]
[attack]
p = 1
"""


@cache
def design_text(model: Path, methods: tuple[str, ...]) -> str:
    """NAME.json of a model file."""
    return json_text(document(design_all(load(model), methods)))


def write_design(folder: Path, model: str, methods: Sequence[str] = ("kalman",)) -> Path:
    """Design a shipped model, or `cart`, into a folder."""
    path = MODELS / f"{model}.toml"
    if model == "cart":
        path = folder / "cart.toml"
        path.write_text(CART)
    design = folder / f"{model}.json"
    design.write_text(design_text(path, tuple(methods)))
    return design


def write_scenario(folder: Path, text: str, model: str = "cart") -> Path:
    """A scenario for a design of write_design."""
    if model != "cart":
        (folder / f"{model}.toml").write_text((MODELS / f"{model}.toml").read_text())
    path = folder / "scenario.toml"
    path.write_text(f'model = "{model}.toml"\n{text}')
    return path


def columns(path: Path) -> dict[str, list[str]]:
    """A CSV file as text by column."""
    with path.open(newline="") as file:
        rows = list(csv.reader(file))
    return {name: [row[i] for row in rows[1:]] for i, name in enumerate(rows[0])}


def numbers(path: Path, names: Sequence[str]) -> np.ndarray:
    """[T, len(names)]; NaN = empty."""
    table = columns(path)
    return np.array([[float(cell or "nan") for cell in table[name]] for name in names]).T


def summary(folder: Path) -> dict:
    return json.loads((folder / "summary.json").read_text())


def model_of(design: Path) -> dict:
    """The arrays of the design's model, as NumPy arrays."""
    model = json.loads(design.read_text())["model"]
    for name in ("A", "Bu", "B", "C", "Q", "R", "x0", "offset"):
        model[name] = np.array(model[name], dtype=float)
    return model
