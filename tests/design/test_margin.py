# SPDX-License-Identifier: MIT
"""noise_margin and rate: the bounds they promise, and that without them nothing changes."""

import json
import math
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import ncx2

from blw import chi2, design, gaps, guard, guard_fusion, guard_order, margin, model, options
from blw.decentral_filters import local_filters
from blw.decentral_fusion import fuse
from blw.errors import DesignError, ModelError
from blw.guard_filters import filters
from blw.kalman import steady_state

MODELS = Path(__file__).resolve().parents[2] / "host_sim" / "models"
METHODS = ["kalman", "lasso", "canonical", "decentral", "bank", "guard"]

CAR = {
    "name": "car", "dt_s": 0.02,
    "plant": {"A": [[1.0, 0.02], [0.0, 0.99]], "Q": [1e-5, 1e-3],
              "C": [[1.0, 0.0], [1.01, 0.01], [0.99, 0.0], [1.0, -0.02], [0.0, 1.0]],
              "R": [4e-3, 3e-3, 5e-3, 4e-3, 2e-2]},
    "attack": {"p": 1},
    "method": {name: {"recovery_probability": 0.9} for name in ("lasso", "canonical")},
}


def car(**plant) -> model.Model:
    return model.parse(CAR | {"plant": CAR["plant"] | plant}, "car")


def tables(of: model.Model, methods=METHODS) -> dict:
    return design.document(design.design_all(of, methods))["methods"]


def simulate_disturbed(F, b, bounds, course) -> np.ndarray:
    """[r] where the filter F, b is after samples bounds * course(k)."""
    state = np.zeros(len(F))
    for k in range(4000):
        state = F @ state + b * bounds * course(k)
    return state


def test_tables_given_no_margin_and_full_rate_are_bit_identical():
    plain = json.dumps(tables(car()))
    assert json.dumps(tables(car(noise_margin=0, rate=[1.0] * 5))) == plain


def test_thresholds_given_a_margin_grow_in_every_method():
    before, after = tables(car()), tables(car(noise_margin=0.5))
    assert after["guard"]["tables"]["k"] > before["guard"]["tables"]["k"]
    for name in ("lasso", "canonical"):
        assert after[name]["info"]["gamma"] > before[name]["info"]["gamma"]
    for old, new in zip(before["decentral"]["tables"]["ranking"]["thr"],
                        after["decentral"]["tables"]["ranking"]["thr"], strict=True):
        assert new > old
    assert np.all(np.array(after["bank"]["tables"]["scale"])
                  < np.array(before["bank"]["tables"]["scale"]))
    assert after["kalman"] == before["kalman"]


def test_largest_given_few_sensors_is_the_maximum_over_the_corners():
    generator = np.random.default_rng(5)
    M, bounds = generator.standard_normal((4, 6)), generator.uniform(0.1, 1.0, 6)
    corners = [np.linalg.norm(M @ (bounds * s)) for s in product((-1.0, 1.0), repeat=6)]
    assert margin.largest(M, bounds) == pytest.approx(max(corners), rel=1e-12)


def test_largest_given_many_sensors_bounds_it():
    generator = np.random.default_rng(6)
    M, bounds = generator.standard_normal((5, 20)), np.ones(20)
    tried = np.linalg.norm(M @ np.sign(generator.standard_normal((20, 5000))), axis=0).max()
    assert tried <= margin.largest(M, bounds) <= 2.0 * tried


def test_chi2_threshold_given_no_shift_is_the_central_one():
    assert margin.chi2_threshold(1e-3, 12, 0.0) == chi2.threshold(1e-3, 12)
    assert ncx2.sf(margin.chi2_threshold(1e-3, 12, 3.0), 12, 9.0) == pytest.approx(1e-3, rel=1e-6)


@pytest.mark.parametrize("period", [math.inf, 1000.0, 100.0, 20.0])
def test_guard_given_a_disturbance_within_the_margin_keeps_below_k(period):
    """Every corner of the box, constant or as a sine: l moves by no more than k does."""
    plant = car(noise_margin=0.7)
    kalman = steady_state(plant.A, plant.C, plant.W, plant.R)
    bank = filters(plant, guard_order.reduced(np.linalg.eigvals(kalman.Acl), plant.n))
    fusion = guard_fusion.fuse(bank)
    bounds = 0.7 * np.sqrt(np.diag(plant.R))
    moved = np.zeros((plant.m * fusion.r, plant.m))
    for i in range(plant.m):
        moved[fusion.rows(i), i] = simulate_disturbed(
            fusion.Lam[i], fusion.b[i], bounds[i], lambda k: math.cos(2.0 * math.pi * k / period))
    allowed = guard.disturbed(plant, fusion).max()
    l = fusion.S @ moved
    worst = max(np.linalg.norm((l @ s).reshape(plant.m, -1), axis=1).max()
                for s in product((-1.0, 1.0), repeat=plant.m))
    assert worst <= allowed * (1.0 + 1e-9)
    if period == math.inf:
        assert worst == pytest.approx(allowed, rel=1e-6)


def test_decentral_given_the_worst_disturbance_alarms_as_often_as_designed():
    plant = car(noise_margin=0.5)
    made = tables(plant, ["decentral"])["decentral"]
    local = local_filters(plant)
    N, bounds = fuse(local).N, 0.5 * np.sqrt(np.diag(plant.R))
    settled = np.zeros((len(local.K), plant.m))
    for i, F in enumerate(local.F):
        rows = local.rows(i)
        settled[rows, i] = simulate_disturbed(F, local.K[rows], bounds[i], lambda k: 1.0)
    worst = max((N @ settled @ s for s in product((-1.0, 1.0), repeat=plant.m)),
                key=np.linalg.norm)
    z = np.random.default_rng(7).standard_normal((200_000, len(N))) + worst
    threshold = made["tables"]["ranking"]["thr"][made["tables"]["ranking"]["removed"].index(0)]
    alarms = np.mean(np.sum(z**2, axis=1) > threshold)
    assert alarms == pytest.approx(1e-3, rel=0.3)


def test_rate_given_a_sensor_that_sends_seldom_weighs_its_samples():
    """In the long run a gain of K / q on a share q of the steps tells what K tells in all."""
    slow = car(rate=[1.0, 1.0, 0.25, 1.0, 1.0])
    served, kalman = gaps.averaged(slow)
    S = slow.C @ kalman.Pp @ slow.C.T + slow.R
    assert served.R[2, 2] == pytest.approx(slow.R[2, 2] + 3.0 * S[2, 2], rel=1e-9)
    found = np.array(tables(slow, ["kalman"])["kalman"]["tables"]["K"]).reshape(2, 5)
    np.testing.assert_allclose(found[:, 2], 4.0 * kalman.K[:, 2], rtol=1e-12)
    np.testing.assert_allclose(found[:, 0], kalman.K[:, 0], rtol=1e-12)


def test_decentral_given_a_rate_waits_longer_for_the_sensor():
    gaps = [tables(car(**plant), ["decentral"])["decentral"]["tables"]["max_gap"]
            for plant in ({}, {"rate": [1.0, 1.0, 0.25, 1.0, 1.0]})]
    assert gaps == [3, 12]


@pytest.mark.parametrize("plant, message", [
    ({"rate": [1.0, 0.0, 1.0, 1.0, 1.0]}, "rate is 0 for y2"),
    ({"rate": [1.0, 1.5, 1.0, 1.0, 1.0]}, "rate is 1.5 for y2"),
    ({"rate": [1.0]}, "rate has 1 numbers, expected 5"),
    ({"noise_margin": -1.0}, "noise_margin must be a positive number"),
    ({"noise_margin": "much"}, "noise_margin must be a positive number"),
])
def test_model_given_a_wrong_rate_or_margin_refuses(plant, message):
    with pytest.raises(ModelError, match=message):
        car(**plant)


def test_decentral_given_a_rate_and_recursive_gains_refuses():
    slow = model.parse(CAR | {"plant": CAR["plant"] | {"rate": [0.5] * 5},
                              "method": {"decentral": {"gains": "recursive"}}}, "slow")
    with pytest.raises(DesignError, match="plant.rate needs gains"):
        tables(slow, ["decentral"])


def test_options_of_decentral_still_take_a_gap():
    from blw.decentral import Options
    assert options.parse(Options, {"max_gap": 7}, "m").max_gap == 7
