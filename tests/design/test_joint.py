# SPDX-License-Identifier: MIT
"""The recursions of [J], the tables of `joint`, and what the tool says about them."""

import dataclasses

import numpy as np
import pytest
import shared_data
from golden import MODELS

from blw import joint, joint_analysis, kalman, options
from blw import model as models
from blw.errors import DesignError, ModelError
from blw.joint_recursion import Pair, Recursion, Stack, fused_covariance, fusion_weights

RELATIVE = 1e-9


def golden():
    data = shared_data.golden("fdi_ieee4")
    plant = {key: data["system"][key] for key in ("A", "C", "Q", "R", "P0")}
    made = models.parse({"name": "ieee4", "dt_s": 5.0, "plant": plant, "attack": {"p": 1}}, "ieee4")
    pairs = [Pair(one["weak"], tuple(one["strong"])) for one in data["locals"]]
    return data, made, pairs


def random_system(seed):
    """n = 2..4 states, 2 or 3 weak sensors that share some of 2 or 3 strong ones, correlated R."""
    generator = np.random.default_rng(seed)
    n, weak, strong = (int(generator.integers(low, high)) for low, high in ((2, 5), (2, 4), (2, 4)))
    A = generator.standard_normal((n, n))
    A *= generator.uniform(0.5, 1.05) / np.abs(np.linalg.eigvals(A)).max()
    L = generator.standard_normal((weak + strong, weak + strong))
    plant = {"A": A.tolist(), "C": generator.standard_normal((weak + strong, n)).tolist(),
             "Q": np.diag(generator.uniform(0.1, 1.0, n)).tolist(),
             "R": (0.2 * np.eye(weak + strong) + 0.1 * L @ L.T).tolist()}
    made = models.parse({"name": "random", "dt_s": 1.0, "plant": plant, "attack": {"p": 1}}, "r")
    helpers = range(weak, weak + strong)
    pairs = [Pair(i, tuple(j for j in helpers if j != weak + i % strong or strong == 2))
             for i in range(weak)]
    return made, pairs, generator.uniform(0.1, 10.0, weak), np.eye(n)


def exact_covariance(made, pairs, P0, eta, gains):
    """[r N, r N] of X~ under these gains, by the Lyapunov recursion of the plain linear system
    s = [x~_i, theta_hat_i + phi_hat_i, phi_hat_i; all i] driven by w, v and theta."""
    n, r = made.n, len(pairs)
    width, m = n + 2, made.m
    S = np.zeros((r * width, r * width))
    for i in range(r):
        for j in range(r):
            S[i * width:i * width + n, j * width:j * width + n] = P0
    noise = np.zeros((n + m + r, n + m + r))
    noise[:n, :n], noise[n:n + m, n:n + m] = made.W, made.R
    noise[n + m:, n + m:] = np.diag(eta)
    out = np.zeros((r * (n + 1), r * width + n + m + r))
    for step in gains:
        F = np.zeros((r * width, r * width + n + m + r))
        for i, pair in enumerate(pairs):
            own, sensors = i * width, list(pair.sensors)
            x = np.zeros((n, F.shape[1]))
            x[:, own:own + n], x[:, r * width:r * width + n] = made.A, np.eye(n)
            b, phi, theta = np.zeros((3, F.shape[1]))
            b[own + n] = phi[own + n + 1] = theta[r * width + n + m + i] = 1.0
            y = made.C[sensors] @ x
            y[:, r * width + n:r * width + n + m] += np.eye(m)[sensors]
            y[0] += theta - b
            K, Gamma = step.K[i], step.Gamma[i]
            out[i * (n + 1):i * (n + 1) + n] = x - K[:n] @ y
            out[i * (n + 1) + n] = theta - b - K[n] @ y
            F[own:own + n] = out[i * (n + 1):i * (n + 1) + n]
            F[own + n + 1] = phi + Gamma @ y
            F[own + n] = b + K[n] @ y + F[own + n + 1]
        joined = np.block([[S, np.zeros((len(S), len(noise)))],
                           [np.zeros((len(noise), len(S))), noise]])
        S = F @ joined @ F.T
    return out @ joined @ out.T


@pytest.mark.parametrize("name", ["paper", "exact"])
def test_recursion_given_golden_system_yields_its_gains_weights_and_estimates(name):
    data, made, pairs = golden()
    printed, want = name == "paper", data[name]
    recursion = Recursion(Stack(made, pairs, shared_noise=not printed), made.P0,
                          np.array(data["eta"]), printed)
    X, phi = np.zeros((2, made.n + 1)), np.zeros(2)
    for k in range(1, len(data["y"])):
        gains = recursion.advance()
        for i, pair in enumerate(pairs):
            bar = np.append(made.A @ X[i, :-1], X[i, -1] + phi[i])
            e = np.array(data["y"][k])[list(pair.sensors)] - recursion.stack.C[i] @ bar
            X[i], phi[i] = bar + gains.K[i] @ e, phi[i] + gains.Gamma[i] @ e
        G = fusion_weights(recursion.Sigma, made.n)
        np.testing.assert_allclose(X, np.array(want["X"])[:, k], rtol=RELATIVE, atol=RELATIVE)
        np.testing.assert_allclose(G.T @ X[:, :-1].ravel(), want["fused"][k], rtol=RELATIVE,
                                   atol=RELATIVE)
        if str(k) in want["checkpoints"]:
            check_checkpoint(recursion, gains, G, want["checkpoints"][str(k)])
    np.testing.assert_allclose(recursion.Sigma, want["Sigma_last"], atol=RELATIVE)
    np.testing.assert_allclose(fused_covariance(recursion.Sigma, G), want["Pfused_last"],
                               atol=RELATIVE)


def check_checkpoint(recursion, gains, G, want):
    found = {"K": gains.K, "G": [Gamma[None, :] for Gamma in gains.Gamma], "W": G,
             "PX": [recursion.PX[recursion.stack.state(i), recursion.stack.state(i)]
                    for i in range(2)],
             "Pphi": recursion.Pphi[:, None, None], "V": np.diag(recursion.V)[:, None, None],
             "U": [recursion.U[recursion.stack.state(i), i:i + 1] for i in range(2)]}
    for key, values in found.items():
        np.testing.assert_allclose(values, want[key], rtol=RELATIVE, atol=RELATIVE, err_msg=key)


@pytest.mark.parametrize("seed", range(100))
def test_recursion_given_random_system_equals_the_exact_lyapunov_recursion(seed):
    made, pairs, eta, P0 = random_system(seed)
    recursion = Recursion(Stack(made, pairs), P0, eta)
    gains = [recursion.advance() for _ in range(12)]
    exact = exact_covariance(made, pairs, P0, eta, gains)
    np.testing.assert_allclose(recursion.PX, exact, atol=1e-12 * np.abs(exact).max())
    G = fusion_weights(recursion.Sigma, made.n)
    local = [np.trace(recursion.Sigma[i:i + made.n, i:i + made.n])
             for i in range(0, len(recursion.Sigma), made.n)]
    assert np.trace(fused_covariance(recursion.Sigma, G)) <= min(local) * (1 + 1e-12)


def test_printed_recursion_misses_the_exact_covariance():
    _, made, pairs = golden()
    recursion = Recursion(Stack(made, pairs, shared_noise=False), made.P0, np.array([0.1, 0.1]),
                          printed=True)
    gains = [recursion.advance() for _ in range(50)]
    exact = exact_covariance(made, pairs, made.P0, np.array([0.1, 0.1]), gains)
    error = np.abs(np.diag(recursion.PX) - np.diag(exact)) / np.diag(exact)
    assert 1e-4 < error.max() < 1.0


@pytest.mark.parametrize("eta", [100.0, 1e6, 1e12])
def test_fusion_weights_given_a_shared_strong_set_are_finite_and_sum_to_the_identity(eta):
    _, made, _ = golden()
    pairs = [Pair(0, (2, 3, 4)), Pair(1, (2, 3, 4))]
    recursion = Recursion(Stack(made, pairs), made.P0, np.full(2, eta))
    for _ in range(60):
        recursion.advance()
        G = fusion_weights(recursion.Sigma, made.n)
        assert np.isfinite(G).all()
        scale = max(1.0, np.abs(G).max())
        np.testing.assert_allclose(G[:4] + G[4:], np.eye(4), atol=1e-13 * scale)


def test_fusion_weights_given_identical_estimators_share_alike():
    P = np.diag([1.0, 2.0])
    G = fusion_weights(np.kron(np.ones((3, 3)), P), 2)
    np.testing.assert_allclose(G, np.kron(np.ones((3, 1)), np.eye(2)) / 3, atol=1e-15)


def test_covariances_given_white_attacks_are_those_of_a_simulation():
    data, made, pairs = golden()
    eta, runs, length = np.array([1.0, 4.0]), 4000, 25
    steps = joint_analysis.transient(made, pairs, made.P0, eta)[:length]
    stack = Stack(made, pairs)
    generator = np.random.default_rng(7)
    draw = lambda S: generator.multivariate_normal(np.zeros(len(S)), S, runs)  # noqa: E731
    x, X, phi = draw(made.P0), np.zeros((2, runs, 5)), np.zeros((2, runs))
    for step in steps:
        x = x @ made.A.T + draw(made.W)
        theta, v = generator.standard_normal((runs, 2)) * np.sqrt(eta), draw(made.R)
        for i, pair in enumerate(pairs):
            sensors = list(pair.sensors)
            y = x @ made.C[sensors].T + v[:, sensors]
            y[:, 0] += theta[:, i]
            X[i] = X[i] @ stack.Aa[stack.state(0), stack.state(0)].T
            X[i, :, -1] += phi[i]
            e = y - X[i] @ stack.C[i].T
            X[i] += e @ step.gains.K[i].T
            phi[i] += e @ step.gains.Gamma[i]
    fused = np.hstack([X[0, :, :4], X[1, :, :4]]) @ steps[-1].G - x
    spread = 5 * np.sqrt(2 / runs)
    assert (fused**2).sum(axis=1).mean() == pytest.approx(steps[-1].fused.sum(), rel=spread)
    for i in range(2):
        error = theta[:, i] - X[i, :, -1]
        assert (error**2).mean() == pytest.approx(steps[-1].theta[i], rel=spread)


def grid(**table):
    made = models.load(MODELS / "grid4.toml")
    found = kalman.steady_state(made.A, made.C, made.W, made.R)
    return made, found, options.parse(joint.Options, table, "method.joint")


def test_design_given_no_pairs_lets_all_strong_sensors_help_every_weak_one():
    designed = joint.design(*grid())
    assert designed.info["pairs"] == [["y1", ["y3", "y4", "y5"]], ["y2", ["y3", "y4", "y5"]]]
    assert designed.info["eta"] == [1.0, 1.0]  # ten times R
    tables = designed.tables.to_json()
    assert tables["first"] == [0, 4, 8]
    assert tables["sensor"] == [0, 2, 3, 4, 1, 2, 3, 4]
    assert tables["strong"] == [0, 0, 1, 1, 1]
    assert tables["recursive"] is None


def test_design_given_a_tolerance_ends_the_schedule_where_gains_have_settled():
    loose = joint.design(*grid(tolerance=1e-3))
    tight = joint.design(*grid(tolerance=1e-9))
    cut = joint.design(*grid(max_schedule=2))
    assert 2 < loose.info["schedule_steps"] < tight.info["schedule_steps"] < 40
    assert tight.info["schedule_error"] <= 1e-9 < loose.info["schedule_error"] <= 1e-3
    assert cut.info["schedule_steps"] == 2 and cut.info["schedule_error"] > 1e-3


def test_design_says_that_the_strong_sensors_alone_do_as_well():
    made, found, parsed = grid(pairs=[["y1", ["y3", "y4"]], ["y2", ["y3", "y5"]]], eta=1.0)
    info = joint.design(made, found, parsed).info
    assert info["trace_P_strong_kalman"] <= info["trace_P"]
    assert "does as well" in info["verdict"]
    assert info["mse_per_attack_variance"][0] > 0


def test_design_given_an_attack_size_chooses_the_best_eta_of_the_sweep():
    info = joint.design(*grid(attack_size=3.0)).info
    assert info["eta_from"] == "sweep"
    errors = {row["eta"]: row["state_white"] for row in info["sweep"]}
    assert errors[info["eta"][0]] == min(errors.values())


def test_sweep_given_known_variance_is_least_at_that_variance():
    made, found, _ = grid()
    pairs = [Pair(0, (2, 3)), Pair(1, (2, 4))]
    rows = joint_analysis.sweep(made, pairs, found.P, [0.1, 1.0, 9.0, 100.0], 3.0)
    best = min(rows, key=lambda row: row["theta_white"][0])
    assert best["eta"] == 9.0
    pulse = [row["theta_pulse"][1] for row in rows]
    assert pulse[0] > pulse[1] > pulse[2]


@pytest.mark.parametrize(("table", "words"), [
    ({"pairs": [["y1", ["y2"]]]}, "'y2' is not strong"),
    ({"pairs": [["y1", []]]}, "has no strong sensor"),
    ({"pairs": [["y9", ["y3"]]]}, "'y9', which is no sensor"),
    ({"pairs": [["y1", ["y3", "y3"]]]}, "'y3' twice"),
    ({"pairs": [["y3", ["y4"]]]}, "in the weak one's place"),
    ({"pairs": [["y1", ["y3"]], ["y1", ["y4"]]]}, "repeats the weak sensor"),
    ({"eta": [1.0]}, "has 1 entries"),
    ({"gains": "recursive", "variant": "printed"}, "needs gains"),
])
def test_design_given_wrong_options_says_which(table, words):
    with pytest.raises(ModelError, match="method.joint") as caught:
        joint.design(*grid(**table))
    assert words in str(caught.value)


def test_design_given_partners_that_a_detector_clears_counts_on_the_strong_ones_only():
    pairs = [["y1", ["y2", "y4", "y5"]], ["y2", ["y1", "y4", "y5"]]]
    made, found, parsed = grid(gains="recursive", pairs=pairs, eta=1.0)
    some = joint.design(dataclasses.replace(made, strong=["y4", "y5"]), found, parsed)
    fewer = grid(gains="recursive", pairs=[["y1", ["y4", "y5"]], ["y2", ["y4", "y5"]]], eta=1.0)[2]
    want = joint.design(made, found, fewer)
    assert some.info["pairs"] == pairs
    assert some.tables.to_json()["sensor"] == [0, 1, 3, 4, 1, 0, 3, 4]
    for key in ("threshold", "trace_P", "theta_sd", "verdict"):
        assert some.info[key] == want.info[key], key


def test_design_given_no_partner_that_is_strong_yet_says_so():
    made, found, parsed = grid(gains="recursive", pairs=[["y1", ["y3", "y4"]]], eta=1.0)
    A = np.diag([0.5, 0.6, 0.7, 0.8])
    C = made.C.copy()
    C[0] = 1.0
    stable = dataclasses.replace(made, strong=["y5"], A=A, C=C)
    info = joint.design(stable, found, parsed).info
    assert "no partner is strong at the start" in info["verdict"]
    assert len(info["unseen_by_partners"]) == 0


def in_units(states, sensors, **table):
    """A plant of two modes, four sensors and correlated noise in other units, powers of two."""
    A = np.array([[0.9, 0.3, 0.1], [-0.2, 0.8, 0.0], [0.1, 0.0, 0.95]])
    C = np.array([[1.0, 0.5, 0.2], [0.3, 1.0, -0.4], [0.8, -0.6, 1.0], [0.2, 0.9, 0.7]])
    W = np.array([[1.0, 0.4, 0.2], [0.4, 0.5, 0.1], [0.2, 0.1, 0.3]])
    R = 0.4 * np.eye(4) + 0.1
    plant = {"A": (A * states[:, None] / states).tolist(),
             "C": (C * sensors[:, None] / states).tolist(),
             "Q": (W * np.outer(states, states)).tolist(),
             "R": (R * np.outer(sensors, sensors)).tolist()}
    made = models.parse({"name": "units", "dt_s": 1.0, "plant": plant,
                         "attack": {"strong": ["y3", "y4"]}}, "units")
    found = kalman.steady_state(made.A, made.C, made.W, made.R)
    return joint.design(made, found, options.parse(joint.Options, table, "x"))


STATES, SENSORS = np.array([2.0**13, 2.0**-13, 1.0]), np.array([2.0**-13, 2.0**10, 2.0**13, 1.0])


def test_design_given_other_units_yields_the_same_schedule():
    plain, scaled = in_units(np.ones(3), np.ones(4)), in_units(STATES, SENSORS)
    want, found = (one.tables.to_json() for one in (plain, scaled))
    steps = want["schedule"]["steps"]
    assert (found["schedule"]["steps"], found["warm_up"]) == (steps, want["warm_up"])
    G = np.reshape(found["schedule"]["G"], (steps, 3, 3)) / STATES[:, None] * STATES
    np.testing.assert_allclose(G, np.reshape(want["schedule"]["G"], G.shape), atol=1e-4)
    for i, weak in enumerate(SENSORS[:2]):
        rows = np.append(STATES, [weak, weak])[:, None] / SENSORS[[i, 2, 3]]
        K, wanted = (np.reshape(t["schedule"]["K"], (steps, 2, 5, 3))[:, i] for t in (found, want))
        np.testing.assert_allclose(K / rows, wanted, atol=1e-9)
    np.testing.assert_allclose(found["scale"] * SENSORS[:2], want["scale"], rtol=1e-6)


@pytest.mark.filterwarnings("error")
def test_design_given_other_units_finds_the_same_filters_to_compare_with():
    sizes = [np.ones(3), np.full(3, 2.0**13)]
    plain, scaled = (in_units(one, SENSORS).info for one in sizes)
    mixed = in_units(STATES, SENSORS).info
    for key in ("trace_P", "trace_P_no_attack", "trace_P_central_kalman"):
        assert scaled[key] == pytest.approx(2.0**26 * plain[key], rel=1e-9)
        assert np.isfinite(mixed[key])


@pytest.mark.parametrize("order", [[0, 1, 2], [1, 2, 0], [2, 1, 0]])
def test_recursive_tables_given_mixed_units_hold_roots_of_the_covariances(order):
    states = STATES[order]
    tables = in_units(states, SENSORS, gains="recursive").tables.to_json()["recursive"]
    plain = in_units(np.ones(3), np.ones(4), gains="recursive").tables.to_json()["recursive"]
    lower = np.tril_indices(3)
    np.testing.assert_allclose(tables["L0"] / states[lower[0]], plain["L0"], atol=1e-9)
    V, wanted = (np.reshape(one["V"], (3, 3)) for one in (tables, plain))
    V = V / states[:, None]
    np.testing.assert_allclose(V @ V.T, wanted @ wanted.T, atol=1e-12)


def test_design_given_no_strong_sensor_or_only_strong_ones_refuses():
    made, found, parsed = grid()
    with pytest.raises(DesignError, match="attack.strong"):
        joint.design(dataclasses.replace(made, strong=[]), found, parsed)
    with pytest.raises(DesignError, match="every sensor is strong"):
        joint.design(dataclasses.replace(made, strong=list(made.sensors)), found, parsed)


def test_design_given_a_pair_that_misses_a_mode_refuses_or_reports_it():
    plant = {"A": [[1.0, 0.0], [0.0, 1.1]], "C": [[1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, 0.5]],
             "Q": [1.0, 1.0], "R": [1.0] * 4}
    made = models.parse({"name": "two", "dt_s": 1.0, "plant": plant,
                         "attack": {"strong": ["y1", "y3"]}}, "two")
    found = kalman.steady_state(made.A, made.C, made.W, made.R)
    parsed = options.parse(joint.Options, {"pairs": [["y2", ["y1"]]]}, "x")
    info = joint.design(made, found, parsed).info
    assert info["unseen_by_partners"] == {"y2": ["1.1"]}
    assert "stays unseen" in info["verdict"]
    blind = dataclasses.replace(made, C=made.C.copy())
    blind.C[1] = [1.0, 0.0]
    with pytest.raises(DesignError, match=r"do not see the mode 1\.1"):
        joint.design(blind, found, parsed)


def test_recursive_tables_hold_roots_of_the_covariances():
    made, found, parsed = grid(gains="recursive", eta=[1.0, 4.0])
    tables = joint.design(made, found, parsed).tables.to_json()["recursive"]
    V = np.reshape(tables["V"], (4, 4))
    np.testing.assert_allclose(V @ V.T, made.W, atol=1e-14)
    L = np.zeros((4, 4))
    L[np.tril_indices(4)] = tables["L0"]
    np.testing.assert_allclose(L @ L.T, found.P, atol=1e-14)
    assert tables["theta_sd"] == [1.0, 2.0]
