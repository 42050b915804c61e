# SPDX-License-Identifier: MIT
"""Real Jordan forms of matrices whose structure is known by construction."""

import numpy as np
import pytest
from scipy.linalg import block_diag

from blw import jordan_form as jf


def similar(J, seed=3):
    V = np.random.default_rng(seed).standard_normal(J.shape) + 2.0 * np.eye(len(J))
    return V @ J @ np.linalg.inv(V)


def chain(eigenvalue, length):
    return eigenvalue * np.eye(length) + np.eye(length, k=1)


def shape(form):
    return [(block.length, block.multiplicity, block.is_complex) for block in form.blocks]


def image_of_input(form, M, K):
    """F with F J = M F, F b = K, from the pieces that a method uses."""
    parts = jf.components(form, K[:, None])
    columns = [jf.real_columns(U @ jf.intertwiner(T, link, np.ones(len(link)), part[:, 0]))
               for U, T, link, part in zip(form.bases, form.compressions, form.links, parts)]
    return np.hstack(columns)


def assert_intertwines(form, M, tolerance=1e-11):
    K = np.random.default_rng(5).standard_normal(len(M))
    F = image_of_input(form, M, K)
    assert np.abs(F @ form.J - M @ F).max() < tolerance * max(1.0, np.abs(F).max())
    assert np.abs(F @ form.b - K).max() < tolerance


def test_jordan_form_given_distinct_real_eigenvalues_sorts_single_rows():
    form = jf.jordan_form(similar(np.diag([0.5, -0.3, 0.1])))
    assert np.allclose(form.J, np.diag([-0.3, 0.1, 0.5]), atol=1e-13)
    assert form.groups() == [(0, 1), (1, 1), (2, 1)]
    assert np.array_equal(form.b, np.ones(3))


def test_jordan_form_given_complex_pair_makes_a_rotation_and_one_group():
    form = jf.jordan_form(similar(block_diag([[0.4, -0.2], [0.2, 0.4]], [[0.7]])))
    assert np.allclose(form.J, block_diag([[0.7]], [[0.4, -0.2], [0.2, 0.4]]), atol=1e-13)
    assert form.groups() == [(0, 1), (1, 2)]
    assert np.allclose(form.b, [1.0, np.sqrt(2.0), 0.0])


@pytest.mark.parametrize("length", [2, 3, 4])
def test_jordan_form_given_real_chain_finds_it_exactly(length):
    M = similar(block_diag(chain(0.6, length), [[-0.2]]))
    form = jf.jordan_form(M, 1e-2)
    assert shape(form) == [(1, 1, False), (length, length, False)]
    assert np.allclose(form.J, block_diag([[-0.2]], chain(0.6, length)), atol=1e-9)
    assert_intertwines(form, M)
    assert form.groups() == [(row, 1) for row in range(length + 1)]


def test_jordan_form_given_chain_of_pairs_links_rows_two_apart():
    link = np.array([[0.3, -0.4], [0.4, 0.3]])
    M = similar(np.block([[link, np.eye(2)], [np.zeros((2, 2)), link]]))
    form = jf.jordan_form(M, 1e-5)
    assert shape(form) == [(2, 2, True)]
    assert np.allclose(np.diag(form.J, 2), 1.0)
    assert form.groups() == [(0, 2), (2, 2)]
    assert_intertwines(form, M, 1e-9)


@pytest.mark.parametrize("blocks, expected", [
    ([[0.5]] * 3, [(1, 3, False)]),
    ([chain(0.5, 2), [[0.5]]], [(2, 3, False)]),
    ([chain(0.5, 2), chain(0.5, 2)], [(2, 4, False)]),
    ([[[0.4, -0.2], [0.2, 0.4]]] * 2, [(1, 2, True)]),
])
def test_jordan_form_given_derogatory_matrix_takes_the_largest_block(blocks, expected):
    M = similar(block_diag(*blocks))
    form = jf.jordan_form(M, 1e-5)
    assert shape(form) == expected
    assert form.derogatory
    assert_intertwines(form, M, 1e-9)


@pytest.mark.parametrize("eigenvalues", [
    [0.5, 0.5 + 4.5e-4], [0.5, 0.5003, 0.5007], [0.5, 0.5002, 0.5004, 0.5009],
])
def test_jordan_form_given_near_eigenvalues_is_exact_not_averaged(eigenvalues):
    M = similar(np.diag(eigenvalues))
    form = jf.jordan_form(M, 1e-3)
    assert shape(form) == [(len(eigenvalues), len(eigenvalues), False)]
    assert np.allclose(np.sort(np.linalg.eigvals(form.J).real), eigenvalues, atol=1e-9)
    assert_intertwines(form, M, 1e-8)


def test_jordan_form_given_pair_next_to_the_real_axis_makes_a_real_chain():
    M = similar(block_diag([[0.5, -2e-4], [2e-4, 0.5]], [[0.1]]))
    form = jf.jordan_form(M, 1e-3)
    assert shape(form) == [(1, 1, False), (2, 2, False)]
    assert form.J[2, 1] == pytest.approx(-4e-8, rel=1e-6)
    assert_intertwines(form, M)


def test_jordan_form_given_near_complex_pairs_is_exact():
    M = similar(block_diag([[0.3, -0.4], [0.4, 0.3]], [[0.3002, -0.4001], [0.4001, 0.3002]]))
    form = jf.jordan_form(M, 1e-3)
    assert shape(form) == [(2, 2, True)]
    assert_intertwines(form, M, 1e-9)


def test_jordan_form_given_a_tolerance_clusters_within_it_only():
    M = similar(np.diag([0.5, 0.5001]))
    assert shape(jf.jordan_form(M, 1e-3)) == [(2, 2, False)]
    assert shape(jf.jordan_form(M, 1e-6)) == [(1, 1, False), (1, 1, False)]


@pytest.mark.parametrize("J", [
    block_diag([[0.6]], chain(1.0, 3)),
    block_diag([[1.5]], [[0.4, -0.2], [0.2, 0.4]]),
    block_diag(chain(0.9, 2), [[0.4, -0.2], [0.2, 0.4]]),
])
def test_chain_vectors_given_any_structure_satisfy_the_definition(J):
    M = similar(J)
    form = jf.jordan_form(M, 1e-3)
    V = jf.chain_vectors(form)
    assert np.abs(M @ V - V @ form.J).max() < 1e-8 * np.abs(V).max()
    for block in form.blocks:
        last = V[:, block.rows][:, -2:] if block.is_complex else V[:, block.rows][:, -1:]
        assert np.linalg.norm(last) == pytest.approx(np.sqrt(2.0) if block.is_complex else 1.0)


def test_chain_vectors_given_integrator_are_the_unit_directions():
    M = np.array([[1.0, 0.1, 0.005], [0.0, 1.0, 0.1], [0.0, 0.0, 1.0]])
    V = jf.chain_vectors(jf.jordan_form(M, 1e-3))
    assert np.allclose(V, [[0.01, 0.005, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 1.0]], atol=1e-12)
