# SPDX-License-Identifier: MIT
"""Method guard: identities of its design, and the C library against reference and claims."""

import os

import golden
import guard_library
import numpy as np
import pytest
import scipy.linalg
from c_library import BOUND, CONVERGED, KALMAN, MISSING, WARMING_UP
from guard_library import GuardLibrary
from guard_plants import (
    PLANTS,
    colluding_plant,
    delays,
    liu5,
    pendulum,
    seeded,
    shared,
    simulate,
    trace_without,
)

from blw import guard, guard_filters, guard_fusion, guard_order, kalman, model
from blw.errors import DesignError, ModelError

GOLDEN = [("paper0", "3"), ("paper0", "2"), ("complex", "3"), ("complex", "2"),
          ("jordanA", "3"), ("paper1", "3")]


@pytest.fixture(scope="module")
def libraries(tmp_path_factory):
    folder = tmp_path_factory.mktemp("guard")
    return {width: guard_library.compile_library(folder, width) for width in ("f32", "f64")}


@pytest.mark.parametrize("name", PLANTS)
def test_fusion_given_any_detectable_plant_equals_the_kalman_filter(name):
    plant, gains = PLANTS[name]()
    bank = guard_filters.filters(plant, np.linalg.eigvals(gains.Acl))
    fusion = guard_fusion.fuse(bank)
    F = guard.estimate_of(bank, fusion)
    variance = np.diag(gains.P)  # 0 within rounding of what no noise moves
    sigma = np.sqrt(np.where(variance > 1e-20, variance, variance.max()))
    generator = np.random.default_rng(11)
    eta, x_hat = np.zeros(bank.N), np.zeros(plant.n)
    x_ref = np.zeros(plant.n)
    Lam = scipy.linalg.block_diag(*fusion.Lam)
    errors = []
    for _ in range(200):
        x_bar = plant.A @ x_ref
        y = plant.C @ plant.A @ x_hat + generator.standard_normal(plant.m)
        eta = Lam @ eta + (fusion.b * (y - plant.C @ x_bar)[:, None]).ravel()
        prior = plant.A @ x_hat
        x_hat = prior + gains.K @ (y - plant.C @ prior)
        errors.append(np.abs(x_bar + F @ eta - x_hat) / sigma)
        d = fusion.Fu @ eta
        x_ref = x_bar + bank.split.Xu @ d
        eta = eta - fusion.Gu @ d
    assert np.max(errors) < (1e-10 if name in ("large", "delays") else 1e-11)
    assert guard_order.trace_P(bank) == pytest.approx(np.trace(gains.P), rel=1e-7)


@pytest.mark.parametrize("name", PLANTS)
def test_filters_given_any_plant_are_input_normal_and_whitened(name):
    plant, gains = PLANTS[name]()
    bank = guard_filters.filters(plant, np.linalg.eigvals(gains.Acl))
    fusion = guard_fusion.fuse(bank)
    normal = bank.Lam @ bank.Lam.T + np.outer(bank.b, bank.b)
    assert np.abs(normal - np.eye(bank.r)).max() < 1e-12
    assert np.linalg.eigvalsh(bank.W)[0] >= 0.999 * np.linalg.eigvalsh(plant.R)[0]
    if bank.split.n_u:
        assert np.abs(fusion.S @ fusion.Gu).max() < 1e-9 * max(1.0, np.abs(fusion.Gu).max())
        assert np.abs(fusion.Fu @ fusion.Gu - np.eye(bank.split.n_u)).max() < 1e-8
    for i, rank in enumerate(fusion.rank):
        expected = np.diag((np.arange(bank.r) < rank).astype(float))
        assert np.abs(fusion.S[fusion.rows(i), fusion.rows(i)] - expected).max() < 1e-9


def test_filters_given_a_shared_stable_mode_take_it_out_of_the_secure_ones():
    plant, gains = shared()
    bank = guard_filters.filters(plant, np.linalg.eigvals(gains.Acl))
    assert bank.split.n_u == 1
    assert guard_filters.filters(plant, np.array([0.1, 0.2])).split.n_u == 2


def test_filters_given_too_many_rows_refuse():
    plant, _ = seeded(3, 40, 8)
    with pytest.raises(DesignError, match="set method.guard.order"):
        guard_filters.filters(plant, np.linspace(-0.5, 0.5, 30))


@pytest.mark.parametrize("width, tolerance", [("f64", 1e-8), ("f32", 1e-3)])
@pytest.mark.parametrize("name, k", GOLDEN)
def test_library_given_golden_systems_reproduces_them(libraries, name, k, width, tolerance):
    data, plant, gains = golden.load(name)
    reference = data["glr"]["k"][k]
    sigma = np.sqrt(np.diag(gains.P))
    for key, exclude in (("x_huber", 1e9), ("x_hybrid", reference["tau_hi"])):
        designed = guard.design(plant, gains, guard.Options(k=float(k), exclude=exclude))
        found = GuardLibrary(libraries[width], plant, gains, designed).run(data["y"], data["u"])
        assert np.abs((found["x_hat"] - reference[key]) / sigma).max() < tolerance
        assert np.array_equal(found["outcome"] == KALMAN, reference["certificate"])
        assert set(found["outcome"]) <= {KALMAN, CONVERGED}
        assert not found["iterations"][found["outcome"] == KALMAN].any()
    masks = [sum(1 << i for i in excluded) for excluded in reference["excluded"]]
    assert np.array_equal(found["excluded"], masks)


def mean_square(found, x, skip=100):
    return np.mean(np.sum((found["x_hat"] - x)[skip:] ** 2, axis=1))


@pytest.mark.parametrize("wanted", [0.9, 0.99])
def test_library_given_no_attack_is_the_kalman_filter_as_often_as_designed(libraries, wanted):
    plant, gains, feedback = liu5()
    designed = guard.design(plant, gains, guard.Options(recovery_probability=wanted))
    y, u, _ = simulate(plant, 30_000, 5, np.array(feedback))
    found = GuardLibrary(libraries["f32"], plant, gains, designed).run(y, u)
    assert np.mean(found["outcome"] == KALMAN) == pytest.approx(wanted, abs=0.01)


@pytest.mark.parametrize("attacked", range(5))
def test_library_given_a_bias_on_liu5_estimates_as_without_the_sensor(libraries, attacked):
    plant, gains, feedback = liu5()
    designed = guard.design(plant, gains, guard.Options())
    y, u, x = simulate(plant, 10_000, 6, np.array(feedback))
    y[:, attacked] += 100.0
    found = GuardLibrary(libraries["f32"], plant, gains, designed).run(y, u)
    assert mean_square(found, x) <= 1.05 * trace_without(plant, [attacked])
    assert np.all(found["excluded"][100:] == 1 << attacked)


@pytest.mark.parametrize("attacked", range(5))
def test_library_given_a_fake_state_shift_on_liu5_stays_near(libraries, attacked):
    plant, gains, feedback = liu5()
    designed = guard.design(plant, gains, guard.Options())
    y, u, x = simulate(plant, 5_000, 7, np.array(feedback))
    y[100:, attacked] += 1e4 * np.linalg.norm(plant.C[attacked])
    found = GuardLibrary(libraries["f32"], plant, gains, designed).run(y, u)
    assert mean_square(found, x) / np.trace(gains.P) < 3.0


SHAPES = {
    "constant": lambda k: np.ones(len(k)),
    "alternating": lambda k: (-1.0) ** k,
    "unstable mode": lambda k: (-2.0) ** (k % 5) / 4.0,
}


@pytest.mark.parametrize("shape", SHAPES)
def test_library_given_the_worst_magnitude_on_liu5_stays_bounded(libraries, shape):
    """Below the threshold nothing is removed, far above it everything: the worst is between."""
    plant, gains, feedback = liu5()
    designed = guard.design(plant, gains, guard.Options())
    y, u, x = simulate(plant, 700, 5, np.array(feedback))
    ratios = []
    for attacked in range(plant.m):
        for size in (2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 12.0):
            false = y.copy()
            false[50:, attacked] += size * SHAPES[shape](np.arange(650))
            found = GuardLibrary(libraries["f32"], plant, gains, designed).run(false, u)
            ratios.append(mean_square(found, x) / np.trace(gains.P))
    assert 2.0 < max(ratios) < 15.0


@pytest.mark.parametrize("attacked", [0, 1, 2, 3])
def test_library_given_gross_attacks_on_the_pendulum_estimates_as_without_the_sensor(
    libraries, attacked
):
    plant, gains, feedback = pendulum()
    designed = guard.design(plant, gains, guard.Options())
    y, u, x = simulate(plant, 6_000, 8, np.array(feedback))
    generator = np.random.default_rng(9)
    y[50:, attacked] += generator.uniform(-np.pi / 2, np.pi / 2, len(y) - 50)
    found = GuardLibrary(libraries["f32"], plant, gains, designed).run(y, u)
    assert mean_square(found, x) <= 1.1 * trace_without(plant, [attacked])


def test_library_given_two_colluding_sensors_finds_them(libraries):
    plant, gains = colluding_plant()
    designed = guard.design(plant, gains, guard.Options())
    y, u, x = simulate(plant, 3_000, 13)
    ghost = np.array([30.0, 0.0, -20.0, 10.0])
    for k in range(100, len(y)):
        ghost = plant.A @ ghost
        y[k, [2, 5]] += plant.C[[2, 5]] @ ghost
    found = GuardLibrary(libraries["f32"], plant, gains, designed).run(y, u)
    assert mean_square(found, x, 150) <= 1.6 * np.trace(gains.P)
    assert np.mean(found["excluded"][150:] == 0b100100) > 0.95


@pytest.mark.parametrize("seed", [2, 4])
def test_library_given_two_ramps_leaves_both_sensors_out(libraries, seed):
    C = np.random.default_rng(seed).standard_normal((7, 3))
    A = np.diag([0.3, 0.645, 0.99])
    data = {"A": A.tolist(), "C": C.tolist(), "Q": [0.3] * 3, "R": [0.2] * 7}
    plant = model.parse({"name": "two", "dt_s": 0.1, "plant": data, "attack": {"p": 2}}, "two")
    gains = kalman.steady_state(plant.A, plant.C, plant.W, plant.R)
    designed = guard.design(plant, gains, guard.Options())
    assert max(designed.info["ratio"]) < 0.8  # the penalty alone is secure, given time
    y, u, x = simulate(plant, 400, seed + 50)
    ramp = np.linspace(0.0, 200.0, 300) * np.sqrt(0.2)
    y[100:, 0] += ramp
    y[100:, 2] -= ramp
    found = GuardLibrary(libraries["f32"], plant, gains, designed).run(y, u)
    assert np.mean(found["outcome"] == BOUND) < 0.01
    assert np.all(found["excluded"][250:] == 0b101)
    assert mean_square(found, x, 100) <= 1.6 * trace_without(plant, [0, 2])


@pytest.mark.parametrize("search", [0, 1, 2])
def test_library_given_tables_for_two_sensors_does_as_without(libraries, monkeypatch, search):
    plant, gains = colluding_plant()
    generator = np.random.default_rng(91)
    y = simulate(plant, 400, 92)[0]
    for start in range(0, 400, 20):
        liars = generator.choice(plant.m, 2, replace=False)
        y[start : start + 20, liars] += 10.0 * generator.standard_normal((20, 2))
    found = []
    for numbers in (guard_order.PAIR_NUMBERS, 0):
        monkeypatch.setattr(guard_order, "PAIR_NUMBERS", numbers)
        designed = guard.design(plant, gains, guard.Options(max_updates=5000))
        assert designed.tables.members["pairs"] == (1 if numbers else 0)
        designed.tables.members["search"] = search
        found.append(GuardLibrary(libraries["f64"], plant, gains, designed).run(y))
    same = (found[0]["outcome"] != BOUND) & (found[1]["outcome"] != BOUND)
    assert np.mean(same) > 0.9
    assert np.array_equal(found[0]["excluded"][same], found[1]["excluded"][same])
    error = np.abs(found[0]["x_hat"] - found[1]["x_hat"])[same] / np.sqrt(np.diag(gains.P))
    assert error.max() < 1e-6


def test_library_given_a_group_excludes_it_as_one(libraries):
    plant, gains = colluding_plant()
    data = {key: getattr(plant, key).tolist() for key in ("A", "C", "Q", "R")}
    made = model.parse({"name": "group", "dt_s": 0.1, "plant": data,
                        "attack": {"p": 1, "groups": [["y3", "y6"]]}}, "group")
    designed = guard.design(made, gains, guard.Options())
    y, u, x = simulate(made, 2_000, 14)
    y[100:, 2] += 50.0
    found = GuardLibrary(libraries["f32"], made, gains, designed).run(y, None)
    assert np.all(found["excluded"][110:] == 0b100100)
    assert mean_square(found, x, 110) <= 1.1 * trace_without(made, [2, 5])


def attacked_samples(plant, steps, seed):
    """Benign samples plus impulses, biases and noise of every size on changing sensors."""
    y, u, x = simulate(plant, steps, seed, np.array([[0.0, 0.0, -2.0]]))
    generator = np.random.default_rng(seed + 1)
    for start in range(0, steps, 20):
        for i in generator.choice(plant.m, generator.integers(1, plant.m + 1), replace=False):
            size = 10.0 ** generator.uniform(0.0, 6.0)
            y[start : start + 20, i] += size * generator.standard_normal(len(y[start:start + 20]))
    return y, u, x


@pytest.mark.parametrize("limit", [1, 2, 5, None])
def test_library_given_any_attack_keeps_to_the_bound_on_updates(libraries, limit):
    plant, gains, _ = liu5()
    designed = guard.design(plant, gains, guard.Options(max_updates=limit))
    y, u, _ = attacked_samples(plant, 5_000, 20)
    found = GuardLibrary(libraries["f32"], plant, gains, designed).run(y, u)
    assert found["iterations"].max() <= designed.info["max_updates"]
    assert np.isfinite(found["x_hat"]).all() and np.isfinite(found["bound"]).all()
    assert np.all(found["bound"][found["outcome"] == BOUND] > 0.0)


def random_attacks(plant, steps, generator):
    """Noise, and on three sensors in ten attacks of 1 to 1e6 that come and go every five steps."""
    y = generator.standard_normal((steps, plant.m)) @ np.linalg.cholesky(plant.R).T
    held = np.repeat(generator.random((steps // 5, plant.m)) < 0.3, 5, axis=0)
    size = 10.0 ** np.repeat(generator.uniform(0.0, 6.0, (steps // 20, plant.m)), 20, axis=0)
    return y + held * size * generator.standard_normal((steps, plant.m))


@pytest.mark.parametrize("name", ["liu5", "two attackers"])
def test_library_given_random_attacks_never_exceeds_its_bound(libraries, name):
    """50,000 steps each; 1,000,000 with BULWARK_EXTENDED=1."""
    plant, gains = liu5()[:2] if name == "liu5" else colluding_plant()
    designed = guard.design(plant, gains, guard.Options())
    estimator = GuardLibrary(libraries["f32"], plant, gains, designed)
    generator = np.random.default_rng(90)
    chunk, chunks = 10_000, 100 if os.environ.get("BULWARK_EXTENDED") == "1" else 5
    outcomes = set()
    for _ in range(chunks):
        found = estimator.run(random_attacks(plant, chunk, generator), np.zeros((chunk, plant.l)))
        assert found["iterations"].max() <= designed.info["max_updates"]
        assert np.isfinite(found["x_hat"]).all() and np.isfinite(found["bound"]).all()
        assert np.all(found["bound"][found["outcome"] == BOUND] > 0.0)
        outcomes |= set(found["outcome"])
    assert {CONVERGED, BOUND} <= outcomes


def test_library_given_few_updates_states_a_sound_error_bound(libraries):
    plant, gains, _ = liu5()
    y, u, _ = attacked_samples(plant, 3_000, 30)
    full = guard.design(plant, gains, guard.Options(max_updates=2000))
    for limit in (1, 2, 4):
        short = guard.design(plant, gains, guard.Options(max_updates=limit))
        few = GuardLibrary(libraries["f64"], plant, gains, short).run(y, u)
        many = GuardLibrary(libraries["f64"], plant, gains, full).run(y, u)
        same = (few["excluded"] == many["excluded"]) & (few["outcome"] == BOUND)
        first = np.flatnonzero(same)
        error = np.linalg.norm(few["x_hat"] - many["x_hat"], axis=1)
        assert first.size and np.all(error[first] <= few["bound"][first])


@pytest.mark.parametrize("offset, tolerance", [(0.0, 1e-3), (1000.0, 0.05)])
def test_library_in_float_given_the_pendulum_far_away_agrees_with_double(
    libraries, offset, tolerance
):
    plant, gains, feedback = pendulum()
    designed = guard.design(plant, gains, guard.Options())
    y, u, _ = simulate(plant, 2_000, 40, np.array(feedback))
    y[:, :3] += offset
    found = {}
    for width, library in libraries.items():
        estimator = GuardLibrary(library, plant, gains, designed)
        assert estimator.reset([offset, 0.0, 0.0, 0.0]) == 0
        found[width] = estimator.run(y.astype(np.float32), u.astype(np.float32))["x_hat"]
    error = np.abs(found["f32"] - found["f64"]) / np.sqrt(np.diag(gains.P))
    assert error.max() < tolerance


def test_library_in_float_given_ten_states_agrees_with_double(libraries):
    plant, gains = seeded(10, 16, 41)
    designed = guard.design(plant, gains, guard.Options())
    y, u, _ = simulate(plant, 1_000, 42)
    found = {width: GuardLibrary(library, plant, gains, designed).run(y.astype(np.float32), u)
             for width, library in libraries.items()}
    error = np.abs(found["f32"]["x_hat"] - found["f64"]["x_hat"]) / np.sqrt(np.diag(gains.P))
    assert error.max() < 1e-4


def test_library_given_a_wrong_start_warms_up_without_exclusion(libraries):
    plant, gains, feedback = pendulum()
    designed = guard.design(plant, gains, guard.Options())
    warm_up = designed.info["warm_up_steps"]
    y, u, x = simulate(plant, warm_up + 200, 50, np.array(feedback))
    estimator = GuardLibrary(libraries["f32"], plant, gains, designed)
    assert estimator.reset([0.0, 1.0, 0.0, 1.0]) == 0
    found = estimator.run(y, u)
    warming = (found["flags"].astype(int) & WARMING_UP) != 0
    assert np.array_equal(warming, np.arange(len(y)) < warm_up)
    assert not found["excluded"][:warm_up].any()
    assert not found["excluded"].any()


def test_library_given_missing_samples_coasts(libraries):
    plant, gains = delays()
    designed = guard.design(plant, gains, guard.Options())
    y, u, x = simulate(plant, 600, 60)
    valid = np.full(600, 15, np.uint64)
    valid[200:300] = 0b1101
    y[200:300, 1] = np.nan
    found = GuardLibrary(libraries["f32"], plant, gains, designed).run(y, u, valid)
    assert np.all((found["flags"].astype(int) & MISSING != 0) == (valid != 15))
    assert np.all(found["suspicion"][200:300, 1] == 1.0)
    assert mean_square(found, x) <= 1.5 * np.trace(gains.P)


def test_library_given_a_slow_bias_grows_suspicious_without_excluding(libraries):
    plant, gains, feedback = liu5()
    designed = guard.design(plant, gains, guard.Options())
    y, u, _ = simulate(plant, 2_000, 70, np.array(feedback))
    benign = GuardLibrary(libraries["f32"], plant, gains, designed).run(y, u)
    y[1000:, 0] += 2.0
    found = GuardLibrary(libraries["f32"], plant, gains, designed).run(y, u)
    assert np.mean(found["suspicion"][1100:, 0] > 0.5) > 0.5
    assert np.mean(benign["suspicion"] > 0.5) < 0.02


def test_order_given_fewer_states_costs_trace_and_saves_flash():
    plant, gains = seeded(10, 16, 80)
    designed = guard.design(plant, gains, guard.Options())
    rows = {row["order"]: row for row in designed.info["orders"]}
    assert rows[10]["trace_P"] == pytest.approx(np.trace(gains.P), rel=1e-6)
    assert all(row["trace_P"] >= (1 - 1e-9) * rows[10]["trace_P"] for row in rows.values())
    suggested = designed.info["suggested_order"]
    assert rows[suggested]["trace_P"] <= 1.0101 * rows[10]["trace_P"]
    small = guard.design(plant, gains, guard.Options(order=suggested))
    assert small.info["trace_P"] == pytest.approx(rows[suggested]["trace_P"])
    numbers = sum(values.size for values in small.tables.reals())
    assert 4 * numbers == pytest.approx(rows[suggested]["flash_bytes"], rel=0.02)


@pytest.mark.parametrize("poles, order", [
    ([0.1, 0.2, 0.3, 0.9], 2), ([0.5 + 0.1j, 0.5 - 0.1j, 0.4], 1), ([0.3, 0.3, 0.3], 3)])
def test_reduced_given_poles_keeps_them_conjugate_and_inside(poles, order):
    chosen = guard_order.reduced(np.array(poles, complex), order)
    assert chosen.size <= order and np.all(np.abs(chosen) < 1.0)
    assert np.allclose(sorted(chosen, key=lambda z: (z.real, z.imag)),
                       sorted(chosen.conj(), key=lambda z: (z.real, z.imag)))


@pytest.mark.parametrize("options, text", [
    ({"k": 3.0, "recovery_probability": 0.9}, "not both"),
    ({"order": 9}, "order is 9"),
    ({"k": 3.0, "exclude": 2.0}, "exclude is 2"),
])
def test_design_given_contradicting_options_refuses(options, text):
    plant, gains, _ = liu5()
    with pytest.raises(ModelError, match=text):
        guard.design(plant, gains, guard.Options(**options))


def test_ratio_given_one_attacker_is_below_one_for_every_sensor():
    for name in ("random", "derogatory", "complex"):
        plant, gains = PLANTS[name]()
        fusion = guard_fusion.fuse(
            guard_filters.filters(plant, np.linalg.eigvals(gains.Acl)))
        assert guard_fusion.ratios(fusion, plant.units, 1).max() <= 1.0 + 1e-9


def test_design_given_a_mode_that_one_sensor_alone_sees_tells_no_ratio_of_it():
    plant, gains = golden.build("alone", {
        "A": np.diag([0.7, 0.85, 0.999]), "Bu": np.zeros((3, 1)), "Q": 0.1 * np.eye(3),
        "C": [[0.2, 0.4, -0.7], [1.0, 0.0, 0.0], [0.0, 0.3, 0.0]], "R": np.eye(3)})
    figures = guard.design(plant, gains, guard.Options()).info
    assert figures["ratio"] == [None, 0.0, 0.0]
    assert figures["unchecked_sensors"] == ["y1"]
