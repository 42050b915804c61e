# SPDX-License-Identifier: MIT
"""Rate, noise margin and start from a log without attacks."""

import numpy as np
import pytest

from blw import identify, model
from blw.errors import BulwarkError

N_STEPS = 6000


def plant(**more) -> model.Model:
    return model.parse({"name": "car", "dt_s": 0.1, "plant": {
        "A": [[1.0, 0.1], [0.0, 0.9]], "Q": [1e-4, 1e-2], "x0": [1.0, 0.0],
        "C": [[1.0, 0.0], [2.0, 0.0], [0.0, 1.0]], "R": [0.01, 0.04, 0.09],
        "offset": [0.0, 1.0, 0.0], **more}}, "car")


def recorded(of: model.Model, start, slow: float = 0.0, seed: int = 3):
    """States [T x n] and samples [T x m]; slow: amplitude of a slow sine on each sensor."""
    generator = np.random.default_rng(seed)
    x, states = np.array(start, dtype=float), []
    for _ in range(N_STEPS):
        x = of.A @ x + generator.multivariate_normal(np.zeros(of.n), of.W)
        states.append(x)
    states = np.array(states)
    sigma = np.sqrt(np.diag(of.R))
    wave = np.sin(2.0 * np.pi * np.arange(N_STEPS)[:, None] / 400.0 + np.arange(of.m))
    noise = generator.standard_normal((N_STEPS, of.m)) + slow * wave
    return states, states @ of.C.T + of.offset + sigma * noise


def test_smooth_given_gaps_is_better_than_the_filter_and_unbiased():
    of = plant()
    states, y = recorded(of, [50.0, 0.0])
    y[np.random.default_rng(4).random(y.shape) < 0.6] = np.nan
    error = identify.smooth(of, y) - states
    P = 0.0121  # of the filter without gaps, [0, 0]; the smoother with gaps stays below it
    assert np.mean(error[:, 0] ** 2) < P
    assert abs(np.mean(error[:, 0])) < 0.01


def test_smooth_given_all_samples_minimises_the_least_squares():
    """Against the normal equations of a short log, solved as one system."""
    of = plant(P0=[0.5, 0.5])
    y = recorded(of, [1.0, 0.0])[1][:4]
    prior = identify.UNKNOWN_START * of.P0
    blocks = np.zeros((2 * 4, 2 * 4))
    right = np.zeros(2 * 4)
    first = np.linalg.inv(of.A @ prior @ of.A.T + of.W)
    for k in range(4):
        s = slice(2 * k, 2 * k + 2)
        weight = first if k == 0 else np.linalg.inv(of.W)
        blocks[s, s] += weight + of.C.T @ np.linalg.inv(of.R) @ of.C
        right[s] += of.C.T @ np.linalg.inv(of.R) @ (y[k] - of.offset)
        if k == 0:
            right[s] += weight @ of.A @ of.x0
        else:
            before = slice(2 * k - 2, 2 * k)
            blocks[before, before] += of.A.T @ weight @ of.A
            blocks[s, before] -= weight @ of.A
            blocks[before, s] -= of.A.T @ weight
    np.testing.assert_allclose(identify.smooth(of, y).ravel(), np.linalg.solve(blocks, right),
                               rtol=1e-6, atol=1e-9)


def test_identify_given_white_noise_keeps_the_least_margin():
    of = plant()
    found = identify.identify(of, recorded(of, [5.0, 0.0])[1], "log")
    assert found.noise_margin == identify.LEAST_MARGIN
    assert found.x0[0] == pytest.approx(5.0, abs=0.5)
    assert "rate" not in found.plant()


def test_identify_given_slow_noise_finds_its_amplitude():
    of = plant()
    found = identify.identify(of, recorded(of, [5.0, 0.0], slow=2.0)[1], "log")
    assert 0.7 < found.noise_margin < 2.0  # the state takes up what all sensors share


def test_identify_given_gaps_finds_the_rates():
    of = plant()
    y = recorded(of, [5.0, 0.0])[1]
    y[np.arange(N_STEPS) % 4 != 0, 1] = np.nan
    y[::100, 0] = np.nan
    found = identify.identify(of, y, "log")
    assert found.plant()["rate"] == [1.0, 0.25, 1.0]


def test_identify_given_a_dead_sensor_or_inputs_refuses():
    of = plant()
    y = recorded(of, [5.0, 0.0])[1]
    y[:, 2] = np.nan
    with pytest.raises(BulwarkError, match=r"log: y3 sends in 0.00% of the steps only"):
        identify.identify(of, y, "log")
    with pytest.raises(BulwarkError, match="a plant with inputs"):
        identify.identify(plant(Bu=[[0.0], [1.0]]), y, "log")
