# SPDX-License-Identifier: MIT
"""The canonical form: Jordan's coordinates, or others where modes nearly agree."""

import golden
import numpy as np
import pytest

from blw import canonical, canonical_form, modes
from blw.local_filters import local_filters

SHIPPED = ["pendulum", "pendulum_physical", "drone5", "drone6", "torsion", "grid4", "random6"]


def build(A, C):
    """A plant with unit noise, its Kalman filter and its modes."""
    n, m = len(A), len(C)
    return golden.build("plant", {"A": A, "Bu": np.zeros((n, 1)), "C": C, "Q": 0.01 * np.eye(n),
                                  "R": np.eye(m)})


def car(gap):
    """Speed and acceleration; four sensors of both, two of the acceleration."""
    return build([[1.0, 0.02], [0.0, 1.0 - gap]],
                 [[1.0, 0.01], [1.0, -0.02], [1.0, 0.03], [1.0, 0.0], [0.0, 1.0], [0.0, 1.1]])


def chosen(plant, gains, choice):
    filters = local_filters(plant, gains)
    return canonical_form.choose(filters, modes.modes_of(plant.A, plant.C), choice)


@pytest.mark.parametrize("name", SHIPPED)
def test_auto_given_modes_that_can_be_told_apart_keeps_the_jordan_coordinates(name):
    plant, gains = golden.shipped(name)
    form = chosen(plant, gains, "auto")
    assert form.changed == []
    np.testing.assert_array_equal(form.X, form.modes.X)


def test_auto_given_nearly_equal_modes_makes_their_coordinates_orthogonal():
    plant, gains = car(gap=2e-4)
    form = chosen(plant, gains, "auto")
    assert np.linalg.cond(form.modes.X) > 100.0
    assert np.linalg.cond(form.X) == pytest.approx(1.0)
    assert len(form.changed) == 1
    # what the accelerometers do not see is still a coordinate
    unseen = np.flatnonzero(~form.observed[4])
    assert np.abs(plant.C[4:] @ form.X[:, unseen]).max() < 1e-12


def test_auto_given_distant_modes_of_the_same_plant_changes_nothing():
    assert chosen(*car(gap=0.3), "auto").changed == []


@pytest.mark.parametrize("name", SHIPPED)
def test_steady_grows_no_more_than_jordan(name):
    plant, gains = golden.shipped(name)
    jordan, steady = (chosen(plant, gains, choice) for choice in ("jordan", "steady"))
    assert steady.growth <= jordan.growth


def test_growth_is_that_of_a_filter_without_samples():
    plant, gains = car(gap=2e-4)
    form, n = chosen(plant, gains, "jordan"), plant.n
    assert form.growth > 100.0 * chosen(plant, gains, "auto").growth
    # some unit vector grows that much, none by more
    largest = 0.0
    for i, P in enumerate(form.P):
        W = form.filters.W[i * n : i * n + n, i * n : i * n + n]
        scale = np.sqrt(np.diag(P @ W @ P.T))
        for j in range(n):
            zeta = np.linalg.solve(P, np.eye(n)[j] * scale[j])
            for _ in range(16):
                zeta = form.filters.form.J @ zeta
                largest = max(largest, np.abs(P @ zeta / scale).sum())
    assert form.growth == pytest.approx(largest, rel=1e-6)


def test_orthogonal_mixes_only_what_every_observer_may_have_mixed():
    # sensors of one mode each, and one of all: no column may be mixed into another's unseen states
    A = [[0.9, 0.1, 0.1], [0.0, 0.8, 0.1], [0.0, 0.0, 0.7]]
    T = np.linalg.inv(np.linalg.eig(np.array(A))[1])
    plant, gains = build(A, np.vstack([T, T, T, np.ones((1, 3))]))
    form = chosen(plant, gains, "orthogonal")
    np.testing.assert_allclose(plant.C @ form.X != 0.0, plant.C @ form.modes.X != 0.0)
    assert form.changed == []


@pytest.mark.parametrize("name", ["pendulum", "torsion", "grid4", "car", "slow pair"])
def test_transforms_given_orthogonal_coordinates_turn_local_states_into_them(name):
    if name == "car":
        plant, gains = car(gap=1e-3)
    elif name == "slow pair":  # 1 +- 1e-3 i
        plant, gains = build([[1.0, 1e-2], [-1e-4, 1.0]], [[1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
    else:
        plant, gains = golden.shipped(name)
    form = chosen(plant, gains, "orthogonal")
    n = plant.n
    assert np.linalg.cond(form.X) <= np.linalg.cond(form.modes.X) * (1.0 + 1e-9)
    for i, P in enumerate(form.P):
        G = form.filters.G[i * n : i * n + n] @ form.X
        assert np.abs(P @ G - np.diag(form.observed[i])).max() < 1e-6


def test_auto_given_a_slow_pair_makes_its_two_coordinates_orthogonal():
    plant, gains = build([[1.0, 1e-2], [-1e-6, 1.0]], [[1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
    form = chosen(plant, gains, "auto")
    assert form.modes.form.groups() == [(0, 2)]
    assert np.linalg.cond(form.modes.X / form.modes.units[:, None]) > 1.0 + 1e-6
    balanced = form.X / form.modes.units[:, None]
    assert balanced[:, 0] @ balanced[:, 1] == pytest.approx(0.0, abs=1e-12)


def test_printed_variant_has_jordan_coordinates():
    plant, gains = car(gap=2e-4)
    options = canonical.Options(gamma=1.0, variant="printed")
    assert canonical.design(plant, gains, options).info["coordinates_changed"] == []
    options = canonical.Options(gamma=1.0)
    assert len(canonical.design(plant, gains, options).info["coordinates_changed"]) == 1
