# SPDX-License-Identifier: MIT
"""Chi-square thresholds, comparisons far out in the tail, and the detector's tables."""

import numpy as np
import pytest
from scipy import stats

from blw import chi2
from blw.errors import DesignError


@pytest.mark.parametrize("dof", [1, 2, 7, 16, 22, 90])
@pytest.mark.parametrize("rate", chi2.COMMON_RATES)
def test_threshold_given_rate_is_exceeded_with_it(dof, rate):
    assert stats.chi2.sf(chi2.threshold(rate, dof), dof) == pytest.approx(rate, rel=1e-12)


@pytest.mark.parametrize("dof", [1, 2, 16, 90])
def test_log_sf_given_any_value_agrees_with_scipy_where_that_is_finite(dof):
    g = np.array([0.0, 0.3, 5.0, 40.0, 300.0, 900.0, 1100.0, 1300.0])
    expected = stats.chi2.logsf(g, dof)
    np.testing.assert_allclose(chi2.log_sf(g, dof), expected, rtol=1e-11, atol=1e-12)


def test_log_sf_given_values_far_out_neither_underflows_nor_loses_order():
    g = np.array([5000.0, 5001.0, 1e5, 1e30])
    values = chi2.log_sf(g, 16)
    assert np.all(np.isfinite(values)) and np.all(np.diff(values) < 0.0)
    assert values[-1] == pytest.approx(-5e29, rel=1e-12)
    # exactly, for an even number of degrees of freedom: exp(-x) sum x^i / i!, i < dof / 2
    x = 2500.0
    terms = np.cumprod(np.concatenate([[1.0], x / np.arange(1, 8)]))
    assert values[0] == pytest.approx(-x + np.log(terms.sum()), rel=1e-14)


@pytest.mark.parametrize("dof, reference", [(16, 17), (3, 12), (30, 44), (1, 2)])
def test_equivalent_given_value_has_the_same_survival_probability(dof, reference):
    g = np.array([0.5, 2.0, dof, 3.0 * dof, 300.0, 5000.0, 1e6])
    h = chi2.equivalent(g, dof, reference)
    np.testing.assert_allclose(chi2.log_sf(h, reference), chi2.log_sf(g, dof), rtol=1e-9,
                               atol=1e-14)


@pytest.mark.parametrize("dofs", [(16, 17), (3, 6, 9, 12), (30, 44)])
def test_offsets_given_degrees_of_freedom_rank_like_the_survival_probability(dofs):
    made = chi2.offsets([chi2.survival_offset(dof, max(dofs)) for dof in dofs], max(dofs))
    assert len(made.knots) <= 40
    generator = np.random.default_rng(4)
    rows = generator.integers(len(dofs), size=(4000, 2))
    g = np.exp(generator.uniform(0.0, 12.0, (4000, 2)))
    g[::7] = dofs[0] * generator.uniform(0.2, 6.0, g[::7].shape)
    score = np.array([[made.score(row, value) for row, value in zip(pair, values)]
                      for pair, values in zip(rows, g)])
    exact = np.array([[chi2.log_sf(value, dofs[row]) for row, value in zip(pair, values)]
                      for pair, values in zip(rows, g)])
    close = np.abs(exact[:, 0] - exact[:, 1]) <= 0.03 * (1.0 + g.max(axis=1) / (4.0 * max(dofs)))
    agree = (score[:, 0] < score[:, 1]) == (exact[:, 0] > exact[:, 1])
    assert np.all(agree | close) and np.mean(close) < 0.2


def test_offsets_given_any_table_keep_the_order_within_one_number_of_degrees_of_freedom():
    made = chi2.offsets([chi2.survival_offset(dof, 24) for dof in (6, 12, 24)], 24)
    for row in range(3):
        g = np.concatenate([np.linspace(0.0, 200.0, 2000), np.logspace(3, 30, 50)])
        assert np.all(np.diff(made.score(row, g)) > 0.0)


def test_detector_given_covariance_whitens_it_and_holds_every_rate():
    S = np.array([[4.0, 1.2], [1.2, 1.0]])
    tables = chi2.detector(S, window=3).to_json()
    assert tables["Linv"] == pytest.approx([0.5, -0.375, 1.25])
    thresholds = np.reshape(tables["thr"], (tables["n_rates"], 3))
    for rate, row in zip(tables["rate"], thresholds):
        np.testing.assert_allclose(stats.chi2.sf(row, 2 * np.arange(1, 4)), rate, rtol=1e-11)
    assert tables["rate"][0] == 1e-3


def test_detector_given_white_residuals_alarms_at_its_rate():
    tables = chi2.detector(np.diag([4.0, 9.0, 1.0]), window=5).to_json()
    generator = np.random.default_rng(8)
    samples = 200_000
    w = generator.standard_normal((samples, 5, 3))
    G = np.sum(w**2, axis=(1, 2))
    thresholds = np.reshape(tables["thr"], (-1, 5))[:, -1]
    for rate, threshold in zip(tables["rate"][:3], thresholds):
        sigma = np.sqrt(rate * (1.0 - rate) / samples)
        assert np.mean(G > threshold) == pytest.approx(rate, abs=4.0 * sigma)


def test_detector_given_an_indefinite_covariance_refuses():
    with pytest.raises(DesignError, match="not positive definite"):
        chi2.detector(np.array([[1.0, 2.0], [2.0, 1.0]]))
