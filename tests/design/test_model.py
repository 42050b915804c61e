# SPDX-License-Identifier: MIT
"""Model files: what is accepted, how it is resolved, and every refusal with its message."""

import copy
import math
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import solve_continuous_lyapunov

from blw import model as model_module
from blw.errors import ModelError

MODELS = Path(__file__).resolve().parents[2] / "host_sim" / "models"

SOUND = {
    "name": "cart",
    "dt_s": 0.5,
    "plant": {
        "states": ["x_m", "v_m_s"],
        "sensors": ["gps", "wheel", "radar"],
        "inputs": ["force_N"],
        "A": [[1.0, 0.5], [0.0, 1.0]],
        "Bu": [[0.125], [0.5]],
        "C": [[1, 0], [0, 1], [1, 0]],
        "Q": [0.01, 0.02],
        "R": [[1.0, 0.1, 0.0], [0.1, 2.0, 0.0], [0.0, 0.0, 3.0]],
    },
    "attack": {"p": 1},
}

MISSING = object()


def changed(path: str, value: object) -> dict:
    """SOUND with the value at a dotted path replaced, or removed."""
    mapping = copy.deepcopy(SOUND)
    *tables, key = path.split(".")
    place = mapping
    for table in tables:
        place = place.setdefault(table, {})
    if value is MISSING:
        del place[key]
    else:
        place[key] = value
    return mapping


@pytest.mark.parametrize("file", sorted(MODELS.glob("*.toml")), ids=lambda path: path.stem)
def test_load_given_shipped_model_accepts_it(file):
    model = model_module.load(file)
    assert model.name == file.stem
    assert model.A.shape == (model.n, model.n)
    assert model.C.shape == (model.m, model.n)
    assert len(model.sha256) == 64


def test_parse_given_sound_model_resolves_defaults():
    model = model_module.parse(SOUND, "cart.toml")
    assert (model.n, model.m, model.l, model.p) == (2, 3, 1, 1)
    np.testing.assert_array_equal(model.B, np.eye(2))
    np.testing.assert_array_equal(model.Q, np.diag([0.01, 0.02]))
    np.testing.assert_array_equal(model.x0, np.zeros(2))
    np.testing.assert_array_equal(model.offset, np.zeros(3))
    assert model.P0 is None
    assert np.isinf(model.range).all()
    assert model.units == [[0], [1], [2]]


def test_parse_given_no_names_numbers_them():
    mapping = copy.deepcopy(SOUND)
    for key in ("states", "sensors", "inputs"):
        del mapping["plant"][key]
    model = model_module.parse(mapping, "cart.toml")
    assert model.states == ["x1", "x2"]
    assert model.sensors == ["y1", "y2", "y3"]
    assert model.inputs == ["u1"]


def test_parse_given_no_inputs_has_empty_Bu():
    mapping = changed("plant.Bu", MISSING)
    del mapping["plant"]["inputs"]
    model = model_module.parse(mapping, "cart.toml")
    assert model.l == 0
    assert model.Bu.shape == (2, 0)


def test_parse_given_groups_counts_p_over_them():
    mapping = changed("attack", {"p": 1, "groups": [["gps", "radar"]], "strong": ["wheel"]})
    model = model_module.parse(mapping, "cart.toml")
    assert model.units == [[0, 2], [1]]
    assert model.strong == ["wheel"]


def test_parse_given_half_open_range_keeps_the_limit():
    model = model_module.parse(changed("plant.range", [[0, math.inf], [-1, 1], [-5, 5]]), "m")
    np.testing.assert_array_equal(model.range[:2], [[0, np.inf], [-1, 1]])


def test_parse_given_continuous_double_integrator_discretises_exactly():
    mapping = changed("plant.continuous", True)
    mapping["plant"] |= {"A": [[0, 1], [0, 0]], "Bu": [[0], [1]], "B": [[0], [1]], "Q": [2.0]}
    model = model_module.parse(mapping, "cart.toml")
    dt = 0.5
    np.testing.assert_allclose(model.A, [[1, dt], [0, 1]], atol=1e-15)
    np.testing.assert_allclose(model.Bu, [[dt**2 / 2], [dt]], atol=1e-15)
    np.testing.assert_allclose(model.W, 2 * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]]),
                               atol=1e-14)


SYMMETRIC_BUT_INDEFINITE = [[1, 2, 0], [2, 1, 0], [0, 0, 1]]

MALFORMED = [
    ("name", MISSING, "cart.toml: name is missing"),
    ("name", "2fast", "name must be a C identifier"),
    ("name", "my-cart", "name must be a C identifier"),
    ("name", "while", "name 'while' is a keyword of C"),
    ("name", 7, "name must be a C identifier"),
    ("name", "_Bool", "name must be a C identifier"),
    ("dt_s", MISSING, "dt_s is missing"),
    ("dt_s", 0.0, "dt_s must be a positive number, not 0.0"),
    ("dt_s", -1, "dt_s must be a positive number"),
    ("dt_s", math.nan, "dt_s must be a positive number"),
    ("dt_s", "0.1", "dt_s must be a positive number, not '0.1'"),
    ("dt_s", True, "dt_s must be a positive number"),
    ("dt", 0.1, "cart.toml: unknown key 'dt'; did you mean 'dt_s'?"),
    ("plant", MISSING, "plant is missing"),
    ("plant", [1], "plant must be a table"),
    ("plant.bu", [[1], [2]], "cart.toml: plant: unknown key 'bu'; did you mean 'Bu'?"),
    ("plant.sensor", ["a"], "unknown key 'sensor'; did you mean 'sensors'?"),
    ("plant.A", MISSING, "plant.A is missing"),
    ("plant.A", [], "plant.A must be a list of rows"),
    ("plant.A", 3, "plant.A must be a list of rows, not 3"),
    ("plant.A", [[1, 0], [0]], "plant.A row 2 has 1 numbers, expected 2"),
    ("plant.A", [[1, 0, 0], [0, 1, 0]], "plant.A must be square, not 2 x 3"),
    ("plant.A", [[1, math.nan], [0, 1]], "plant.A row 1, column 2, is nan; it must be finite"),
    ("plant.A", [[1, 0], [math.inf, 1]], "plant.A row 2, column 1, is inf"),
    ("plant.A", [[1, "a"], [0, 1]], "plant.A row 1, column 2, must be a number, not 'a'"),
    ("plant.A", [[1, True], [0, 1]], "row 1, column 2, must be a number"),
    ("plant.A", [[10**400, 0], [0, 1]], "plant.A row 1, column 1, is 1000"),
    ("plant.range", [[0, 10**400], [0, 1], [0, 1]], "plant.range row 1 must be a pair"),
    ("plant.A", [1, 0], "plant.A row 1 must be a list of numbers, not 1"),
    ("plant.Bu", [[1]], "plant.Bu has 1 rows, expected 2"),
    ("plant.Bu", [0.5, 1], "plant.Bu row 1 must be a list of numbers"),
    ("plant.Bu", MISSING, "plant.inputs has 1 names, but Bu makes it 0"),
    ("plant.B", [[1], [2], [3]], "plant.B has 3 rows, expected 2"),
    ("plant.C", [[1, 0], [1], [0, 1]], "plant.C row 2 has 1 numbers, expected 2"),
    ("plant.C", [[1, 0]] * 65, "plant.C is too large: 65, at most 64"),
    ("plant.Q", [0.1], "plant.Q has 1 numbers, expected 2"),
    ("plant.Q", [0.1, -0.1], "plant.Q has the variance -0.1 in row 2"),
    ("plant.Q", [[1, 2], [2, 1]], "plant.Q is not positive semidefinite: the smallest eigenvalue"),
    ("plant.Q", [[1, 0.5], [0.4, 1]],
     "plant.Q is not symmetric: row 1, column 2 is 0.5 but row 2, column 1 is 0.4"),
    ("plant.R", [1, 0, 1], "plant.R has the variance 0 in row 2 (wheel); it must be positive"),
    ("plant.R", [1, 1], "plant.R has 2 numbers, expected 3"),
    ("plant.R", SYMMETRIC_BUT_INDEFINITE, "plant.R is not positive definite: the smallest"),
    ("plant.R", [[1, 1, 0], [1, 1, 0], [0, 0, 1]], "plant.R is not positive definite"),
    ("plant.x0", [1], "plant.x0 has 1 numbers, expected 2"),
    ("plant.x0", [0, math.inf], "plant.x0 entry 2 is inf"),
    ("plant.P0", [1, -1], "plant.P0 has the variance -1 in row 2"),
    ("plant.offset", [0, 0, 0, 0], "plant.offset has 4 numbers, expected 3"),
    ("plant.offset", 1.0, "plant.offset must be a list of numbers"),
    ("plant.range", [[0, 1]], "plant.range must be a list of 3 pairs"),
    ("plant.range", [[0, 1], [2, 1], [0, 1]], "plant.range row 2 must be a pair [low, high]"),
    ("plant.range", [[0, 1], [math.nan, 1], [0, 1]], "plant.range row 2"),
    ("plant.continuous", "yes", "plant.continuous must be true or false"),
    ("plant.states", ["x_m"], "plant.states has 1 names, but A makes it 2"),
    ("plant.states", ["x_m", "x m"], "'x m' and 'x_m' have the same C name X_M"),
    ("plant.states", "x", "plant.states must be a list of names"),
    ("plant.sensors", ["gps", "gps", "radar"], "plant.sensors: 'gps' is given twice"),
    ("plant.sensors", ["gps", "a,b", "radar"], "plant.sensors: 'a,b' must be printable ASCII"),
    ("plant.sensors", ["gps", "", "radar"], "plant.sensors: '' must be printable ASCII"),
    ("plant.sensors", ["gps", "t_s", "radar"], "'t_s' is the name of another column"),
    ("plant.sensors", ["gps", "***", "radar"], "'***' has no letter or digit"),
    ("plant.inputs", ["gps"], "plant.inputs uses the name 'gps', which is a sensor's"),
    ("attack.p", 3, "attack.p is 3; it must be at least 0 and less than the number of sensors, 3"),
    ("attack.p", -1, "attack.p is -1"),
    ("attack.p", 1.5, "attack.p must be an integer, not 1.5"),
    ("attack.strong", ["gpss"], "strong names 'gpss', which is no sensor; did you mean 'gps'?"),
    ("attack.strong", ["gps", "gps"], "strong names 'gps' twice"),
    ("attack.groups", [["gps", "laser"]], "groups, group 1, names 'laser', which is no sensor"),
    ("attack.groups", [["gps"], ["gps"]], "attack.groups has the sensor 'gps' twice"),
    ("attack.groups", [[]], "attack.groups has nothing in group 1"),
    ("attack.groups", [["gps", "wheel", "radar"]], "less than the number of groups, 1"),
    ("attack.q", 1, "cart.toml: attack: unknown key 'q'"),
    ("method.laso", {}, "cart.toml: method: unknown key 'laso'; did you mean 'lasso'?"),
    ("method.lasso", 5, "method.lasso must be a table of options"),
]


@pytest.mark.parametrize("path, value, message", MALFORMED)
def test_parse_given_malformed_model_says_what_and_where(path, value, message):
    with pytest.raises(ModelError) as caught:
        model_module.parse(changed(path, value), "cart.toml")
    assert message in str(caught.value)
    assert str(caught.value).startswith("cart.toml: ")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("dt_s", [0.02, 0.05, 0.1, 10.0])
def test_discretise_given_fast_decay_keeps_the_noise(dt_s):
    A, Q = np.array([[-1e3, 1e2], [-1.0, -1.0]]), np.eye(2)
    Ad, _, _, Qd = model_module.discretise(A, np.zeros((2, 0)), np.eye(2), Q, dt_s)
    steady = solve_continuous_lyapunov(A, -Q)  # also of the discrete plant
    np.testing.assert_allclose(Qd, steady - Ad @ steady @ Ad.T, rtol=1e-9)


def test_parse_given_growth_beyond_a_double_over_dt_names_A():
    mapping = changed("plant.continuous", True)
    mapping["plant"]["A"] = [[1e30, 0.0], [0.0, 1.0]]
    with pytest.raises(ModelError, match="plant.A discretised over dt_s = 0.5 s is beyond"):
        model_module.parse(mapping, "cart.toml")


def test_parse_given_a_method_that_is_not_there_refuses_it():
    with pytest.raises(ModelError, match="method: unknown key 'sentry'; known: kalman, lasso"):
        model_module.parse(changed("method.sentry", {}), "cart.toml")


def test_load_given_deeply_nested_list_refuses_it(tmp_path):
    file = tmp_path / "bad.toml"
    file.write_text("A = " + "[" * 100000)
    with pytest.raises(ModelError, match="nested too deeply"):
        model_module.load(file)


def test_load_given_missing_file_names_it(tmp_path):
    with pytest.raises(ModelError, match="nowhere.toml: No such file"):
        model_module.load(tmp_path / "nowhere.toml")


def test_load_given_bad_toml_gives_the_line(tmp_path):
    file = tmp_path / "bad.toml"
    file.write_text('name = "x"\ndt_s = = 1\n')
    with pytest.raises(ModelError, match="bad.toml: .*line 2"):
        model_module.load(file)


def test_load_given_binary_file_refuses_it(tmp_path):
    file = tmp_path / "bad.toml"
    file.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ModelError, match="not a text file in UTF-8"):
        model_module.load(file)
