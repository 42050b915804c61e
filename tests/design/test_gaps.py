# SPDX-License-Identifier: MIT
"""Constant gains for sensors that send in a share of the steps."""

import json
from dataclasses import replace

import numpy as np
import pytest

from blw import design, gaps, lasso, model
from blw.decentral_filters import local_filters
from blw.errors import DesignError
from blw.kalman import steady_state
from blw.methods import REGISTRY

#: A slow oscillation and a fast mode, seen by sensors whose differences matter: with the gains for
#: complete samples the filter is unstable when one of them is silent now and then.
TURN = 0.3
PLANT = {
    "name": "seldom", "dt_s": 0.1,
    "plant": {"A": [[0.99 * np.cos(TURN), -0.99 * np.sin(TURN), 0.1],
                    [0.99 * np.sin(TURN), 0.99 * np.cos(TURN), 0.0], [0.0, 0.0, 0.6]],
              "C": [[1.0, 0.2, 1.0], [1.0, -0.2, 0.9], [-0.9, 0.4, 1.0], [0.5, 1.0, 0.3],
                    [0.3, 1.1, -0.5], [1.0, 0.0, 0.2]],
              "Q": [0.3, 0.3, 1.0], "R": [0.1, 0.1, 0.2, 0.1, 0.2, 0.3],
              "rate": [0.4, 0.4, 0.5, 0.4, 0.9, 0.3]},
    "attack": {"p": 1},
}
SEEN = ["kalman", "lasso", "canonical", "decentral", "bank", "guard"]


def plant(name="seldom", **changed) -> model.Model:
    return model.parse(PLANT | {"name": name, "plant": PLANT["plant"] | changed}, name)


def simulated_covariance(of, K, runs=20_000, steps=60):
    """[n x n] of the error with random gaps, over many runs at once."""
    generator = np.random.default_rng(1)
    L_w, L_v = np.linalg.cholesky(of.W), np.linalg.cholesky(of.R)
    e = np.zeros((runs, of.n))
    for _ in range(steps):
        sent = generator.random((runs, of.m)) < of.rate
        e = e @ of.A.T + generator.standard_normal((runs, of.n)) @ L_w.T
        y = e @ of.C.T + generator.standard_normal((runs, of.m)) @ L_v.T
        e = e - (sent * y) @ K.T
    return e.T @ e / runs


def test_covariance_given_one_sensor_is_that_of_a_simulation():
    one = model.parse(PLANT | {"attack": {"p": 0}, "plant": PLANT["plant"] | {
        "C": [[1.0, 0.2, 1.0]], "R": [0.1], "rate": [0.4]}}, "one")
    served, kalman = gaps.averaged(one)
    K = kalman.K * one.weight
    P = gaps.covariance(one.A, one.C, one.W, one.R, one.rate, K)
    np.testing.assert_allclose(np.diag(simulated_covariance(one, K)), np.diag(P), rtol=0.05)
    np.testing.assert_array_equal(served.sample_R, one.R)


def test_averaged_filter_knows_its_error_and_has_the_smallest():
    """P of the Riccati equation with R_gaps is that of its gains; no gain nearby has a smaller."""
    slow = plant()
    _, kalman = gaps.averaged(slow)
    K = kalman.K * slow.weight

    def error(gain):
        return gaps.covariance(slow.A, slow.C, slow.W, slow.R, slow.rate, gain)

    np.testing.assert_allclose(error(K), kalman.P, rtol=1e-8)
    generator = np.random.default_rng(3)
    for _ in range(20):
        other = K * (1.0 + 1e-2 * generator.standard_normal(K.shape))
        assert np.linalg.eigvalsh(error(other) - kalman.P)[0] > -1e-12


def test_averaged_given_full_rates_is_the_plain_filter_bit_by_bit():
    full = plant(rate=[1.0] * 6)
    served, kalman = gaps.averaged(full)
    np.testing.assert_array_equal(served.R, full.R)
    np.testing.assert_array_equal(kalman.K, steady_state(full.A, full.C, full.W, full.R).K)


def test_covariance_given_gains_that_gaps_make_unstable_has_none():
    """1 / q times the gain for R / q: right in the mean, but every sample overshoots."""
    slow = plant(Q=[30.0, 30.0, 30.0], rate=[0.2] * 6)
    K = steady_state(slow.A, slow.C, slow.W, 5.0 * slow.R).K * 5.0
    arguments = slow.A, slow.C, slow.W, slow.R, slow.rate
    assert gaps.covariance(*arguments, K) is None
    assert gaps.covariance(*arguments, gaps.averaged(slow)[1].K * 5.0) is not None


def test_averaged_given_an_unstable_plant_that_sends_too_seldom_refuses():
    fast = plant(A=[[1.5, 0.0, 0.0], [0.0, 0.9, 0.0], [0.0, 0.0, 0.5]], rate=[0.1] * 6)
    with pytest.raises(DesignError, match="seldom: kalman: the sensors send too seldom"):
        design.design_all(fast, ["kalman"])


def test_cautious_keeps_the_filter_where_gaps_do_no_harm():
    calm = plant(Q=[1e-6] * 3, rate=[0.9] * 6)
    kalman = steady_state(calm.A, calm.C, calm.W, calm.R)
    assert gaps.cautious(calm, kalman) == (calm, kalman)


def harsh_plant() -> model.Model:
    """Two sensors whose difference is taken: one of them alone pushes the wrong way."""
    return plant(C=[[1.0, 0.2, 20.0], [1.0, -0.2, 19.0], [-0.9, 0.4, 1.0]], R=[1e-3, 1e-3, 0.2],
                 rate=[0.3, 0.4, 1.0])


def tables(of: model.Model, method: str) -> str:
    made = design.document(design.design_all(of, [method]))
    return json.dumps(made["methods"][method]["tables"])


def test_cautious_takes_smaller_gains_where_gaps_make_the_filter_worse():
    harsh = harsh_plant()
    kalman = steady_state(harsh.A, harsh.C, harsh.W, harsh.R)
    served, careful = gaps.cautious(harsh, kalman)
    arguments = harsh.A, harsh.C, harsh.W, harsh.R, harsh.rate
    assert careful is not kalman
    assert (np.diag(served.R) > np.diag(harsh.R)).sum() == 2
    P = gaps.covariance(*arguments, kalman.K)
    assert P is None or np.trace(P) > np.trace(gaps.covariance(*arguments, careful.K))


def test_lasso_is_designed_for_the_gains_that_cautious_takes():
    harsh = harsh_plant()
    kalman = steady_state(harsh.A, harsh.C, harsh.W, harsh.R)
    expected = lasso.design(*gaps.cautious(harsh, kalman), lasso.Options())
    assert tables(harsh, "lasso") == json.dumps(expected.tables.to_json())
    assert tables(harsh, "lasso") != tables(replace(harsh, rate=np.ones(3)), "lasso")


def test_guard_counts_every_sample_once_where_it_does_not_fuse_all_modes():
    calm = plant(Q=[1e-6] * 3, rate=[0.9] * 6)
    full = replace(calm, rate=np.ones(6))
    slow = {"A": [[1.0, 0.1, 0.0], [0.0, 0.99, 0.0], [0.0, 0.0, 0.95]]}
    assert tables(calm, "guard") == tables(full, "guard")
    assert tables(plant(**slow), "guard") != tables(plant(**slow, rate=[1.0] * 6), "guard")


def test_decentral_takes_the_gaps_about_the_central_filter():
    """Smaller gains than for R, larger than for R_gaps about the local filter's own error."""
    slow = plant()
    served, _ = gaps.averaged(slow)
    local = local_filters(served)
    one = slice(0, 1)
    plain, own = (gaps.steady(slow.A, slow.C[one], slow.W, slow.R[one, one], weight)[0]
                  for weight in (np.ones(1), slow.weight[one]))
    rows = local.rows(0)
    gain = slow.C[0] @ local.Phi[rows].T @ local.K[rows]
    assert (slow.C[one] @ own.K)[0, 0] < 0.95 * gain < 0.9 * (slow.C[one] @ plain.K)[0, 0]


def test_canonical_given_gaps_takes_its_steadiest_coordinates():
    def growth(choice: str, **changed) -> float:
        of = replace(plant(**changed), methods={"canonical": {"coordinates": choice}})
        made = design.design_all(of, ["canonical"])
        return made.methods["canonical"].info["coordinates_growth"]

    assert growth("auto") == growth("steady") < growth("jordan")
    assert growth("auto", rate=[1.0] * 6) == growth("jordan", rate=[1.0] * 6)


def test_every_method_says_what_it_makes_of_gaps():
    assert {module.GAPS for module in REGISTRY.values()} == {"weighted", "counted once", "ignored"}


def test_design_given_rates_serves_fast_and_slow_modes():
    made = design.design_all(plant(), SEEN)
    full = design.design_all(plant(rate=[1.0] * 6), SEEN)
    assert set(made.methods) == set(SEEN)
    for whole in (made, full):
        assert whole.methods["guard"].info["secure_modes"] == 2
    assert json.loads(design.json_text(design.document(made)))["methods"]["kalman"]["info"]["P"]


def test_canonical_given_gaps_and_estimates_that_grow_refuses():
    near = plant(A=[[0.98, 0.001, 0.0], [0.0, 0.981, 0.001], [0.001, 0.0, 0.979]])
    with pytest.raises(DesignError, match="samples are missing .*use guard or decentral"):
        design.design_all(near, ["canonical"])
    assert "canonical" in design.design_all(plant(A=near.A.tolist(), rate=[1.0] * 6),
                                            ["canonical"]).methods
