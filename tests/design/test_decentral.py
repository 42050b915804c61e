# SPDX-License-Identifier: MIT
"""`decentral`: tables against [D] without shortcuts, through the C library in both widths."""

from dataclasses import replace

import numpy as np
import pytest
import shared_data
from c_library import BLIND, CONVERGED, DEGRADED, HELD, KALMAN, MISSING, WARMING_UP
from decentral_library import Decentral, compile_library
from decentral_reference import Reference, parse, random_plant, simulate
from golden import shipped
from scipy import stats

from blw import decentral
from blw.decentral_fusion import candidates
from blw.errors import DesignError

Options = decentral.Options


@pytest.fixture(scope="module")
def libraries(tmp_path_factory):
    folder = tmp_path_factory.mktemp("decentral")
    return {width: compile_library(folder, width) for width in ("f32", "f64")}


def estimator(library, plant, kalman_filter, options=None):
    designed = decentral.design(plant, kalman_filter, options or Options())
    return Decentral(library, plant, kalman_filter, designed)


def reference_run(reference, y, u):
    steps = [reference.step(y[k], None if u is None else u[k]) for k in range(len(y))]
    masks = [sum(1 << i for i in gone) for _, _, gone in steps]
    return np.array([x for x, _, _ in steps]), np.array([g for _, g, _ in steps]), masks


@pytest.mark.parametrize("name", ["drone5", "torsion"])
def test_run_given_golden_file_agrees_in_both_widths(libraries, name):
    data = shared_data.golden(f"chi2_{name}")
    plant, filtered = shipped(name)
    designed = decentral.design(plant, filtered, Options(false_alarm=data["delta"]))
    y, x, g = (np.array(data[key]) for key in ("y", "xhat", "g"))
    sets = [sum(1 << i for i in range(plant.m) if i not in data["sets"][j])
            for j in data["J_index"][1:]]
    traces = {tuple(sorted(used)): trace for used, trace in zip(data["sets"], data["Pfus_trace"])}
    for entry in designed.info["sets"]:
        used = tuple(i for i, s in enumerate(plant.sensors) if s not in entry["excluded"])
        assert entry["trace_P"] == pytest.approx(traces[used], rel=1e-9)
    double = Decentral(libraries["f64"], plant, filtered, designed).run(y[1:])
    np.testing.assert_allclose(double.x, x[1:], rtol=1e-9, atol=1e-9 * np.abs(x).max())
    np.testing.assert_allclose(double.g, g[0, 1:], rtol=1e-9)
    assert double.excluded.tolist() == sets
    single = Decentral(libraries["f32"], plant, filtered, designed).run(y[1:])
    sigma = np.sqrt(np.diag(filtered.P))
    np.testing.assert_array_less(np.abs(single.x - x[1:]) / sigma, 2e-3)
    np.testing.assert_allclose(single.g, g[0, 1:], rtol=1e-3)
    assert single.excluded.tolist() == sets


@pytest.mark.parametrize("gains", ["steady", "recursive"])
@pytest.mark.parametrize("n, m, p", [(4, 6, 1), (4, 6, 2), (3, 8, 3), (4, 12, 3)])
def test_run_given_attacks_agrees_with_the_paper_without_shortcuts(libraries, n, m, p, gains):
    plant, filtered = random_plant(n, m, p, seed=5)
    generator = np.random.default_rng(1)
    steps = 45 if m == 12 else 100
    u = generator.standard_normal((steps, plant.l))
    _, y = simulate(plant, filtered, steps, generator, u)
    for j in range(p):
        y[20 + 2 * j:35, (2 * j + 1) % m] += (5.0, 30.0, 1e6)[j]
    reference = Reference(plant, gains=gains, P0=filtered.P)
    warm = 4 if gains == "recursive" else 0
    options = Options(gains=gains)
    for k in range(warm):  # the stacked P is singular at first
        reference._advance(y[k], u[k])
    x, g, masks = reference_run(reference, y[warm:], u[warm:])
    assert len(set(masks)) > 1
    for width, tolerance in (("f64", 1e-9), ("f32", 1e-3)):
        run = estimator(libraries[width], plant, filtered, options).run(y, u)
        assert not np.any(run.flags[warm:] & WARMING_UP)
        assert run.excluded[warm:].tolist() == masks
        np.testing.assert_allclose(run.g[warm:], g, rtol=tolerance)
        error = np.abs(run.x[warm:] - x) / np.sqrt(np.diag(filtered.P))
        np.testing.assert_array_less(error, tolerance)
        assert run.iterations.max() == len(candidates(plant))


def test_run_given_sensors_in_another_order_gives_the_same_estimates(libraries):
    plant, filtered = shipped("torsion")
    _, y = simulate(plant, filtered, 300, np.random.default_rng(7))
    y[150:200, 2] += 0.05
    run = estimator(libraries["f64"], plant, filtered).run(y)
    order = [3, 0, 4, 2, 1]
    moved = replace(plant, C=plant.C[order], R=plant.R[np.ix_(order, order)],
                    offset=plant.offset[order], range=plant.range[order],
                    sensors=[plant.sensors[i] for i in order])
    other = estimator(libraries["f64"], moved, filtered).run(y[:, order])
    # the P of torsion has a condition number of 2.5e8
    np.testing.assert_allclose(other.x, run.x, atol=1e-8 * np.abs(run.x).max())
    np.testing.assert_allclose(other.g, run.g, rtol=1e-7)
    place = {1 << i: 1 << order.index(i) for i in range(plant.m)} | {0: 0}
    assert other.excluded.tolist() == [place[mask] for mask in run.excluded]


@pytest.mark.parametrize("gone", [(), (1,), (0, 4)])
def test_statistic_given_no_attack_has_mu_minus_n_degrees_of_freedom(gone):
    """Independent draws of the stacked error from its own covariance; rejects dof = mu."""
    plant, _ = shipped("drone6")
    reference = Reference(plant)
    samples = 20_000
    L = np.linalg.cholesky(reference.filters.P)
    errors = np.random.default_rng(11).standard_normal((samples, len(L))) @ L.T
    residual = reference.residual(gone)
    g = np.sum((errors @ residual.T)**2, axis=1)
    reference.z = errors[0]
    assert g[0] == pytest.approx(reference.fuse(gone)[1], rel=1e-9)
    dof, mu = reference.dof(gone), reference.dof(gone) + plant.n
    sigma = np.sqrt(2.0 * dof / samples)
    assert g.mean() == pytest.approx(dof, abs=4.0 * sigma)
    assert abs(g.mean() - mu) > 20.0 * sigma
    for rate in (0.05, 0.01, 1e-3):
        sigma = np.sqrt(rate * (1.0 - rate) / samples)
        assert np.mean(g > stats.chi2.isf(rate, dof)) == pytest.approx(rate, abs=4.0 * sigma)
    assert np.mean(g > stats.chi2.isf(0.05, mu)) < 0.02


def test_run_given_no_attack_alarms_at_the_nominal_rate(libraries):
    """The library's own statistic over a long run; neighbours are correlated over some 5 steps."""
    plant, filtered = shipped("drone5")
    _, y = simulate(plant, filtered, 40_000, np.random.default_rng(3))
    run = estimator(libraries["f32"], plant, filtered, Options(readmit=1)).run(y)
    g, dof, correlated = run.g[100:], 16, 5.0
    assert g.mean() == pytest.approx(dof, abs=4.0 * np.sqrt(2.0 * dof * correlated / len(g)))
    for rate in (0.05, 0.01, 1e-3):
        sigma = np.sqrt(rate * correlated / len(g))
        assert np.mean(g > stats.chi2.isf(rate, dof)) == pytest.approx(rate, abs=4.0 * sigma)


@pytest.mark.parametrize("reseed", [False, True])
def test_run_given_a_strong_attack_over_returns_to_all_sensors(libraries, reseed):
    plant, filtered = shipped("drone5")
    for seed in range(5):
        _, y = simulate(plant, filtered, 400, np.random.default_rng(seed))
        y[100:200, seed] += 100.0
        run = estimator(libraries["f32"], plant, filtered, Options(reseed=reseed)).run(y)
        assert np.all(run.excluded[101:200] == 1 << seed)
        back = int(np.argmax(run.excluded[200:] == 0))
        assert 20 - 1 <= back <= (26 if reseed else 45)


def test_run_given_reseeding_torsion_recovers_in_a_fraction_of_the_steps(libraries):
    plant, filtered = shipped("torsion")
    back = {}
    for reseed in (False, True):
        _, y = simulate(plant, filtered, 500, np.random.default_rng(2))
        y[100:250, 2] += 0.1
        run = estimator(libraries["f32"], plant, filtered, Options(reseed=reseed)).run(y)
        assert np.all(run.excluded[101:250] == 4)
        back[reseed] = int(np.argmax(run.excluded[250:] == 0))
    assert 20 <= back[True] + 1 <= 30 < 60 < back[False]


def test_run_given_a_false_alarm_returns_and_a_following_attack_finds_the_true_set(libraries):
    plant, filtered = shipped("drone5")
    for reseed in (False, True):
        for seed in range(5):
            X, y = simulate(plant, filtered, 300, np.random.default_rng(seed))
            y[60, 0] += 12.0 * np.sqrt(plant.R[0, 0])  # one bad sample
            alone = estimator(libraries["f32"], plant, filtered, Options(reseed=reseed)).run(y)
            assert alone.excluded[60] == 1 and alone.excluded[60 + 45] == 0
            y[62:120, 3] += 8.0 * np.sqrt(plant.R[3, 3]) * (1.0 + np.arange(58) / 10.0)
            run = estimator(libraries["f32"], plant, filtered, Options(reseed=reseed)).run(y)
            assert np.all(run.excluded[66:120] == 8)
            error = np.sum((run.x - X)[70:120]**2, axis=1).mean()
            assert error < 3.0 * np.trace(filtered.P)


@pytest.mark.parametrize("name, sensor", [("drone5", 2), ("torsion", 2), ("pendulum", 3)])
def test_run_given_every_set_far_out_picks_the_most_plausible(libraries, name, sensor):
    """g of 5000 and beyond in every candidate: two sensors are off, one of them by far."""
    plant, filtered = shipped(name)
    sigma = np.sqrt(np.diag(plant.R))
    other = (sensor + 1) % plant.m
    for size in (300.0, 3e3, 3e4, 3e5):
        y = np.zeros((1, plant.m))
        y[0, sensor], y[0, other] = 1e3 * size * sigma[sensor], size * sigma[other]
        run = estimator(libraries["f32"], plant, filtered).run(y)
        reference = Reference(plant)
        reference.step(y[0])
        fits = {gone: reference.fuse(gone)[1] for gone in candidates(plant)}
        assert min(fits.values()) > 5000.0 and np.isfinite(run.g).all()
        assert run.outcome[0] == HELD
        assert run.excluded[0] == 1 << reference.excluded[0] == 1 << sensor


def test_run_given_missing_samples_goes_on_and_says_so(libraries):
    plant, filtered = shipped("torsion")
    X, y = simulate(plant, filtered, 600, np.random.default_rng(5))
    everything = (1 << plant.m) - 1
    valid = np.full(600, everything)
    valid[200:300] &= ~(1 << 1)
    valid[400:410] = 0
    y[500:502, 0] = np.nan
    run = estimator(libraries["f32"], plant, filtered).run(y, valid=valid)
    assert np.all(run.suspicion[200:300, 1] == 1.0)
    assert np.all(run.flags[200:300] == MISSING)
    assert np.all(run.excluded[200:203] == 0) and np.all(run.excluded[203:300] == 2)
    assert run.excluded[330] == 0
    assert np.all(run.flags[400:410] & (MISSING | DEGRADED | BLIND) == 7)
    assert np.all(run.flags[500:502] == MISSING)
    assert np.isfinite(run.x).all()
    error = np.sum((run.x - X)**2, axis=1)
    assert error[150:].mean() < 3.0 * np.trace(filtered.P)


def test_run_given_the_unstable_pendulum_survives_the_loss_of_its_best_sensor(libraries):
    plant, filtered = shipped("pendulum")
    gain = np.array([[-0.604, -1.678, -39.514, -9.721]])
    closed = replace(plant, A=plant.A - plant.Bu @ gain)
    X, y = simulate(closed, filtered, 500, np.random.default_rng(6))
    u = -(np.vstack([plant.x0, X[:-1]]) @ gain.T)
    valid = np.full(500, 15)
    valid[150:350] = 7
    run = estimator(libraries["f32"], plant, filtered).run(y, u, valid)
    error = np.sqrt(np.sum((run.x - X)**2, axis=1))
    assert np.sqrt(np.mean(error[170:350]**2)) < 2.0  # coasting alone diverges by 1.53 a step
    assert np.sqrt(np.mean(error[400:]**2)) < 0.5


def test_run_given_spikes_for_long_neither_drifts_nor_breaks(libraries):
    plant, filtered = shipped("drone5")
    generator = np.random.default_rng(9)
    X, y = simulate(plant, filtered, 60_000, generator)
    spikes = generator.random(len(y)) < 0.02
    y[spikes, generator.integers(plant.m, size=spikes.sum())] *= 1e6
    y[::997, 1] = np.nan
    run = estimator(libraries["f32"], plant, filtered, Options(reseed=True)).run(y)
    assert np.isfinite(run.x).all() and np.isfinite(run.g).all()
    error = np.sum((run.x - X)**2, axis=1)
    assert np.median(error[-5000:]) < 3.0 * np.trace(filtered.P)


def test_design_given_printed_variant_keeps_what_the_paper_prints(libraries):
    plant, filtered = shipped("drone5")
    info = decentral.design(plant, filtered, Options(variant="printed")).info
    assert info["false_alarm"] == 0.05 and info["readmit"] == 0
    assert info["sets"][0]["dof"] == 20
    assert info["sets"][0]["threshold"] == pytest.approx(stats.chi2.isf(0.05, 20))
    _, y = simulate(plant, filtered, 400, np.random.default_rng(1))
    y[100:110, 0] += 50.0
    run = estimator(libraries["f32"], plant, filtered, Options(variant="printed")).run(y)
    assert np.all(run.excluded[100:] != 0)  # once left, the full set never comes back


def test_design_given_printed_variant_and_unequal_sets_compares_densities(libraries):
    plant, filtered = shipped("torsion")
    options = Options(variant="printed")
    reference = Reference(plant)
    generator = np.random.default_rng(3)
    designed = decentral.design(plant, filtered, options)
    ranking = designed.tables.members["ranking"].to_json()
    c = np.reshape(ranking["c"], (ranking["n_ranked"], -1))
    assert ranking["n_ranked"] == 2
    for g in np.exp(generator.uniform(1.0, 8.0, (50, 2))):
        dofs = [reference.dof((i,)) + plant.n for i in (3, 0)]
        rows = [ranking["removed"].index(int(reference.filters.mu[i])) for i in (3, 0)]
        score = [value + np.interp(value, ranking["knots"], c[row]) for value, row in zip(g, rows)]
        density = [stats.chi2.logpdf(value, dof) for value, dof in zip(g, dofs)]
        if abs(density[0] - density[1]) > 0.3:
            assert (score[0] < score[1]) == (density[0] > density[1])


def test_design_given_large_P0_warms_up_before_it_tests(libraries):
    plant, filtered = shipped("drone5")
    uncertain = replace(plant, P0=1e4 * np.eye(plant.n))
    designed = decentral.design(uncertain, filtered, Options())
    assert 5 <= designed.info["warm_up"] <= 60
    assert decentral.design(plant, filtered, Options()).info["warm_up"] == 0
    x0 = np.array([100.0, -80.0, 50.0, 120.0])
    _, y = simulate(replace(plant, x0=x0), filtered, 100, np.random.default_rng(4))
    run = Decentral(libraries["f32"], uncertain, filtered, designed).run(y)
    warm = designed.info["warm_up"]
    assert np.all(run.flags[:warm] == WARMING_UP) and not np.any(run.flags[warm:])
    assert not np.any(run.excluded)


@pytest.mark.parametrize("groups, count", [([], 5), ([["y1", "y2"]], 4)])
def test_design_given_groups_leaves_them_out_together(libraries, groups, count):
    generator = np.random.default_rng(0)
    plant, filtered = parse({"A": [[0.9, 0.2], [-0.2, 0.9]], "C": generator.standard_normal((5, 2)),
                             "Q": [0.1, 0.1], "R": [0.2] * 5}, p=1, groups=groups)
    designed = decentral.design(plant, filtered, Options())
    assert designed.tables.members["sets"].members["n_candidates"] == count
    _, y = simulate(plant, filtered, 60, generator)
    y[30:, :2 if groups else 1] += [[30.0, -50.0]] if groups else 30.0
    run = Decentral(libraries["f64"], plant, filtered, designed).run(y)
    assert np.all(run.excluded[30:] == (3 if groups else 1))
    reference = Reference(plant)
    x, g, masks = reference_run(reference, y, None)
    np.testing.assert_allclose(run.x, x, atol=1e-9)
    assert run.excluded.tolist() == masks


def test_design_given_p_0_and_one_sensor_runs_as_a_detector(libraries):
    plant, filtered = parse({"A": [[0.9]], "C": [[1.0], [1.0]], "Q": [0.1], "R": [0.2, 0.2]}, p=0)
    _, y = simulate(plant, filtered, 50, np.random.default_rng(1))
    y[30:, 0] += 20.0
    run = estimator(libraries["f64"], plant, filtered).run(y)
    assert np.all(run.excluded == 0)
    assert run.outcome[29] == KALMAN and np.all(run.outcome[31:] == HELD)


def test_footprint_given_large_problem_is_what_the_tables_hold():
    plant, filtered = random_plant(4, 12, 3, seed=5)
    designed = decentral.design(plant, filtered, Options())
    reals = sum(values.size for values in designed.tables.reals())
    footprint = designed.info["footprint"]
    assert 0 < footprint["flash_bytes"] - 4 * reals < 3000  # index tables
    assert designed.tables.members["sets"].members["n_candidates"] == 220
    small = decentral.design(*random_plant(4, 6, 1, seed=5), Options()).info["footprint"]
    assert footprint["multiply_adds_worst"] > 20 * small["multiply_adds_worst"]


@pytest.mark.parametrize("limit", ["max_flash_bytes", "max_ram_bytes", "max_multiply_adds"])
def test_design_given_limits_that_do_not_hold_refuses_with_the_figures(limit):
    plant, filtered = random_plant(4, 6, 2, seed=5)
    with pytest.raises(DesignError, match=r"more than the limit 100 \(flash_bytes \d+, ram_bytes"):
        decentral.design(plant, filtered, Options(**{limit: 100}))


def test_design_given_too_few_sensors_names_them_and_the_mode():
    plant, filtered = shipped("grid4")
    with pytest.raises(DesignError, match="without y3, y4 no sensor sees the mode 0.9556"):
        decentral.design(plant, filtered, Options())


def test_design_given_a_sensor_of_nothing_names_it():
    plant, filtered = parse({"A": [[0.9]], "C": [[1.0], [0.0], [1.0]], "Q": [1.0], "R": [1.0] * 3},
                            p=0)
    with pytest.raises(DesignError, match="sensor 'y2': its row of C is zero"):
        decentral.design(plant, filtered, Options())


def test_design_given_a_mode_without_noise_refuses():
    plant, filtered = parse({"A": [[0.9, 0.0], [0.0, 0.5]], "C": [[1.0, 1.0]] * 3,
                             "B": [[1.0], [0.0]], "Q": [1.0], "R": [1.0] * 3}, p=1)
    with pytest.raises(DesignError, match="not positive definite|singular"):
        decentral.design(plant, filtered, Options())


def test_design_given_states_in_very_different_units_serves_them():
    plant, filtered = parse({
        "A": [[0.9, 1.7e-3, 0.0], [0.0, 0.0, 3.7e4], [0.0, 0.0, 0.0]],
        "C": [[0.026, 0.0, 17.3], [0.026, 0.0, 17.3], [0.0067, 0.0, 0.0], [0.0, -4.5e-4, -11.2],
              [0.0, -5.1e-5, 39.5], [0.039, 0.0, -13.8], [-0.028, 4.1e-4, 0.0],
              [0.0, -5.1e-5, -9.2]],
        "Q": [2.6, 6.9e5, 6.3e-4], "R": [0.72, 5.1, 1.8, 9.3, 0.65, 1.5, 5.6, 0.37]}, p=2)
    assert np.isfinite(decentral.design(plant, filtered, Options()).info["cond_P"])


def test_design_given_no_redundancy_refuses():
    plant, filtered = parse({"A": [[0.9]], "C": [[1.0]], "Q": [1.0], "R": [1.0]}, p=0)
    with pytest.raises(DesignError, match="1 local states for 1 states: no redundancy"):
        decentral.design(plant, filtered, Options())


def test_design_given_recursive_gains_and_reseed_refuses():
    with pytest.raises(DesignError, match="reseed needs"):
        decentral.design(*shipped("drone5"), Options(gains="recursive", reseed=True))


def test_run_given_recursive_gains_settles_at_the_steady_ones(libraries):
    plant, filtered = shipped("torsion")
    X, y = simulate(plant, filtered, 1500, np.random.default_rng(8))
    runs = [estimator(libraries[width], plant, filtered, Options(gains=gains)).run(y)
            for gains, width in (("steady", "f64"), ("recursive", "f64"), ("recursive", "f32"))]
    warm = runs[1].flags & WARMING_UP != 0
    assert 1 <= warm.sum() <= 12 and not np.any(warm[12:])
    scale = np.sqrt(np.diag(filtered.P))
    np.testing.assert_allclose(runs[1].x[-50:] / scale, runs[0].x[-50:] / scale, atol=2e-2)
    np.testing.assert_allclose(runs[2].x[20:] / scale, runs[1].x[20:] / scale, atol=0.2)
    assert np.all(runs[1].outcome[12:] <= CONVERGED)
