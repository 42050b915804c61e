# SPDX-License-Identifier: MIT
"""Local filters: identities of [L], golden tables, printed figures, refusals."""

import golden
import numpy as np
import pytest

from blw import kalman, model
from blw import local_filters as lf
from blw.errors import DesignError
from blw.jordan_form import jordan_form

GOLDEN = ("paper0", "complex", "jordanA", "paper1")


def relative(actual, expected):
    return np.abs(actual - expected).max() / np.abs(expected).max()


def assert_identities(plant, gains, filters, tolerance=1e-11):
    r, m, G, F = filters.r, plant.m, filters.G, filters.F
    J = np.kron(np.eye(m), filters.form.J)
    bC = np.kron(plant.C, filters.form.b[:, None])
    N = (G - bC) @ plant.B
    b_all = np.kron(np.eye(m), filters.form.b[:, None])
    assert relative(F @ G, np.eye(plant.n)) < tolerance
    assert np.abs(F @ J - gains.Acl @ F).max() < tolerance * np.abs(F).max()
    assert relative(F @ b_all, gains.K) < tolerance
    assert np.abs(J @ G - G @ plant.A + bC @ plant.A).max() < tolerance * np.abs(G).max()
    assert relative(F @ filters.W, gains.P @ G.T) < tolerance
    Xi = N @ plant.Q @ N.T + np.kron(plant.R, np.outer(filters.form.b, filters.form.b))
    assert relative(J @ filters.W @ J.T + Xi, filters.W) < tolerance
    assert relative(filters.D, (G - bC) @ plant.Bu) < tolerance
    assert filters.W.shape == (m * r, m * r)


@pytest.mark.parametrize("name", GOLDEN)
def test_local_filters_given_golden_system_reproduce_its_tables(name):
    data, plant, gains = golden.load(name)
    filters = lf.local_filters(plant, gains)
    expected = data["jordan"]
    found = {"Lam": filters.form.J, "b": filters.form.b, "G": filters.G, "F": filters.F,
             "W": filters.W}
    for key, table in found.items():
        assert relative(table, np.array(expected[key])) < 1e-11, key


@pytest.mark.parametrize("name", GOLDEN)
def test_local_filters_given_golden_system_satisfy_the_identities(name):
    _, plant, gains = golden.load(name)
    assert_identities(plant, gains, lf.local_filters(plant, gains))


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("n, m", [(1, 3), (2, 3), (3, 5), (4, 6), (5, 7), (6, 8)])
def test_local_filters_given_random_system_satisfy_the_identities(n, m, seed):
    plant, gains = golden.random_plant(n, m, seed)
    assert_identities(plant, gains, lf.local_filters(plant, gains))


@pytest.mark.parametrize("detuning", [0.0, 1e-12, 1e-9, 1e-6, 1e-4, 1e-3, 1e-2])
def test_local_filters_given_axes_ever_less_alike_satisfy_the_identities(detuning):
    plant, gains = golden.two_axes(detuning)
    filters = lf.local_filters(plant, gains)
    assert_identities(plant, gains, filters, 2e-11)
    assert filters.r == (2 if detuning <= 1e-12 else 4)


def test_local_filters_given_near_eigenvalues_minimise_cond_W():
    plant, gains = golden.two_axes(1e-3)
    chosen = lf.local_filters(plant, gains)
    distinct = lf.filters_for(plant, gains, jordan_form(gains.Acl, 1e-10))
    assert distinct.cond_W > 1e3 * chosen.cond_W
    assert [block.length for block in chosen.form.blocks] == [2, 2]


def test_local_filters_given_torsion_plant_cluster_coarsely():
    """Gaps of 2e-3 and 7e-3: cond(W) 5.8e16 as distinct eigenvalues, 6.5e7 as one chain."""
    loaded = model.load(golden.MODELS / "torsion.toml")
    gains = kalman.steady_state(loaded.A, loaded.C, loaded.W, loaded.R)
    filters = lf.local_filters(loaded, gains)
    assert filters.cond_W < 1e9
    assert [block.length for block in filters.form.blocks] == [3, 1, 1, 1]
    assert_identities(loaded, gains, filters, 1e-9)


def test_local_filters_given_data_sum_to_the_kalman_trajectory():
    plant, gains = golden.random_plant(5, 7, 11)
    filters = lf.local_filters(plant, gains)
    generator = np.random.default_rng(1)
    x_hat, zeta = np.zeros(plant.n), np.zeros(plant.m * filters.r)
    J = np.kron(np.eye(plant.m), filters.form.J)
    for _ in range(300):
        u, y = generator.standard_normal(plant.l), generator.standard_normal(plant.m)
        x_bar = plant.A @ x_hat + plant.Bu @ u
        x_hat = x_bar + gains.K @ (y - plant.C @ x_bar)
        zeta = J @ zeta + np.kron(y, filters.form.b) + filters.D @ u
        assert np.abs(filters.F @ zeta - x_hat).max() < 1e-11 * max(1.0, np.abs(x_hat).max())


def test_local_filters_given_paper_example_match_the_printed_figures():
    """[L] section VI, four digits."""
    _, plant, gains = golden.load("paper0")
    filters = lf.local_filters(plant, gains)
    assert np.allclose(gains.K, [[0.2443, 0.0431, 0.1942, 0.2693, -0.0885],
                                  [-0.0838, 0.2494, 0.1469, -0.1991, 0.0846],
                                  [0.1175, -0.4272, 0.2265, 0.0629, 0.1955]], atol=5.1e-5)
    assert np.allclose(gains.P, [[0.2443, -0.0838, 0.1175], [-0.0838, 0.1879, -0.1452],
                                  [0.1175, -0.1452, 0.3995]], atol=5.1e-5)
    printed = {0: [[0.7783, 0, 0], [1.1187, 0, 0], [1.2384, 0, 0]],
               1: [[0.7783, 0.7783, -1.1660], [1.1187, 1.1187, -0.9496],
                   [1.2384, 1.2384, -0.9122]],
               2: [[0.7783, 1.5567, 1.1660], [1.1187, 2.2373, 0.9496],
                   [1.2384, 2.4768, 0.9122]],
               3: [[0.7783, -0.7783, -0.5830], [1.1187, -1.1187, -0.4748],
                   [1.2384, -1.2384, -0.4561]],
               4: [[-0.3892, 0.7783, 1.1660], [-0.5593, 1.1187, 0.9496],
                   [-0.6192, 1.2384, 0.9122]]}
    for i, G_i in printed.items():
        assert np.allclose(filters.G[3 * i : 3 * i + 3], G_i, atol=5.1e-5)
    assert filters.cond_W == pytest.approx(4.7e3, rel=0.01)


def test_local_filters_given_pendulum_have_the_known_cond_W():
    _, plant, gains = golden.load("paper1")
    assert lf.local_filters(plant, gains).cond_W == pytest.approx(1.6e6, rel=0.02)


def test_local_filters_given_singular_A_refuse_with_the_number():
    plant, gains = golden.build("singular", {
        "A": [[0.9, 0.0], [0.0, 0.0]], "C": [[1.0, 0.0], [0.0, 1.0], [1.0, 1.0]],
        "Q": [1.0, 1.0], "R": [1.0, 1.0, 1.0]})
    with pytest.raises(DesignError, match=r"A is singular \(smallest .*\).*guard"):
        lf.local_filters(plant, gains)


def test_local_filters_given_unseen_stable_mode_refuse_by_name():
    plant, gains = golden.build("unseen", {
        "A": [[0.9, 0.0], [0.0, 0.5]], "C": [[1.0, 0.0], [2.0, 0.0]],
        "Q": [1.0, 1.0], "R": [1.0, 1.0]})
    with pytest.raises(DesignError, match=r"share the eigenvalue 0\.5 \(gap .*guard"):
        lf.local_filters(plant, gains)


def test_local_filters_given_ten_states_refuse_indefinite_W():
    plant, gains = golden.random_plant(10, 16, 0)
    with pytest.raises(DesignError, match=r"not positive definite.*10 Jordan states.*guard"):
        lf.local_filters(plant, gains)
