# SPDX-License-Identifier: MIT
"""What every kind of attack does to the samples: honest log against attacked log, equal seeds."""

from pathlib import Path

import numpy as np
import pytest
from sim_case import columns, model_of, numbers, write_design, write_scenario

STEPS, FIRST, LAST, DT = 80, 30, 60, 0.1
SENSORS = ["a", "b", "c"]
K = np.arange(STEPS + 1)
HELD = (K >= FIRST) & (K < LAST)
ELAPSED = (K - FIRST) * DT


def attacked(blw_sim, folder: Path, attack: str) -> tuple[np.ndarray, np.ndarray, Path]:
    """Honest and attacked samples [T, 3], and the design."""
    design = write_design(folder, "cart")
    samples = []
    for name, text in (("honest", ""), ("attacked", f"[[attack]]\n{attack}")):
        scenario = write_scenario(folder, f"steps = {STEPS}\nseed = 3\n{text}")
        done = blw_sim("run", scenario, "--design", design, "--out", folder / name)
        assert done.returncode == 0, done.stderr
        samples.append(numbers(folder / name / "log.csv", SENSORS))
    return *samples, design


def window(**keys) -> str:
    items = {"sensor": '"b"', "from": FIRST, "to": LAST} | keys
    return "\n".join(f"{key} = {value}" for key, value in items.items())


KINDS = {
    "bias": ({"value": 2.5}, lambda y: y + 2.5),
    "scale": ({"value": 1.5}, lambda y: 1.5 * y),
    "ramp": ({"value": 6.0}, lambda y: y + 6.0 * ELAPSED / ((LAST - FIRST) * DT)),
    "sine": ({"value": 2.0, "period_s": 0.9, "phase_rad": 0.5},
             lambda y: y + 2.0 * np.sin(2.0 * np.pi * ELAPSED / 0.9 + 0.5)),
    "pulse": ({"value": 2.0, "period_s": 0.5, "width_s": 0.2},
              lambda y: y + 2.0 * ((K - FIRST) % 5 < 2)),
    "zero": ({}, np.zeros_like),
    "sign_flip": ({}, np.negative),
    "stuck": ({}, lambda y: np.full_like(y, y[FIRST - 1])),
    "replay": ({"value": 1.2}, lambda y: np.roll(y, 12)),
    "delay": ({"value": 0.3}, lambda y: np.roll(y, 3)),
    "drop": ({}, lambda y: np.full_like(y, np.nan)),
}


@pytest.mark.parametrize("kind", KINDS)
def test_attack_given_kind_changes_the_sensor_while_it_lasts(blw_sim, tmp_path, kind):
    keys, expected = KINDS[kind]
    honest, seen, _ = attacked(blw_sim, tmp_path, window(kind=f'"{kind}"', **keys))
    want = honest.copy()
    want[HELD, 1] = expected(honest[:, 1])[HELD]
    np.testing.assert_allclose(seen, want, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize(("kind", "spread"), [("white", 1.0), ("uniform", 1.0 / np.sqrt(3.0))])
def test_attack_given_random_kind_adds_noise_of_that_size(blw_sim, tmp_path, kind, spread):
    honest, seen, _ = attacked(blw_sim, tmp_path, window(kind=f'"{kind}"', value=4.0))
    added = (seen - honest)[HELD, 1] / 4.0
    np.testing.assert_array_equal(seen[~HELD], honest[~HELD])
    assert len(set(added)) == len(added)
    assert np.sqrt(np.mean(added**2)) == pytest.approx(spread, rel=0.4)
    assert kind == "white" or np.abs(added).max() <= 1.0


def test_attack_given_ghost_is_a_trajectory_of_the_model(blw_sim, tmp_path):
    keys = window(kind='"ghost"', state="[3.0, -1.0]").replace('sensor = "b"',
                                                              'sensors = ["a", "c"]')
    honest, seen, design = attacked(blw_sim, tmp_path, keys)
    model, ghost = model_of(design), np.array([3.0, -1.0])
    added = seen - honest
    for k in K[HELD]:
        np.testing.assert_allclose(added[k, [0, 2]], (model["C"] @ ghost)[[0, 2]], atol=1e-12)
        ghost = model["A"] @ ghost
    assert not added[HELD, 1].any()


def test_attack_given_innovation_aligned_follows_the_innovation(blw_sim, tmp_path):
    keys = window(kind='"innovation_aligned"', value=2.0).replace('sensor = "b"',
                                                                 'sensors = ["a", "b"]')
    honest, seen, design = attacked(blw_sim, tmp_path, keys)
    model = model_of(design)
    x_hat = numbers(tmp_path / "attacked" / "kalman.csv", ["pos_m", "vel_m_s"])
    x_bar = x_hat[FIRST - 2:LAST - 2] @ model["A"].T
    r = (honest[HELD] - model["offset"] - x_bar @ model["C"].T)[:, :2]
    added = (seen - honest)[HELD]
    np.testing.assert_allclose(added[:, :2], 2.0 * r / np.linalg.norm(r, axis=1)[:, None],
                               atol=1e-3)
    assert not added[:, 2].any()


def test_attack_given_probability_drops_some_samples(blw_sim, tmp_path):
    _, seen, _ = attacked(blw_sim, tmp_path, window(kind='"drop"', probability=0.5))
    lost = np.isnan(seen[1:, 1])
    assert 5 < lost.sum() < 25
    assert not lost[~HELD[1:]].any()


def test_attack_given_seconds_is_the_same_as_in_steps(blw_sim, tmp_path):
    logs = []
    for keys in ({"from": 30, "to": 60}, {"t0_s": 3.0, "t1_s": 6.0}):
        text = "\n".join(f"{key} = {value}" for key, value in keys.items())
        attacked(blw_sim, tmp_path, f'sensor = "a"\nkind = "ramp"\nvalue = 3.0\n{text}')
        logs.append(numbers(tmp_path / "attacked" / "log.csv", SENSORS))
    np.testing.assert_allclose(*logs, atol=1e-12)


def test_attacks_on_one_sensor_add_up(blw_sim, tmp_path):
    both = window(kind='"bias"', value=1.0) + "\n[[attack]]\n" + window(kind='"scale"', value=2.0)
    honest, seen, _ = attacked(blw_sim, tmp_path, both)
    np.testing.assert_allclose(seen[HELD, 1], 2.0 * (honest[HELD, 1] + 1.0), rtol=1e-12)
    a = [cell for cell in columns(tmp_path / "attacked" / "log.csv")["a:b"] if cell]
    np.testing.assert_allclose([float(cell) for cell in a], (seen - honest)[HELD, 1], rtol=1e-12)
