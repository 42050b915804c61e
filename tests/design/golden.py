# SPDX-License-Identifier: MIT
"""Reference systems shared by the tests: golden files and small plants built here."""

from pathlib import Path
from typing import Any

import numpy as np
from shared_data import golden

from blw import kalman, model
from blw.kalman import Kalman
from blw.model import Model

ROOT = Path(__file__).parents[2]
MODELS = ROOT / "host_sim/models"


def load(name: str) -> tuple[dict[str, Any], Model, Kalman]:
    """A golden file, its model, and the Kalman filter designed for it; skips if it is missing."""
    data = golden(name)
    plant = {key: data["model"][key] for key in ("A", "Bu", "B", "C", "Q", "R")}
    return data, *build(name, plant)


def build(name: str, plant: dict[str, Any]) -> tuple[Model, Kalman]:
    """Model and Kalman filter of a plant given by its matrices."""
    plant = {key: np.asarray(value).tolist() for key, value in plant.items()}
    mapping = {"name": name, "dt_s": 0.1, "plant": plant, "attack": {"p": 1}}
    made = model.parse(mapping, name)
    return made, kalman.steady_state(made.A, made.C, made.W, made.R)


def shipped(name: str) -> tuple[Model, Kalman]:
    """A model of host_sim/models and its Kalman filter."""
    made = model.load(MODELS / f"{name}.toml")
    return made, kalman.steady_state(made.A, made.C, made.W, made.R)


def random_plant(n: int, m: int, seed: int) -> tuple[Model, Kalman]:
    """Marginally stable A, correlated R, two inputs."""
    generator = np.random.default_rng(seed)
    A = generator.standard_normal((n, n))
    A /= np.abs(np.linalg.eigvals(A)).max()
    L = generator.standard_normal((m, m))
    return build("random", {
        "A": A, "Bu": generator.standard_normal((n, 2)), "C": generator.standard_normal((m, n)),
        "Q": 0.1 * np.eye(n), "R": 0.2 * np.eye(m) + 0.05 * L @ L.T,
    })


def two_axes(detuning: float, sensors: int = 4) -> tuple[Model, Kalman]:
    """Two decoupled double integrators whose noise differs by `detuning`: 0 is derogatory."""
    axis, zero = np.array([[1.0, 0.1], [0.0, 1.0]]), np.zeros((2, 2))
    C = np.array([[1.0, 0, 0, 0], [0, 0, 1.0, 0], [1.0, 0, 0, 0], [0, 0, 1.0, 0]])[:sensors]
    R = 0.1 * np.eye(sensors) if sensors == 4 else np.diag([0.2, 0.1, 0.2])
    return build("axes", {
        "A": np.block([[axis, zero], [zero, axis]]), "Bu": [[0.0], [1.0], [0.0], [1.0]], "C": C,
        "Q": 0.01 * np.array([1.0, 1.0, 1.0 + detuning, 1.0]), "R": R,
    })
