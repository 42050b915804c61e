# SPDX-License-Identifier: MIT
"""Method `bank` on sensors that send seldom: the C library against (6) of blw_bank.h."""

import numpy as np
import pytest
from bank_library import BankLibrary, compile_library
from test_bank import raw, simulated

from blw import bank, bank_build, gaps
from blw.kalman import steady_state
from blw.model import parse

RATE = [0.3, 0.3, 0.5, 0.25]
STEPS = 400


@pytest.fixture(scope="module")
def libraries(tmp_path_factory):
    folder = tmp_path_factory.mktemp("library")
    return {width: compile_library(folder, width) for width in ("f32", "f64")}


def seldom(rate=RATE):
    """A slow plant with four sensors of its first state."""
    model = parse({"name": "seldom", "dt_s": 0.1, "plant": {
        "A": [[1.0, 0.1], [0.0, 0.9]], "C": [[1.0, 0.0]] * 3 + [[1.0, 0.2]], "Q": [1e-4, 1e-3],
        "R": [0.1, 0.2, 0.1, 0.1], "rate": rate}, "attack": {"p": 1}}, "seldom")
    return model, steady_state(model.A, model.C, model.W, model.R)


def samples(model, steps, seed):
    """y [steps x m] with NaN where a sensor does not send."""
    y = simulated(model, steps, seed)[2]
    sent = np.random.default_rng(seed + 1).random(y.shape) < model.rate
    return np.where(sent, y, np.nan)


def mask(row):
    return sum(1 << i for i, value in enumerate(row) if value == value)


@pytest.mark.parametrize("width, tolerance", [("f64", 1e-9), ("f32", 1e-3)])
def test_residues_of_seldom_samples_are_those_of_the_formula(libraries, width, tolerance):
    model, _ = seldom()
    averaged, kalman = gaps.averaged(model)
    made = bank_build.build(averaged, bank.Options())
    h = made.horizon
    library = BankLibrary(libraries[width], averaged, kalman,
                          raw(bank.design(averaged, kalman, bank.Options()), h))
    y = samples(model, STEPS, 3)
    x = np.tile(model.x0, (len(made.members), 1))
    tracks, found = [], []
    for row in y:
        assert library.step(np.nan_to_num(row), valid=mask(row)) == 0
        found.append(library.self.average[:len(made.tests)])
        x = x @ model.A.T
        for d, member in zip(x, made.members, strict=True):
            d += (member.K * model.weight) @ np.nan_to_num(row - model.C @ d)
        tracks.append(x.copy())
    found = np.array(found) * [test.limit for test in made.tests]
    rows = [model.C @ np.linalg.matrix_power(model.A, j) for j in range(h)]
    for k in range(h - 1, STEPS, 7):
        for column, test in enumerate(made.tests):
            block, x_s = made.blocks[test.block], tracks[k - h + 1][test.member]
            Z = block.Z.reshape(model.n, h, -1) * model.weight[list(block.sensors)]
            left = np.array([(y[k - h + 1 + j] - rows[j] @ x_s)[list(block.sensors)]
                             for j in range(h)])
            q = np.sum(np.einsum("njt,jt->n", Z, np.nan_to_num(left))**2)
            assert found[k, column] == pytest.approx(q, rel=tolerance, abs=tolerance * test.mean)


def test_set_without_attack_passes_and_one_with_a_liar_does_not(libraries):
    model, _ = seldom()
    averaged, kalman = gaps.averaged(model)
    library = BankLibrary(libraries["f32"], averaged, kalman,
                          bank.design(averaged, kalman, bank.Options()))
    y = samples(model, 6000, 5)
    y[3000:, 1] += 1.5  # within the gate of single samples: sigma is 0.45
    passed = []
    for row in y:
        assert library.step(np.nan_to_num(row), valid=mask(row)) == 0
        passed.append([worst <= 1.0 for worst in library.self.worst[:4]])
    honest = [not library.model.set_mask[s] & 2 for s in range(4)]
    benign, attacked = np.mean(passed[500:3000], axis=0), np.mean(passed[3500:], axis=0)
    assert (benign > 0.95).all()  # 0.99 in the mean; 2500 steps hold a dozen independent averages
    assert attacked[honest.index(True)] > 0.95
    assert (attacked[np.logical_not(honest)] < 0.02).all()
    assert library.out.excluded == 2


def test_silent_sensor_is_left_out_only_after_the_gap(libraries):
    model, _ = seldom()
    averaged, kalman = gaps.averaged(model)
    designed = bank.design(averaged, kalman, bank.Options())
    gap = designed.tables.members["max_gap"]
    library = BankLibrary(libraries["f32"], averaged, kalman, designed)
    assert gap == 12  # three samples of the slowest
    chosen = []
    for k in range(60):
        valid = 0b1111 if k < 30 else 0b1110
        assert library.step(model.C @ library.x_hat() if k else np.zeros(4), valid=valid) == 0
        chosen.append(library.model.set_mask[library.self.choice])
    best = chosen[29]
    assert best & 1  # else this shows nothing
    assert chosen[:30 + gap] == [best] * (30 + gap)
    assert not any(choice & 1 for choice in chosen[30 + gap:])


def test_design_given_full_rates_counts_every_sample_once():
    model, kalman = seldom([1.0] * 4)
    tables = bank.design(model, kalman, bank.Options()).tables.members
    made = bank_build.build(model, bank.Options())
    assert tables["max_gap"] == 0
    np.testing.assert_array_equal(tables["K"].array, np.concatenate(
        [member.K[:, list(member.sensors)].ravel() for member in made.members]))
