# SPDX-License-Identifier: MIT
"""Reduced form, thresholds and error-bound constants of the l1 fusion."""

import golden
import numpy as np
import pytest

from blw import admm_tuning, l1, lasso
from blw.errors import DesignError
from blw.local_filters import local_filters

GOLDEN = ("paper0", "complex", "jordanA", "paper1")


def fusion(name):
    data, model, kalman = golden.load(name)
    filters = local_filters(model, kalman)
    groups = l1.sensor_groups(filters.form.groups(), model.m, filters.r)
    return data, model, kalman, filters, groups, l1.reduced(
        filters.W, filters.G, lasso.spans(filters, model.m))


def local_states(data, filters, m):
    """zeta [N x T] of a golden file: y(k) and u(k) in one row, everything 0 before the first."""
    J, zeta, rows = np.kron(np.eye(m), filters.form.J), np.zeros(m * filters.r), []
    for y, u in zip(data["y"], data["u"]):
        zeta = J @ zeta + np.kron(y, filters.form.b) + filters.D @ u
        rows.append(zeta)
    return np.array(rows).T


@pytest.mark.parametrize("name", GOLDEN)
def test_reduced_given_golden_system_satisfies_its_definition(name):
    _, model, _, filters, _, form = fusion(name)
    N, d = form.Z.shape
    assert d == N - model.n
    assert np.abs(form.Z.T @ form.W @ form.Z - np.eye(d)).max() < 1e-11
    assert np.abs(form.Z.T @ form.H).max() < 1e-13 * np.abs(form.H).max()
    assert not np.triu(form.Z, 1).any()
    for span in lasso.spans(filters, model.m):
        assert np.ptp(form.scale[span]) == 0.0
        assert np.mean(np.diag(form.S)[span]) == pytest.approx(1.0)


@pytest.mark.parametrize("name", GOLDEN)
def test_reduced_given_golden_system_reproduces_S_and_groups(name):
    data, _, _, _, groups, form = fusion(name)
    S = form.S * np.outer(form.scale, form.scale)
    expected = np.array(data["jordan"]["S"])
    assert np.abs(S - expected).max() < 1e-10 * np.abs(expected).max()
    assert [list(range(a, b)) for a, b in zip(groups.first[:-1], groups.first[1:])] == [
        group["index"] for group in data["jordan"]["groups"]]
    assert groups.weight == pytest.approx([g["weight"] for g in data["jordan"]["groups"]])


@pytest.mark.parametrize("name", GOLDEN)
def test_thresholds_given_golden_data_pass_at_the_golden_steps(name):
    data, model, _, filters, groups, form = fusion(name)
    zeta = local_states(data, filters, model.m)
    assert zeta[:, -1] == pytest.approx(data["jordan"]["zeta_last"], rel=1e-10)
    norms = groups.norms(form.S @ (form.scale[:, None] * zeta))
    for gamma, expected in data["jordan"]["gamma"].items():
        c = l1.thresholds(form, groups, float(gamma))[:, None]
        assert np.all(norms <= c, axis=0).tolist() == expected["certificate"]


@pytest.mark.parametrize("name, gamma, rho", [
    ("paper0", "0.75", 0.01), ("complex", "3", 0.03), ("jordanA", "10", 0.03),
    ("paper1", "30", 0.03),
])
def test_trajectory_given_golden_data_ends_at_the_golden_estimate(name, gamma, rho):
    data, model, kalman, filters, groups, form = fusion(name)
    expected = data["jordan"]["gamma"][gamma]
    steps = np.flatnonzero(expected["unique"])[::8]
    zeta = form.scale[:, None] * local_states(data, filters, model.m)[:, steps]
    response = np.tile(lasso.steady_response(filters), (model.m, 1))
    problem = admm_tuning.Problem(form, groups, filters.F, float(gamma), response)
    x = admm_tuning.trajectory(problem, zeta, rho, 3000)[-1].T
    error = np.abs(x - np.array(expected["x"])[steps]) / np.sqrt(np.diag(kalman.P))
    assert error.max() < 1e-6


def test_probability_given_paper_example_matches_the_known_values():
    _, _, _, _, groups, form = fusion("paper0")
    samples = l1.recovery_statistic(form, groups)
    assert l1.probability(samples, 0.75) == 0.0
    assert l1.probability(samples, 20.0) == pytest.approx(0.14, abs=0.01)
    assert l1.probability(samples, 50.0) == pytest.approx(0.87, abs=0.01)
    assert np.quantile(samples, 0.9) == pytest.approx(53.0, abs=0.3)


@pytest.mark.parametrize("name", ["complex", "jordanA"])
def test_probability_given_simulated_noise_is_its_pass_rate(name):
    _, _, _, _, groups, form = fusion(name)
    gamma = float(np.quantile(l1.recovery_statistic(form, groups), 0.9))
    generator = np.random.default_rng(8)
    noise = np.linalg.cholesky(form.W) @ generator.standard_normal((form.W.shape[0], 100_000))
    passed = np.all(groups.norms(form.S @ noise)
                    <= l1.thresholds(form, groups, gamma)[:, None], axis=0)
    assert passed.mean() == pytest.approx(0.9, abs=0.005)
    assert 0.3 < l1.union_bound(form, groups, gamma) <= 0.9 + 0.002


@pytest.mark.parametrize("name", GOLDEN)
def test_kappas_given_random_vectors_bound_from_the_right_side(name):
    _, model, _, _, groups, form = fusion(name)
    c = l1.thresholds(form, groups, 2.0)
    kappa_G, kappa_W = l1.kappas(form, groups, c)
    generator = np.random.default_rng(9)
    x = generator.standard_normal((model.n, 2000))
    e = generator.standard_normal((form.Z.shape[1], 2000))
    assert np.all(c @ groups.norms(form.H @ x) >= np.linalg.norm(x, axis=0) / kappa_G)
    assert np.all(c @ groups.norms(form.W @ form.Z @ e) <= kappa_W * np.linalg.norm(e, axis=0))


@pytest.mark.parametrize("seed", range(3))
def test_reduced_given_six_ill_conditioned_states_serves_them(seed):
    model, kalman = golden.random_plant(6, 8, seed)
    filters = local_filters(model, kalman)
    form = l1.reduced(filters.W, filters.G, lasso.spans(filters, model.m))
    assert filters.cond_W > 1e6
    assert np.abs(form.Z.T @ form.H).max() < 1e-12 * np.abs(form.H).max()
    assert np.abs(form.Z.T @ form.W @ form.Z - np.eye(form.Z.shape[1])).max() < 1e-5


def test_reduced_given_other_units_yields_the_same_Z():
    _, model, _, filters, _, form = fusion("complex")
    factor = np.repeat(10.0 ** np.array([-6, 3, 0, 5, -4]), 3)
    other = l1.reduced(filters.W * np.outer(factor, factor), filters.G * factor[:, None],
                       lasso.spans(filters, model.m))
    assert np.allclose(other.Z, form.Z, atol=1e-11)
    assert np.allclose(other.scale * factor, form.scale, rtol=1e-10)


def test_reduced_given_sensor_without_redundancy_zeroes_its_rows():
    model, kalman = golden.two_axes(0.0, sensors=3)
    filters = local_filters(model, kalman)
    form = l1.reduced(filters.W, filters.G, lasso.spans(filters, model.m))
    assert filters.r == 2
    assert form.unchecked.tolist() == [2, 3]
    assert lasso.unchecked_sensors(form, model) == ["y2"]
    assert np.abs(form.Z.T @ form.W @ form.Z - np.eye(form.Z.shape[1])).max() < 1e-11


def test_reduced_given_no_redundancy_refuses():
    with pytest.raises(DesignError, match="2 local states for 2 states"):
        l1.reduced(np.eye(2), np.eye(2), [slice(0, 2)])


def test_reduced_given_indefinite_W_refuses():
    with pytest.raises(DesignError, match="not positive definite"):
        l1.reduced(np.array([[1.0, 2.0], [2.0, 1.0]]), np.ones((2, 1)), [slice(0, 2)])


@pytest.mark.parametrize("N, d", [(1, 1), (3, 1), (3, 2), (5, 3), (6, 5)])
def test_pack_trapezoid_given_any_size_has_the_length_of_the_header(N, d):
    Z = np.tril(np.arange(1.0, N * d + 1.0).reshape(N, d))
    packed = l1.pack_trapezoid(Z)
    assert packed.size == d * (d + 1) // 2 + (N - d) * d
    assert packed.tolist() == [Z[i, j] for i in range(N) for j in range(min(i + 1, d))]


def test_pack_lower_given_a_matrix_packs_by_rows():
    assert l1.pack_lower(np.array([[1.0, 9.0], [2.0, 3.0]])).tolist() == [1.0, 2.0, 3.0]


def test_sensor_groups_given_weights_multiplies_them_in():
    groups = l1.sensor_groups([(0, 1), (1, 2)], 2, 3, np.array([1.0, 1.5]))
    assert groups.first.tolist() == [0, 1, 3, 4, 6]
    assert groups.weight == pytest.approx([1.0, np.sqrt(2.0), 1.5, 1.5 * np.sqrt(2.0)])
    rows = np.array([[3.0], [3.0], [4.0], [0.0], [5.0], [12.0]])
    assert groups.norms(rows).ravel() == pytest.approx([3.0, 5.0, 0.0, 13.0])
    assert groups.spread(np.array([1.0, 2.0, 3.0, 4.0])).tolist() == [1, 2, 2, 3, 4, 4]
