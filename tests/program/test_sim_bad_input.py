# SPDX-License-Identifier: MIT
"""Bad input to blw_sim: one line that says what and where, exit status 2, nothing written."""

import json

import pytest
from sim_case import write_design, write_scenario

HEADER = "k,t_s,a,b,c,force_N\n"
ROWS = "0,0,,,,0\n1,0.1,1,1,1,0\n2,0.2,1,1,1,0\n"

LOGS = {
    "empty": ("", "in.csv: is empty"),
    "blank": ("\n \n", "in.csv: is empty"),
    "utf-16": ("k\0,\0t\0\n\0", "in.csv: is no text in ASCII or UTF-8"),
    "header only": (HEADER, "in.csv: has no measurement"),
    "one row": (HEADER + "0,0,,,,0\n", "in.csv: has no measurement"),
    "unknown column": ("k,t_s,a,b,c,force_N,zeta\n", 'in.csv:1:21: zeta: unknown column'),
    "missing sensor": ("k,t_s,a,b,force_N\n", 'in.csv:1:1: column "c" is missing'),
    "missing input": ("k,t_s,a,b,c\n", 'in.csv:1:1: column "force_N" is missing'),
    "missing k": ("t_s,a,b,c,force_N\n", 'in.csv:1:1: column "k" is missing'),
    "missing t_s": ("k,a,b,c,force_N\n", 'in.csv:1:1: column "t_s" is missing'),
    "column twice": ("k,t_s,a,a,c,force_N\n", 'in.csv:1:9: column "a" twice'),
    "nameless column": ("k,t_s,,b,c,force_N\n", "in.csv:1:7: column without a name"),
    "text": (HEADER + "0,0,,,,0\n1,0.1,1,one,1,0\n", 'in.csv:3:9: b: "one" is not a finite'),
    "nan": (HEADER + "0,0,,,,0\n1,0.1,nan,1,1,0\n", 'in.csv:3:7: a: "nan" is not a finite'),
    "inf": (HEADER + "0,0,,,,0\n1,0.1,1,1,inf,0\n", 'in.csv:3:11: c: "inf" is not a finite'),
    "overflow": (HEADER + "0,0,,,,0\n1,0.1,1,1e999,1,0\n", 'in.csv:3:9: b: "1e999"'),
    "trailing text": (HEADER + "0,0,,,,0\n1,0.1,1m,1,1,0\n", 'in.csv:3:7: a: "1m"'),
    "short row": (HEADER + "0,0,,,,0\n1,0.1,1,1\n", "in.csv:3:9: b: row with 4 cells"),
    "long row": (HEADER + "0,0,,,,0\n1,0.1,1,1,1,0,7\n", "in.csv:3:13: force_N: row with 7 cells"),
    "blank row": (HEADER + "0,0,,,,0\n\n1,0.1,1,1,1,0\n", "in.csv:3:1: k: row with 1 cells"),
    "k falls": (HEADER + "0,0,,,,0\n1,0.1,1,1,1,0\n1,0.2,1,1,1,0\n", "in.csv:4:1: k: k must count"),
    "k jumps": (HEADER + "0,0,,,,0\n2,0.2,1,1,1,0\n", "in.csv:3:1: k: k must count up by one"),
    "k broken": (HEADER + "0,0,,,,0\n1.5,0.1,1,1,1,0\n", "in.csv:3:1: k: expected an integer"),
    "k empty": (HEADER + ",0,,,,0\n1,0.1,1,1,1,0\n", "in.csv:2:1: k: empty"),
    "time falls": (HEADER + "0,0,,,,0\n1,-0.1,1,1,1,0\n", "in.csv:3:3: t_s: time must increase"),
    "input empty": (HEADER + "0,0,,,,\n1,0.1,1,1,1,0\n", "in.csv: an input is empty"),
}


@pytest.fixture
def case(blw_sim, refused, tmp_path):
    """Call blw_sim with a design of `cart`; returns its complaint."""
    design = write_design(tmp_path, "cart")

    def call(command, path, *arguments, design=design):
        out = tmp_path / "out"
        message = refused(blw_sim(command, path, "--design", design, "--out", out, *arguments))
        assert not out.exists()
        return message
    return call


@pytest.mark.parametrize("name", LOGS)
def test_replay_given_malformed_log_says_where(case, tmp_path, name):
    text, message = LOGS[name]
    (tmp_path / "in.csv").write_text(text)
    assert message in case("replay", tmp_path / "in.csv")


MAPS = {
    "no toml": ("time = ", "map.toml:1:"),
    "unknown key": ('tiem = "t_s"', 'map.toml:1:1: unknown key "tiem"'),
    "unknown sensor": ('[columns]\nz = "a"', 'map.toml:2:1: unknown key "z"'),
    "missing column": ('[columns]\na = "zz"', 'in.csv:1:1: column "zz" for a is missing'),
    "missing time": ('time = "tt"', 'in.csv:1:1: time column "tt" is missing'),
    "factor": ('[columns]\na = { column = "a", unit_factor = "x" }', "unit_factor: expected"),
    "first row": ('first_row = "maybe"', "map.toml:1:13: first_row: expected"),
    "wrong grid": ('time = "b"', "time must increase"),
    "wrong step": ('time = "k"', "in.csv:3:1: time goes on by 1 s, the model's dt_s is 0.1"),
}


@pytest.mark.parametrize("name", MAPS)
def test_replay_given_bad_map_says_where(case, tmp_path, name):
    text, message = MAPS[name]
    (tmp_path / "map.toml").write_text(text)
    (tmp_path / "in.csv").write_text(HEADER + "0,0,0,1,0,0\n1,0.1,1,1,1,0\n")
    assert message in case("replay", tmp_path / "in.csv", "--map", tmp_path / "map.toml")


BIAS = '[[attack]]\nsensor = "a"\nkind = "bias"\nvalue = 1.0\n'
WAVE = ('steps = 3\n[controller]\nkind = "wave"\n[[controller.wave]]\n'
        'input = "force_N"\nvalue = 1.0\n')

SCENARIOS = {
    "no toml": ("steps = = 3", "scenario.toml:2:"),
    "no steps": ("", "scenario.toml:1:1: steps: missing"),
    "steps 0": ("steps = 0", "scenario.toml:2:9: steps: must be from 1"),
    "steps text": ('steps = "3"', "scenario.toml:2:9: steps: expected an integer"),
    "unknown key": ("steps = 3\nstep = 4", 'scenario.toml:3:1: unknown key "step"'),
    "initial": ('steps = 3\ninitial = "zero"', "scenario.toml:3:11: initial: expected"),
    "initial size": ("steps = 3\ninitial = [1.0]", "initial: expected 2 states"),
    "no P0": ('steps = 3\ninitial = "P0"', "initial: the model has no P0"),
    "controller": ('steps = 3\n[controller]\nkind = "pid"', "scenario.toml:4:8: kind: expected"),
    "gain": ('steps = 3\n[controller]\nkind = "feedback"\ngain = [[1.0]]', "expected a 1 x 2"),
    "method": ('steps = 3\n[controller]\nkind = "feedback"\ngain = [[1.0, 1.0]]\nmethod = "lass"',
               'unknown method "lass"'),
    "wave": ('steps = 3\n[controller]\nkind = "wave"', "does not agree with the waves"),
    "wave input": ('steps = 3\n[controller]\nkind = "wave"\nwave = [{ input = "f", value = 1 }]',
                   'no input "f"; the model has force_N'),
    "sensor": ("steps = 3\n" + BIAS.replace('"a"', '"z"'), 'no sensor "z"; the model has a, b, c'),
    "sensor twice": ("steps = 3\n" + BIAS.replace('sensor = "a"', 'sensors = ["a", "a"]'),
                     'sensor "a" is named twice'),
    "no sensor": ("steps = 3\n" + BIAS.replace('sensor = "a"\n', ""), "either sensor or sensors"),
    "kind": ("steps = 3\n" + BIAS.replace("bias", "bais"), 'unknown kind "bais"; known are bias'),
    "no value": ("steps = 3\n" + BIAS.replace("value = 1.0", ""), "value: missing"),
    "value": ("steps = 3\n" + BIAS.replace("1.0", "[1.0, 2.0]"), "one number, or one per sensor"),
    "window": ("steps = 3\n" + BIAS + "from = 2\nto = 2", "to: the attack ends before it begins"),
    "both windows": ("steps = 3\n" + BIAS + "from = 2\nt0_s = 2.0", "not both"),
    "period": ("steps = 3\n" + BIAS.replace("bias", "sine"), "period_s: must be given"),
    "period of a bias": ("steps = 3\n" + BIAS + "period_s = 1.0",
                         "period_s: has a meaning for kind sine, pulse only"),
    "width of a bias": ("steps = 3\n" + BIAS + "width_s = 1.0",
                        "width_s: has a meaning for kind pulse only"),
    "phase of a bias": ("steps = 3\n" + BIAS + "phase_rad = 1.0",
                        "phase_rad: has a meaning for kind sine only"),
    "state of a bias": ("steps = 3\n" + BIAS + "state = [1.0, 1.0]",
                        "state: has a meaning for kind ghost only"),
    "probability of a bias": ("steps = 3\n" + BIAS + "probability = 0.5",
                              "probability: has a meaning for kind drop only"),
    "probability": ('steps = 3\n[[attack]]\nsensor = "a"\nkind = "drop"\nprobability = 1.5',
                    "probability: must be from 0 to 1"),
    "period of a constant": (WAVE + "period_s = 1.0", "period_s: has a meaning for shape sine"),
    "phase of a pulse": (WAVE + 'shape = "pulse"\nperiod_s = 1.0\nwidth_s = 0.5\nphase_rad = 1.0',
                         "phase_rad: has a meaning for shape sine only"),
    "width of a sine": (WAVE + 'shape = "sine"\nperiod_s = 1.0\nwidth_s = 0.5',
                        "width_s: has a meaning for shape pulse only"),
    "no width": (WAVE + 'shape = "pulse"\nperiod_s = 1.0', "width_s: must be given and positive"),
    "ghost": ('steps = 3\n[[attack]]\nsensor = "a"\nkind = "ghost"\nstate = [1.0]',
              "state: expected 2 numbers"),
}


@pytest.mark.parametrize("name", SCENARIOS)
def test_run_given_bad_scenario_says_where(case, tmp_path, name):
    text, message = SCENARIOS[name]
    assert message in case("run", write_scenario(tmp_path, text))


def test_run_given_design_of_another_model_refuses(case, tmp_path):
    other = write_design(tmp_path, "liu5")
    message = case("run", write_scenario(tmp_path, "steps = 3"), design=other)
    assert 'model: is "cart", but' in message


def edited(content: dict, name: str) -> dict:
    tables = content["methods"]["kalman"]["tables"]
    if name == "format":
        content["format"] = "something else"
    elif name == "no model":
        del content["model"]
    elif name == "matrix":
        content["model"]["A"] = [[1.0, 0.0], [1.0]]
    elif name == "names":
        content["model"]["sensors"] = ["a", "b"]
    elif name == "no kalman":
        del content["methods"]["kalman"]
    elif name == "short table":
        tables["K"] = tables["K"][1:]
    elif name == "text in table":
        tables["K"][2] = "x"
    elif name == "range":
        content["plant"]["y_min"], content["plant"]["y_max"] = [1.0] * 3, [0.0] * 3
    return content


DESIGNS = {
    "format": "not a design",
    "no model": "model: missing",
    "matrix": "model.A[1]: expected a list of 2 numbers",
    "names": "model.sensors: expected 3 names",
    "no kalman": 'has no method "kalman"',
    "short table": "methods.kalman.tables.K: expected a list of 6 numbers",
    "text in table": "methods.kalman.tables.K[2]: expected a finite number",
    "range": "plant: the library refuses the plant's tables",
}


@pytest.mark.parametrize("name", DESIGNS)
def test_run_given_bad_design_says_where(case, tmp_path, name):
    content = edited(json.loads((tmp_path / "cart.json").read_text()), name)
    design = tmp_path / "bad.json"
    design.write_text(json.dumps(content))
    message = case("run", write_scenario(tmp_path, "steps = 3"), design=design)
    assert "bad.json" in message and DESIGNS[name] in message


def test_replay_given_broken_json_names_line_and_column(case, tmp_path):
    (tmp_path / "in.csv").write_text(HEADER + ROWS)
    design = tmp_path / "bad.json"
    design.write_text('{\n  "format": }')
    assert "bad.json:2:13: not valid JSON" in case("replay", tmp_path / "in.csv", design=design)


@pytest.mark.parametrize(("arguments", "message"), [
    (("--method", "lass"), 'unknown method "lass"; known are kalman'),
    (("--method", "lasso"), 'has no method "lasso", only kalman'),
    (("--format", "xml"), "--format"),
    (("--attack-id", "P1"), "--attack"),
    (("--attack", "none.toml"), "none.toml: cannot be read"),
    (("--map", "none.toml"), "none.toml: cannot be read"),
    (("--seed", "-1"), "--seed"),
    (("--verbose",), "--verbose"),
])
def test_replay_given_wrong_usage_refuses(case, tmp_path, arguments, message):
    (tmp_path / "in.csv").write_text(HEADER + ROWS)
    assert message in case("replay", tmp_path / "in.csv", *arguments)


def test_replay_given_no_log_refuses(case, tmp_path):
    assert "none.csv: cannot be read" in case("replay", tmp_path / "none.csv")
    assert "is a directory" in case("replay", tmp_path)


def test_replay_given_unwritable_folder_leaves_nothing(blw_sim, refused, tmp_path):
    design = write_design(tmp_path, "cart")
    (tmp_path / "in.csv").write_text(HEADER + ROWS)
    (tmp_path / "file").write_text("")
    message = refused(blw_sim("replay", tmp_path / "in.csv", "--design", design,
                              "--out", tmp_path / "file" / "out"))
    assert "cannot be made" in message
