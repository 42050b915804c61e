# SPDX-License-Identifier: MIT
"""Bases of observable subspaces, also where the observability matrix has lost its rank."""

import numpy as np
import pytest
from golden import MODELS

from blw import model
from blw.arnoldi import observable_basis
from blw.errors import DesignError


@pytest.mark.parametrize("name, mu", [("torsion", (6, 6, 6, 5, 5)), ("pendulum", (4, 4, 4, 2)),
                                      ("drone5", (4,) * 5), ("liu5", (1, 2, 2, 2, 2))])
def test_basis_given_shipped_model_has_the_known_rank(name, mu):
    made = model.load(MODELS / f"{name}.toml")
    for c, rank in zip(made.C, mu):
        Z = observable_basis(made.A, c)
        assert Z.shape == (made.n, rank)
        np.testing.assert_allclose(Z.T @ Z, np.eye(rank), atol=1e-14)
        np.testing.assert_allclose(Z @ (Z.T @ c), c, atol=1e-14 * np.abs(c).max())
        image = made.A.T @ Z
        np.testing.assert_allclose(Z @ (Z.T @ image), image, atol=1e-12 * np.abs(image).max())


def test_basis_given_slow_sampling_differences_keeps_full_rank_where_powers_lose_it():
    n, h = 8, 1e-3  # a chain of integrators, sampled fast
    A = np.eye(n) + h * np.diag(np.ones(n - 1), 1)
    c = np.eye(n)[0]
    powers = np.array([c @ np.linalg.matrix_power(A, k) for k in range(n)])
    assert np.linalg.matrix_rank(powers) < n
    assert observable_basis(A, c).shape == (n, n)


def test_basis_given_a_hidden_part_leaves_it_out_in_any_coordinates():
    generator = np.random.default_rng(2)
    seen, hidden = 4, 3
    A = np.block([[generator.standard_normal((seen, seen)), np.zeros((seen, hidden))],
                  [generator.standard_normal((hidden, seen)),
                   generator.standard_normal((hidden, hidden))]])
    c = np.concatenate([generator.standard_normal(seen), np.zeros(hidden)])
    T = generator.standard_normal((7, 7)) @ np.diag([1e3, 1.0, 1e-2, 1.0, 10.0, 1.0, 1e2])
    assert observable_basis(A, c).shape == (7, seen)
    assert observable_basis(T @ A @ np.linalg.inv(T), c @ np.linalg.inv(T)).shape == (7, seen)


@pytest.mark.parametrize("rounding", [0.0, 1e-16, 1e-14])
def test_basis_given_a_mode_that_only_rounding_splits_takes_it_as_one(rounding):
    A = 0.95 * np.eye(2) + rounding * np.array([[0.0, -1.0], [0.5, 0.0]])
    assert observable_basis(A, np.array([1.2, -1.9])).shape == (2, 1)


def test_basis_given_a_sensor_of_nothing_refuses():
    with pytest.raises(DesignError, match="observes nothing"):
        observable_basis(np.eye(2), np.zeros(2))
