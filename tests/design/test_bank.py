# SPDX-License-Identifier: MIT
"""Method `bank`: design against the reference, and the C library against both."""

from dataclasses import replace

import numpy as np
import pytest
import shared_data
from bank_library import BankLibrary, compile_library
from c_library import DEGRADED, MISSING
from golden import MODELS
from scipy.signal import lfilter

from blw import bank, bank_build
from blw import bank_moments as moments
from blw.bank import Options
from blw.errors import DesignError
from blw.kalman import steady_state
from blw.model import load, parse
from blw.tables import Struct, real

PAPER = {"theta": 1, "left_inverse": "pinv"}
LQR = np.array([[0.604, 1.678, 39.514, 9.721]])  # of the pendulum, u = LQR x


@pytest.fixture(scope="module")
def libraries(tmp_path_factory):
    folder = tmp_path_factory.mktemp("library")
    return {width: compile_library(folder, width) for width in ("f32", "f64")}


@pytest.fixture(scope="module")
def reference():
    return shared_data.golden("bank_drone5")


def named(name):
    model = load(MODELS / f"{name}.toml")
    return model, steady_state(model.A, model.C, model.W, model.R)


def plant(name, C, R, p=1, A=None, **attack):
    A = [[0.9, 0.2], [0.0, 0.7]] if A is None else A
    model = parse({"name": name, "dt_s": 0.1,
                   "plant": {"A": np.asarray(A).tolist(), "C": np.asarray(C).tolist(),
                             "Q": [0.1] * len(A), "R": np.asarray(R).tolist()},
                   "attack": {"p": p, **attack}}, name)
    return model, steady_state(model.A, model.C, model.W, model.R)


def raw(designed, horizon):
    """The design with averages that are the newest q itself, from the first block on."""
    members = dict(designed.tables.members)
    members |= {"gain": real(1.0), "ceiling": real(1e30), "warm_up": horizon, "window": 0}
    return replace(designed, tables=Struct("blw_bank_model_t", "bank", members, method="bank"))


def simulated(model, steps, seed):
    """x, u, y without attack, mode by mode; the pendulum is stabilised through its known input."""
    generator = np.random.default_rng(seed)
    w = generator.multivariate_normal(np.zeros(model.n), model.W, steps)
    v = generator.multivariate_normal(np.zeros(model.m), model.R, steps)
    values, V = np.linalg.eig(model.A + (model.Bu @ LQR if model.l else 0.0))
    drive = w @ np.linalg.inv(V).T
    modes = [lfilter([1.0], [1.0, -z], column) for z, column in zip(values, drive.T)]
    x = (np.array(modes).T @ V.T).real
    before = np.vstack([np.zeros(model.n), x[:-1]])
    u = before @ LQR.T if model.l else np.zeros((steps, 0))
    return x, u, x @ model.C.T + v + model.offset


@pytest.mark.parametrize("version", ["prediction", "filter"])
@pytest.mark.parametrize("variant", ["paper", "gls"])
def test_design_reproduces_reference(reference, variant, version):
    golden = reference[variant]
    options = {"window": 100, "version": version, "grouped": golden["grouped"]}
    made = bank_build.build(named("drone5")[0],
                            Options(**options, **(PAPER if variant == "paper" else {})))
    pairs = {(tuple(pair["c"]), tuple(pair["i"])): pair for pair in golden["pairs"]}
    for member in made.members:
        at = golden["sets"].index(list(member.sensors))
        assert np.trace(member.Pp) == pytest.approx(golden["Popt_pred"][at], rel=1e-9)
        assert np.trace(member.P) == pytest.approx(golden["Popt_filt"][at], rel=1e-9)
        np.testing.assert_allclose(member.K[:, list(member.sensors)], golden["Kf"][at], rtol=1e-9,
                                   atol=1e-12)
    for block in made.blocks:
        at = golden["subsets"].index(list(block.sensors))
        assert block.horizon == golden["h"][at]
        np.testing.assert_allclose(block.Z, np.reshape(golden["Z"][at], block.Z.shape), rtol=1e-9,
                                   atol=1e-9)
    for test in made.tests:
        pair = pairs[made.members[test.member].sensors, made.blocks[test.block].sensors]
        base = "base" if version == "prediction" else "base_filt"
        assert test.mean == pytest.approx(pair[base], rel=1e-9)
        if version == "prediction":
            assert test.epsilon == pytest.approx(pair["eps"], rel=1e-9)


@pytest.mark.parametrize("width", ["f32", "f64"])
@pytest.mark.parametrize("version", ["prediction", "filter"])
@pytest.mark.parametrize("variant", ["paper", "gls"])
def test_library_reproduces_reference(reference, libraries, variant, version, width):
    model, kalman = named("drone5")
    golden, tolerance = reference[variant], 1e-9 if width == "f64" else 1e-4
    options = Options(version=version, **(PAPER if variant == "paper" else {}))
    made = bank_build.build(model, options)
    library = BankLibrary(libraries[width], model, kalman,
                          raw(bank.design(model, kalman, options), made.horizon))
    estimates = np.array(reference["xhat_pred" if version == "prediction" else "xhat_filt"])
    y, limits = np.array(reference["y"]), np.array([test.limit for test in made.tests])
    found = []
    for k in range(len(y)):
        assert library.step(y[k]) == 0
        chosen = golden["sets"].index(list(made.members[library.self.choice].sensors))
        np.testing.assert_allclose(library.x_hat(), estimates[chosen, k], rtol=tolerance,
                                   atol=tolerance)
        found.append(library.self.average[:len(limits)])
    found = np.array(found)[made.horizon - 1:] * limits
    for column, test in enumerate(made.tests):
        member, block = made.members[test.member], made.blocks[test.block]
        x = estimates[golden["sets"].index(list(member.sensors))]
        Y = np.stack([y[j:j + len(found), list(block.sensors)] for j in range(block.horizon)], 1)
        x_i = Y.reshape(len(found), -1) @ block.Z.T
        q = np.sum((x_i - x[:len(found)])**2, axis=1)
        np.testing.assert_allclose(found[:, column], q, rtol=tolerance, atol=tolerance * q.mean())


def test_library_decides_windows_as_the_reference(reference, libraries):
    model, kalman = named("drone5")
    options = Options(window=100, version="prediction")
    designed = bank.design(model, kalman, options)
    designed.tables.members["warm_up"] = designed.info["horizon"]
    library = BankLibrary(libraries["f64"], model, kalman, designed)
    sets = [member.sensors for member in bank_build.build(model, options).members]
    for k, y in enumerate(reference["y"]):
        assert library.step(y) == 0
        window, rest = divmod(k - designed.info["horizon"] + 1, 100)
        if rest == 99:
            golden = reference["gls"]["windows"][window]
            passed = {tuple(s): w["passed"] for s, w in zip(reference["gls"]["sets"], golden)}
            assert [worst <= 1.0 for worst in library.self.worst[:5]] == [passed[s] for s in sets]


@pytest.mark.parametrize("version", ["prediction", "filter"])
@pytest.mark.parametrize("name", ["drone5", "pendulum", "correlated"])
def test_benign_mean_and_false_rejection_equal_their_formulas(libraries, name, version):
    if name == "correlated":
        R = 0.1 * np.eye(4) + 0.08
        model, kalman = plant(name, [[1, 0], [1, 1], [2, -1], [1, -1]], R)
    else:
        model, kalman = named(name)
    options = Options(memory=25, version=version, false_rejection=0.08)
    made = bank_build.build(model, options)
    designed = bank.design(model, kalman, options)
    library = BankLibrary(libraries["f64"], model, kalman, raw(designed, made.horizon))
    _, u, y = simulated(model, 400_000, 11)
    ratio = library.run(y, u)[4][500:]
    limits = np.array([test.limit for test in made.tests])
    means = np.array([test.mean for test in made.tests])
    np.testing.assert_allclose(ratio.mean(axis=0) * limits, means, rtol=0.01)
    averaged = lfilter([made.gain], [1.0, made.gain - 1.0], ratio, axis=0)[500:]
    rates = (averaged > 1.0).mean(axis=0)
    np.testing.assert_allclose(rates, designed.info["false_rejection_per_test"], rtol=0.15)


def test_false_rejection_equals_its_formula_in_windows(libraries):
    model, kalman = named("drone5")
    options = Options(window=50, false_rejection=0.08)
    made = bank_build.build(model, options)
    designed = bank.design(model, kalman, options)
    library = BankLibrary(libraries["f64"], model, kalman, raw(designed, made.horizon))
    _, u, y = simulated(model, 500_000, 5)
    windows = library.run(y, u)[4][50:].reshape(-1, 50, len(made.tests)).mean(axis=1)
    assert (windows > 1.0).mean() == pytest.approx(0.02, rel=0.15)


def test_gls_has_less_noise_than_pinv_and_both_are_left_inverses():
    for name in ("drone5", "pendulum"):
        model = named(name)[0]
        noise = moments.Noise(model.A, model.C, model.W, model.R)
        for h in (4, 6, 24):
            subset = (0, 1)
            O = moments.observability_matrix(model.A, model.C[list(subset)], h)
            traces = []
            for kind in ("gls", "pinv"):
                Z = moments.left_inverse(noise, subset, h, kind)
                np.testing.assert_allclose(Z @ O, np.eye(model.n), atol=1e-7)
                N = Z @ moments.block_response(noise, subset, h)
                traces.append(np.trace(N @ np.kron(np.eye(h), noise.joint) @ N.T))
            assert traces[0] <= traces[1] * (1 + 1e-9)


def test_float32_holds_far_from_the_origin_of_an_unstable_plant(libraries):
    model, kalman = named("pendulum")
    designed = bank.design(model, kalman, Options())
    _, u, y = simulated(model, 800, 3)
    sigma = np.sqrt(np.diag(kalman.P))
    far, found = np.array([1000.0, 0.0, 0.0, 0.0]), {}
    for width in ("f32", "f64"):
        library = BankLibrary(libraries[width], model, kalman, designed)
        assert library.reset(far) == 0
        found[width] = library.run(y + model.C @ far, u)
    assert np.abs((found["f32"][0] - found["f64"][0]) / sigma).max() < 0.02
    np.testing.assert_allclose(found["f32"][3], found["f64"][3], rtol=0.02)
    assert (found["f32"][1:3] == np.array(found["f64"][1:3])).mean() > 0.99


def test_attacked_pair_is_excluded_and_named(libraries):
    model, kalman = named("drone6")
    library = BankLibrary(libraries["f32"], model, kalman, bank.design(model, kalman, Options()))
    x, _, y = simulated(model, 1500, 2)
    y[500:, [1, 3]] += [2.0, -3.0]
    estimate, _, excluded, statistic, _ = library.run(y)
    assert (excluded[600:] == 0b1010).mean() > 0.95
    assert (excluded[:500] == 0).mean() > 0.95
    assert (statistic[600:] > 1.0).all()
    assert np.mean((estimate - x)[520:]**2) < 1.3 * np.mean((estimate - x)[20:500]**2)


def test_silent_sensor_is_left_out_and_its_return_is_harmless(libraries):
    model, kalman = named("drone5")
    library = BankLibrary(libraries["f32"], model, kalman, bank.design(model, kalman, Options()))
    x, _, y = simulated(model, 900, 4)
    error = np.empty(900)
    for k in range(900):
        silent = 300 <= k < 600
        y[k, 2] = np.nan if silent else y[k, 2]
        assert library.step(y[k]) == 0
        assert bool(library.out.flags & MISSING) == silent
        error[k] = np.sum((library.x_hat() - x[k])**2)
        if silent and library.out.outcome == 1:
            assert not library.out.flags & DEGRADED
    assert error[300:600].mean() < 1.3 * error[30:300].mean()
    assert error[600:].mean() < 1.3 * error[30:300].mean()


def test_groups_fall_together():
    C = np.random.default_rng(1).standard_normal((6, 2))
    names = [f"y{i + 1}" for i in range(6)]
    model, kalman = plant("grouped", C, 0.1 * np.eye(6), groups=[names[:2], names[2:4]])
    designed = bank.design(model, kalman, Options())
    sets = {tuple(found["sensors"]) for found in designed.info["sets"]}
    assert sets == {("y3", "y4", "y5", "y6"), ("y1", "y2", "y5", "y6"),
                    ("y1", "y2", "y3", "y4", "y6"), ("y1", "y2", "y3", "y4", "y5")}


def test_footprint_is_what_the_library_asks_for(libraries):
    for name in ("drone5", "drone6", "pendulum"):
        model, kalman = named(name)
        designed = bank.design(model, kalman, Options())
        library = BankLibrary(libraries["f64"], model, kalman, designed)
        assert library.status == 0
        library.memory = (library.real * (len(library.memory) - 1))()
        assert library.init() == -3
        figures = designed.info["footprint"]
        assert sum(values.size for values in designed.tables.reals()) == figures["table_numbers"]


def test_limit_of_the_device_is_served():
    C = np.random.default_rng(1).standard_normal((8, 2))
    model, kalman = plant("largest", C, 0.1 * np.eye(8), p=2)
    designed = bank.design(model, kalman, Options())
    assert len(designed.info["sets"]) == 28 and len(designed.info["subsets"]) == 70
    assert designed.info["footprint"]["memory_numbers"] < 1200


ROWS = [[1, 0], [1, 1], [2, -1], [1, -1]]


@pytest.mark.parametrize(("C", "p", "options", "message"), [
    (ROWS * 3, 1, {}, "12 sensors: the bank serves at most 8"),
    (ROWS * 2, 3, {}, "p = 3: the bank serves at most 2"),
    (ROWS[:2], 1, {}, "2 sensors with p = 1 attacked leave none to decide"),
    (ROWS, 1, {"theta": 3}, "theta = 3 is larger than m - 2 p = 2"),
    ([[1, 0], [0, 1], [0, 2], [1, 1]], 1, {}, "{y2, y3} alone cannot see the mode 0.9"),
    (ROWS, 1, {"theta": 1, "horizon": 1}, "shorter than the observability index 2 of {y1}"),
    (ROWS, 1, {"grouped": True}, "grouped needs a window"),
    (ROWS, 1, {"window": 100, "memory": 50}, 'memory needs window = "ewma"'),
    (ROWS, 1, {"grouped": True, "window": 100}, "not a multiple of the 6 groups"),
])
def test_design_refuses_what_it_cannot_serve(C, p, options, message):
    A = [[0.9, 0.2], [0.0, 0.9]]
    model, kalman = plant("refused", C, 0.1 * np.eye(len(C)), p=p, A=A)
    with pytest.raises(DesignError) as error:
        bank.design(model, kalman, Options(**options))
    assert message in str(error.value)


def test_build_given_other_units_of_the_states_finds_the_same_inverses():
    model, _ = named("pendulum")
    units = np.geomspace(1e7, 1e-7, model.n)
    other = replace(model, A=model.A * units[:, None] / units, B=model.B * units[:, None],
                    C=model.C / units)
    pairs = zip(bank_build.build(model, Options()).blocks,
                bank_build.build(other, Options()).blocks, strict=True)
    for block, rescaled in pairs:
        assert rescaled.sensors == block.sensors
        assert rescaled.Z / units[:, None] == pytest.approx(
            block.Z, rel=0, abs=1e-12 * np.abs(block.Z).max())


def test_design_given_a_state_without_noise_has_no_advice():
    model = parse({"name": "still", "dt_s": 0.1, "attack": {"p": 1},
                   "plant": {"A": [[0.5]], "C": [[1.0]] * 3, "Q": [0.0], "R": [1.0] * 3}}, "still")
    info = bank.design(model, steady_state(model.A, model.C, model.W, model.R), Options()).info
    assert (info["P_opt_max"], info["advice"]) == (0.0, None)


def test_advice_names_a_longer_horizon_where_epsilon_is_large():
    model, kalman = named("pendulum")
    advice = bank.design(model, kalman, Options()).info["advice"]
    assert "horizon = 12 makes it 1.26 P_opt" in advice
    for name in ("drone5", "drone6"):
        assert bank.design(*named(name), Options()).info["advice"] is None


@pytest.mark.filterwarnings("error")
def test_design_given_other_units_of_the_states_warns_of_nothing():
    model, _ = named("drone5")
    units = np.logspace(-3.0, 3.0, model.n)
    other = replace(model, A=model.A * units[:, None] / units, B=model.B * units[:, None],
                    Bu=model.Bu * units[:, None], C=model.C / units)
    made = [bank.design(one, steady_state(one.A, one.C, one.W, one.R), Options())
            for one in (model, other)]
    assert made[1].info["warm_up_steps"] == made[0].info["warm_up_steps"]
