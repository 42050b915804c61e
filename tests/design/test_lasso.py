# SPDX-License-Identifier: MIT
"""Method lasso: its tables as the device reads them, options, engines."""

import re

import golden
import numpy as np
import pytest

from blw import admm_tuning, kalman, l1, lasso, model, options
from blw.errors import ModelError
from blw.tables import Struct

INCLUDE = golden.ROOT / "lib/include/blw"
GOLDEN = ("paper0", "complex", "jordanA", "paper1")


def design(name, **given):
    data, plant, gains = golden.load(name)
    return data, plant, gains, lasso.design(plant, gains, lasso.Options(**given))


def declared_members(header, ctype):
    """Member names of one struct of a public header, in their order, without `head`."""
    body = re.search(r"typedef struct \w+ \{([^}]*)\} " + ctype + ";",
                     (INCLUDE / header).read_text()).group(1)
    body = re.sub(r"/\*.*?\*/", "", body, flags=re.S)
    return [name for name in re.findall(r"(\w+)\s*;", body) if name != "head"]


def matrix(table, columns):
    return np.array(table).reshape(-1, columns)


def banded(jordan):
    r = jordan["r"]
    return (np.diag(jordan["J0"]) + np.diag(jordan["J1"][: r - 1], 1)
            + np.diag(jordan["J2"][: max(r - 2, 0)], 2) + np.diag(jordan["Jm"][1:], -1))


def trapezoid(fused):
    N, d, packed = fused["N"], fused["d"], iter(fused["Z"])
    return np.array([[next(packed) if j <= i else 0.0 for j in range(d)] for i in range(N)])


def test_design_given_any_model_declares_members_as_the_headers_do():
    *_, designed = design("paper0", gamma=0.75)
    for struct, header in ((designed.tables, "blw_lasso.h"),
                           (designed.tables.members["jordan"], "blw_jordan.h"),
                           (designed.tables.members["l1"], "blw_l1.h")):
        assert isinstance(struct, Struct)
        assert list(struct.members) == declared_members(header, struct.ctype)
    assert designed.tables.method == "lasso"


@pytest.mark.parametrize("name", GOLDEN)
def test_design_given_golden_system_runs_as_the_kalman_filter(name):
    data, plant, gains, designed = design(name, gamma=1.0)
    tables = designed.tables.to_json()
    jordan, F = tables["jordan"], matrix(tables["l1"]["F"], tables["l1"]["N"])
    J = np.kron(np.eye(plant.m), banded(jordan))
    b = matrix(jordan["b"], jordan["r"])
    D, G = matrix(jordan["D"], plant.l), matrix(jordan["G"], plant.n)
    zeta, x_hat = G @ np.ones(plant.n), np.ones(plant.n)
    for y, u in zip(np.array(data["y"]), np.array(data["u"])):
        zeta = J @ zeta + (b * y[:, None]).ravel() + D @ u
        x_bar = plant.A @ x_hat + plant.Bu @ u
        x_hat = x_bar + gains.K @ (y - plant.C @ x_bar)
        assert np.abs(F @ zeta - x_hat).max() < 1e-9 * max(1.0, np.abs(x_hat).max())


def test_design_given_admm_packs_a_Z_that_cancels_x():
    _, plant, _, designed = design("complex", gamma=1.0, engine="admm", tolerance=1e-2)
    tables = designed.tables.to_json()
    G = matrix(tables["jordan"]["G"], plant.n)
    assert np.abs(trapezoid(tables["l1"]).T @ G).max() < 1e-12 * np.abs(G).max()


def symmetric(packed, size):
    S = np.zeros((size, size))
    S[np.tril_indices(size)] = packed
    return S + np.tril(S, -1).T


@pytest.mark.parametrize("name", ["paper0", "jordanA", "paper1", "complex"])
def test_design_given_auto_packs_the_identities_of_W_and_S(name):
    _, plant, _, designed = design(name, gamma=1.0)
    tables = designed.tables.to_json()
    fused, N = tables["l1"], tables["l1"]["N"]
    assert fused["engine"] == (l1.NEWTON if fused["n_groups"] < N else l1.TABLEAU).name
    S, W = symmetric(fused["S"], N), symmetric(fused["W"], N)
    G, F = matrix(fused["G"], plant.n), matrix(fused["F"], N)
    assert np.abs(S @ G).max() < 1e-11 * np.abs(S).max() * np.abs(G).max()
    assert np.abs(W @ S + G @ F - np.eye(N)).max() < 1e-7
    assert np.abs(F @ W - symmetric(fused["P"], plant.n) @ G.T).max() < 1e-9 * np.abs(G).max()
    assert fused["Z"] is None


def test_design_given_nine_tenths_recovered_chooses_the_gamma_of_the_specification():
    *_, designed = design("paper0", recovery_probability=0.9)
    assert designed.info["gamma"] == pytest.approx(53.0, abs=0.3)
    assert designed.info["recovery_probability"] == pytest.approx(0.9, abs=1e-4)
    c = np.array(designed.tables.to_json()["l1"]["c"])
    assert c * designed.info["scale"] == pytest.approx(np.full(15, designed.info["gamma"]))


def test_design_given_recovery_probability_meets_it():
    *_, designed = design("complex", recovery_probability=0.5)
    assert designed.info["recovery_probability"] == pytest.approx(0.5, abs=1e-4)


def test_design_given_no_options_loses_a_tenth_without_attack():
    *_, designed = design("paper0")
    assert 0.5 < designed.info["gamma"] < 0.6
    assert designed.info["benign_loss"] == pytest.approx(0.1, abs=0.005)


@pytest.mark.parametrize("gamma, loss", [(0.3, 0.18), (0.75, 0.06), (1.0, 0.04), (2.0, 0.01)])
def test_design_given_gamma_states_the_loss_of_the_specification(gamma, loss):
    *_, designed = design("paper0", gamma=gamma)
    assert designed.info["benign_loss"] == pytest.approx(loss, abs=0.015)


def test_design_given_smaller_loss_takes_a_larger_gamma():
    *_, strict = design("complex", benign_loss=0.01)
    *_, loose = design("complex", benign_loss=0.1)
    assert strict.info["benign_loss"] <= 0.01
    assert strict.info["gamma"] > 1.5 * loose.info["gamma"]


def test_design_given_W_too_ill_conditioned_for_a_small_gamma_says_so():
    *_, designed = design("paper1", gamma=1e-6)
    assert designed.info["benign_loss"] is None


@pytest.mark.parametrize("name, engine, bound", [("paper0", l1.TABLEAU.name, 4 * 15),
                                                 ("complex", l1.NEWTON.name, 64)])
def test_design_given_auto_takes_the_active_set_with_its_bound(name, engine, bound):
    *_, designed = design(name, gamma=1.0)
    fused = designed.tables.to_json()["l1"]
    assert fused["engine"] == engine
    assert fused["max_iterations"] == designed.info["max_iterations"] == bound
    assert (fused["M"] is None) == (fused["rho"] == 0.0) == (engine == l1.TABLEAU.name)


def test_smoothed_given_zeta_solves_the_conditions_with_every_group_inside():
    *_, designed = design("complex", gamma=1.0)
    fused = designed.tables.to_json()["l1"]
    N, n = fused["N"], fused["n"]
    M, W = symmetric(fused["M"], N), symmetric(fused["W"], N)
    G, first = np.array(fused["G"]).reshape(N, n), np.array(fused["first"])
    D = fused["rho"] * np.sqrt(np.diag(W)[first[:-1]]) / np.array(fused["c"])
    zeta = np.random.default_rng(1).standard_normal(N) * np.sqrt(np.diag(W))
    multipliers = M @ zeta
    rest = zeta - W @ multipliers - np.repeat(D, np.diff(first)) * multipliers
    x = np.linalg.lstsq(G, rest, rcond=None)[0]
    assert rest == pytest.approx(G @ x, abs=1e-7 * np.linalg.norm(zeta))
    assert np.abs(G.T @ multipliers).max() < 1e-9 * (np.abs(G.T) @ np.abs(multipliers)).max()


@pytest.mark.parametrize("name, pivots", [("paper0", 4), ("complex", 8)])
def test_design_given_a_coarse_W_pivots_on_Z(monkeypatch, name, pivots):
    monkeypatch.setattr(lasso, "COND_COARSE", 1.0)
    *_, designed = design(name, gamma=1.0)
    fused = designed.tables.to_json()["l1"]
    assert fused["engine"] == l1.ACTIVE_SET.name
    assert fused["max_iterations"] == pivots * fused["N"]
    assert fused["W"] is None and fused["Z"] is not None


def test_design_given_max_iterations_keeps_it():
    *_, designed = design("paper0", gamma=1.0, max_iterations=7)
    assert designed.tables.to_json()["l1"]["max_iterations"] == 7


def test_design_given_admm_packs_the_inverse_for_the_tuned_penalty():
    *_, designed = design("complex", gamma=10.0, engine="admm", tolerance=1e-3)
    fused = designed.tables.to_json()["l1"]
    N = fused["N"]
    M = np.zeros((N, N))
    M[np.tril_indices(N)] = fused["M"]
    M = M + np.tril(M, -1).T
    Z = trapezoid(fused)
    assert np.abs(M @ (Z @ Z.T + fused["rho"] * np.eye(N)) - np.eye(N)).max() < 1e-9
    assert fused["engine"] == l1.ADMM.name
    assert fused["rho"] in admm_tuning.RHOS
    assert designed.info["admm_converged"]
    assert designed.info["max_iterations"] >= designed.info["admm_iterations_simulated"]
    assert "passes" in designed.info["admm_advice"]


def test_design_given_tighter_tolerance_grants_admm_more_passes():
    *_, loose = design("complex", gamma=10.0, engine="admm", tolerance=1e-2)
    *_, tight = design("complex", gamma=10.0, engine="admm", tolerance=1e-8)
    assert loose.info["max_iterations"] < tight.info["max_iterations"]


def test_design_given_costly_admm_says_it_is_the_wrong_engine():
    *_, designed = design("paper0", gamma=0.28, engine="admm")
    assert "active_set" in designed.info["admm_advice"]


def test_design_given_a_model_states_the_sizes_of_its_memory():
    _, plant, _, designed = design("complex", gamma=1.0)
    assert designed.mem == (plant.n, plant.m, 15, 12, 10, 0)


def test_design_given_gamma_and_probability_refuses():
    with pytest.raises(ModelError, match="^method.lasso: give gamma or recovery_prob"):
        design("paper0", gamma=1.0, recovery_probability=0.9)
    with pytest.raises(ModelError, match="recovery_probability or benign_loss, not both"):
        design("paper0", benign_loss=0.1, recovery_probability=0.9)


@pytest.mark.parametrize("raw, message", [
    ({"gama": 1.0}, "unknown key 'gama'; did you mean 'gamma'"),
    ({"gamma": 0.0}, "gamma must be greater than 0"),
    ({"gamma": "big"}, "gamma must be a finite number"),
    ({"recovery_probability": 1.0}, "recovery_probability must be at most 0.999"),
    ({"benign_loss": 0.0}, "benign_loss must be greater than 0"),
    ({"max_iterations": 0}, "max_iterations must be at least 1"),
    ({"max_iterations": 70000}, "max_iterations must be at most 65535"),
    ({"tolerance": 0.0}, "tolerance must be at least"),
    ({"engine": "simplex"}, "engine must be 'auto' or 'active_set' or 'admm'"),
])
def test_parse_given_bad_option_refuses(raw, message):
    with pytest.raises(ModelError, match=re.escape(message)):
        options.parse(lasso.Options, raw, "x.toml: method.lasso")


@pytest.mark.parametrize("name", ["liu5", "pendulum", "drone5", "drone6", "grid4", "torsion"])
def test_design_given_shipped_plant_serves_it(name):
    loaded = model.load(golden.MODELS / f"{name}.toml")
    gains = kalman.steady_state(loaded.A, loaded.C, loaded.W, loaded.R)
    designed = lasso.design(loaded, gains, lasso.Options())
    designed.tables.check()
    assert designed.info["cond_W"] < 1e9
    assert designed.info["benign_loss"] == pytest.approx(0.1, abs=0.01)
    assert designed.info["unchecked_sensors"] == []
