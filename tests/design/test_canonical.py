# SPDX-License-Identifier: MIT
"""Method canonical: transforms, tables, weights, refusals."""

import itertools
import re

import golden
import numpy as np
import pytest
from golden import shipped

from blw import canonical, canonical_form, model, modes, options
from blw.errors import DesignError, ModelError
from blw.local_filters import local_filters

UNEQUAL = [1.0, 1.03, 1.07, 1.13, 1.21, 1.33]


def parts(plant, gains):
    filters = local_filters(plant, gains)
    return filters, canonical_form.choose(filters, modes.modes_of(plant.A, plant.C), "jordan")


@pytest.mark.parametrize("name", ["pendulum", "drone6", "torsion", "grid4"])
def test_transforms_turn_local_states_into_modes_and_white_noise(name):
    plant, gains = shipped(name)
    filters, form = parts(plant, gains)
    n = plant.n
    for i, P in enumerate(form.P):
        rows, observed = slice(i * n, i * n + n), form.observed[i]
        G, W = filters.G[rows] @ form.X, filters.W[rows, rows]
        assert np.abs(P @ G - np.diag(observed)).max() < 1e-6
        noise = P[~observed] @ W @ P.T
        assert np.abs(noise[:, ~observed] - np.eye(noise.shape[0])).max(initial=0.0) < 1e-7
        assert np.abs(noise[:, observed]).max(initial=0.0) < 1e-6  # best linear: uncorrelated


def test_pendulum_angle_sensor_does_not_observe_the_cart():
    plant, _ = shipped("pendulum")
    form = modes.modes_of(plant.A, plant.C)
    assert [mode.multiplicity for mode in form.modes] == [1, 2, 1]
    assert form.observed.tolist() == [[True] * 4] * 3 + [[True, False, False, True]]


def test_chain_is_observed_from_its_first_visible_vector_on():
    plant, _ = golden.build("chain", {
        "A": [[1.0, 0.1, 0.0], [0.0, 1.0, 0.1], [0.0, 0.0, 1.0]], "Bu": np.zeros((3, 1)),
        "C": [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        "Q": np.eye(3), "R": np.eye(3)})
    assert modes.modes_of(plant.A, plant.C).observed.tolist() == [
        [True, True, True], [False, True, True], [False, False, True]]


@pytest.mark.parametrize("name", ["pendulum", "drone6", "torsion"])
def test_tables_run_as_the_device_does_give_the_kalman_trajectory(name):
    plant, gains = shipped(name)
    tables = canonical.design(plant, gains, canonical.Options(gamma=1.0)).tables.to_json()
    jordan, fused = tables["jordan"], tables["l1"]
    r, m, l = jordan["r"], plant.m, plant.l
    J = (np.diag(jordan["J0"]) + np.diag(jordan["J1"][:-1], 1) + np.diag(jordan["J2"][:-2], 2)
         + np.diag(jordan["Jm"][1:], -1))
    P, F = np.array(tables["P"]).reshape(m, r, r), np.array(fused["F"]).reshape(plant.n, -1)
    b, D = np.array(jordan["b"]).reshape(m, r), np.array(jordan["D"] or []).reshape(m, r, l)
    zeta, x_hat = np.zeros((m, r)), np.zeros(plant.n)
    generator = np.random.default_rng(1)
    for _ in range(60):
        y, u = generator.standard_normal(m), generator.standard_normal(l)
        zeta = zeta @ J.T + b * y[:, None] + D @ u
        x_bar = plant.A @ x_hat + plant.Bu @ u
        x_hat = x_bar + gains.K @ (y - plant.C @ x_bar)
        xi = np.einsum("ijk,ik->ij", P, zeta).ravel()
        assert np.abs(F @ xi - x_hat).max() < 1e-7 * max(1.0, np.abs(x_hat).max())


def test_memory_macro_counts_the_transformed_states():
    plant, gains = shipped("pendulum")
    assert canonical.design(plant, gains, canonical.Options(gamma=1.0)).mem == (4, 4, 16, 12, 16, 1)


def test_complex_pairs_are_groups_of_two():
    plant, gains = shipped("drone6")
    designed = canonical.design(plant, gains, canonical.Options(gamma=1.0))
    pairs = sum(mode["im"] > 0 for mode in designed.info["modes"])
    assert pairs > 0
    assert designed.tables.to_json()["l1"]["n_groups"] == plant.m * (plant.n - pairs)


def test_default_weights_have_no_equal_partial_sums():
    plant, gains = shipped("pendulum")
    designed = canonical.design(plant, gains, canonical.Options(gamma=1.0))
    assert designed.info["weights"] == UNEQUAL[:4]
    assert designed.tables.to_json()["ambiguous"] == 0


@pytest.mark.parametrize(("m", "p"), [(6, 1), (12, 1), (12, 2), (14, 5), (64, 9)])
def test_default_weights_vary_by_less_than_the_guarantee_allows(m, p):
    plant = golden.random_plant(2, m, 0)[0]
    weights = canonical.default_weights(model.parse({
        "name": "many", "dt_s": 1.0, "attack": {"p": p},
        "plant": {key: getattr(plant, key).tolist() for key in "ACQR"}}, "many"))
    assert weights.size == m
    assert weights.max() / weights.min() < (p + 1) / p
    assert not canonical.splits_evenly(weights[:14])


def test_splits_evenly_is_what_trying_all_signs_finds():
    generator = np.random.default_rng(2)
    for _ in range(100):
        weights = 1.0 + 0.1 * generator.integers(0, 6, generator.integers(1, 8))
        found = any(abs(np.dot(signs, weights)) < 1e-9
                    for signs in itertools.product((-1, 1), repeat=weights.size))
        assert canonical.splits_evenly(weights) == found


def test_printed_variant_has_weights_one_and_says_that_it_is_ambiguous():
    plant, gains = shipped("pendulum")
    designed = canonical.design(plant, gains, canonical.Options(gamma=1.0, variant="printed"))
    assert designed.info["weights"] == [1.0] * 4
    assert designed.tables.to_json()["ambiguous"] == 1


@pytest.mark.parametrize(("given", "message"), [
    ({"weights": [1.0, 1.1]}, "method.canonical.weights: 2 numbers for 4 sensors"),
    ({"weights": [1.0, -1.1, 1.2, 1.3]}, "weights: must be positive"),
    ({"weights": [1.0, 1.1, 1.2, 2.0]}, "must be less than (p + 1) / p = 2"),
    ({"weights": [1.0, 1.1, 1.2, 1.3], "variant": "printed"}, "has all weights 1"),
    ({"coordinates": "steady", "variant": "printed"}, "has Jordan coordinates"),
    ({"gamma": 1.0, "recovery_probability": 0.9}, "method.canonical: give gamma or"),
])
def test_options_that_do_not_fit_are_refused(given, message):
    plant, gains = shipped("pendulum")
    with pytest.raises(ModelError, match=re.escape(message)):
        canonical.design(plant, gains, canonical.Options(**given))


def test_options_are_those_of_lasso_and_two_more():
    parsed = options.parse(canonical.Options, {"gamma": 2, "weights": [1, 2.5]}, "x")
    assert (parsed.gamma, parsed.weights, parsed.variant) == (2.0, [1.0, 2.5], "corrected")
    with pytest.raises(ModelError, match="'corrected' or 'printed'"):
        options.parse(canonical.Options, {"variant": "old"}, "x")


@pytest.mark.parametrize("name", ["liu5", "axes"])
def test_derogatory_models_are_refused(name):
    plant, gains = golden.two_axes(0.5) if name == "axes" else shipped(name)
    with pytest.raises(DesignError, match="derogatory: its eigenvalue 1 has .* use guard"):
        canonical.design(plant, gains, canonical.Options())


@pytest.mark.parametrize("seed", range(12))
def test_random_models_are_served_or_refused_with_a_reason(seed):
    generator = np.random.default_rng(seed)
    n, m = int(generator.integers(2, 11)), int(generator.integers(3, 17))
    plant, gains = golden.random_plant(n, m, seed)
    try:
        designed = canonical.design(plant, gains, canonical.Options(gamma=1.0))
    except DesignError as error:
        assert "use guard" in str(error)
        return
    designed.tables.check()
    fused = designed.tables.to_json()["l1"]
    F = np.array(fused["F"]).reshape(n, -1)
    assert np.abs(F).max() < 1e6
