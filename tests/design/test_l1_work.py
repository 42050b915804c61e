# SPDX-License-Identifier: MIT
"""What a program counts of the steps of `lasso`, for the instructions that `analyze` tells."""

import shutil
from dataclasses import replace

import golden
import numpy as np
import pytest

from blw.analysis import l1_instructions, l1_work
from blw.design import design_all
from blw.model import load

pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")

STEPS = 400


def designed(name, **options):
    model = load(golden.MODELS / f"{name}.toml")
    return design_all(replace(model, methods={"lasso": options}), ["lasso"])


def quiet(design):
    return np.zeros((0, design.model.m))


def test_count_given_a_certificate_that_holds_finds_one_product_with_S():
    design = designed("liu5", gamma=1e3)
    work, _ = l1_work.count(design, "lasso", quiet(design), STEPS)
    assert not work.iterations.any()
    assert np.all(work.calls["symv"] == 1) and np.all(work.elements["symv"] == 15 * 15)
    assert np.all(work.elements["gemv"] == 3 * 15 + 15 * 3)  # x_hat = F zeta, zeta += G d
    assert not work.calls["solve"].any()


def test_count_given_a_plant_that_is_not_stable_finds_the_same_work_early_and_late():
    design = designed("pendulum", gamma=1.0)
    work, _ = l1_work.count(design, "lasso", quiet(design), STEPS)
    early, late = np.split(work.iterations, 2)
    assert early.mean() > 1.0
    assert early.mean() == pytest.approx(late.mean(), rel=0.1)


def test_count_given_an_attack_finds_more_sweeps_and_the_same_before():
    design = designed("liu5", gamma=10.0)
    attack = l1_work.one_by_one(design, STEPS)
    assert np.all(np.count_nonzero(attack, axis=1) == 1)
    assert np.all(attack.sum(axis=0) == l1_work.BIAS * STEPS / 5)
    benign, under = l1_work.count(design, "lasso", attack, STEPS)
    again, _ = l1_work.count(design, "lasso", quiet(design), STEPS)
    assert np.array_equal(benign.iterations, again.iterations)
    assert under.iterations.mean() > benign.iterations.mean() + 2.0


@pytest.mark.parametrize("N, steps", [(15, 2000), (48, 2000), (100, 300), (144, 100), (200, 0)])
def test_affordable_given_many_rows_is_fewer_steps(N, steps):
    assert l1_work.affordable(N) == steps


def test_instructions_given_prices_is_their_sum():
    N, ones = 4, np.ones(2)
    work = l1_work.Work(3.0 * ones, {"dot": 5.0 * ones, "move": ones}, {"dot": 7.0 * ones})
    prices = {"step": 1000.0, "row": 10.0, "sweep element": 1.0, "iteration row": 2.0,
              "move row": 6.0, "dot": 100.0, "dot element": 0.5}
    found = l1_instructions.instructions(work, N, prices)
    assert found == pytest.approx((1000 + 40 + 30 + 24 + 24 + 500 + 3.5) * ones)


def test_expected_given_no_compiler_or_an_engine_without_prices_is_nothing(monkeypatch):
    assert l1_instructions.expected(designed("liu5", engine="admm"), "lasso") is None
    monkeypatch.setattr(l1_work.shutil, "which", lambda name: None)
    assert l1_instructions.expected(designed("liu5"), "lasso") is None
