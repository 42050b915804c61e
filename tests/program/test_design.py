# SPDX-License-Identifier: MIT
"""`bulwark design` as a program: files, exit statuses, messages."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
MODELS = ROOT / "host_sim" / "models"

# n = 5, m = 7, two complex pairs, correlated R, two inputs.
UNKNOWN = """
name = "rig"
dt_s = 0.05
[plant]
inputs = ["left_N", "right_N"]
A = [[0.9, 0.3, 0.0, 0.0, 0.0],
     [-0.3, 0.9, 0.0, 0.0, 0.1],
     [0.0, 0.0, 0.8, -0.5, 0.0],
     [0.1, 0.0, 0.5, 0.8, 0.0],
     [0.0, 0.0, 0.0, 0.0, 1.0]]
Bu = [[0.0, 0.1], [0.1, 0.0], [0.2, 0.0], [0.0, 0.3], [0.1, 0.1]]
C = [[1.0, 0.0, 0.0, 0.0, 1.0],
     [0.0, 1.0, 1.0, 0.0, 1.0],
     [1.0, 0.0, 0.0, 1.0, -1.0],
     [1.0, 1.0, 1.0, 0.0, 0.5],
     [0.0, 1.0, 0.0, 1.0, 1.0],
     [1.0, -1.0, 1.0, 1.0, 2.0],
     [0.5, 0.0, 1.0, 0.0, 1.0]]
Q = [0.01, 0.02, 0.01, 0.03, 0.01]
R = [[0.10, 0.05, 0.00, 0.00, 0.00, 0.00, 0.00],
     [0.05, 0.20, 0.00, 0.00, 0.00, 0.00, 0.00],
     [0.00, 0.00, 0.10, 0.00, 0.00, 0.00, 0.00],
     [0.00, 0.00, 0.00, 0.30, -0.1, 0.00, 0.00],
     [0.00, 0.00, 0.00, -0.1, 0.20, 0.00, 0.00],
     [0.00, 0.00, 0.00, 0.00, 0.00, 0.10, 0.00],
     [0.00, 0.00, 0.00, 0.00, 0.00, 0.00, 0.40]]
range = [[-100.0, 100.0], [-inf, 50.0], [-inf, inf], [-9.0, 9.0], [-9.0, 9.0], [-9.0, 9.0],
         [-9.0, 9.0]]
[attack]
p = 2
"""

UNDETECTABLE = """
name = "drift"
dt_s = 1.0
[plant]
A = [[1.0, 0.0], [0.0, 0.5]]
C = [[0.0, 1.0], [0.0, 2.0]]
Q = [1.0, 1.0]
R = [1.0, 1.0]
"""


def chain(n: int) -> str:
    """A model whose local states are too close to dependent for `lasso`."""
    A = (0.95 * np.eye(n) + 0.1 * np.eye(n, k=1)).tolist()
    C = [[1.0] + [0.0] * (n - 1)] * 3
    return (f'name = "chain"\ndt_s = 0.1\n[plant]\nA = {A}\nC = {C}\nQ = {[1e-3] * n}\n'
            f"R = {[1e-3] * 3}\n")


def design(*arguments: object, cwd: Path) -> subprocess.CompletedProcess:
    environment = os.environ | {"PYTHONPATH": str(ROOT / "tools")}
    return subprocess.run([sys.executable, "-m", "blw", "design", *map(str, arguments)],
                          capture_output=True, text=True, cwd=cwd, env=environment, timeout=300)


def refusal(done: subprocess.CompletedProcess, folder: Path) -> str:
    assert done.returncode == 2
    assert not done.stdout
    assert done.stderr.startswith("bulwark: ") and done.stderr.count("\n") == 1
    assert not (folder / "out").exists()
    return done.stderr


def write(folder: Path, text: str) -> Path:
    file = folder / "model.toml"
    file.write_text(text)
    return file


def test_design_given_model_writes_the_four_files(tmp_path):
    done = design(MODELS / "pendulum.toml", "--out", "out", "--method", "kalman", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == [
        "pendulum.dbc", "pendulum.json", "pendulum_model.c", "pendulum_model.h"]
    document = json.loads((tmp_path / "out" / "pendulum.json").read_text())
    assert document["format"] == "bulwark-design-1"
    assert document["model"]["sensors"] == ["cart1", "cart2", "cart3", "angle"]
    assert document["model"]["range"] == [None] * 4
    assert len(document["methods"]["kalman"]["tables"]["K"]) == 16
    assert document["methods"]["kalman"]["info"]["trace_P"] == pytest.approx(0.0511, abs=5e-5)
    assert document["plant"]["y_max"][0] == pytest.approx(
        1e9 * document["methods"]["kalman"]["info"]["innovation_sigma"][0])


def test_design_given_same_model_twice_writes_the_same_bytes(tmp_path):
    for _ in range(2):
        assert design(MODELS / "liu5.toml", "--out", "out", cwd=tmp_path).returncode == 0
        files = {path.name: path.read_bytes() for path in (tmp_path / "out").iterdir()}
    assert design(MODELS / "liu5.toml", "--out", "again", cwd=tmp_path).returncode == 0
    assert files == {path.name: path.read_bytes() for path in (tmp_path / "again").iterdir()}


def test_design_given_small_leaves_out_code_and_nothing_else(tmp_path):
    for out, options in (("fast", []), ("small", ["--small"])):
        assert design(MODELS / "liu5.toml", "--out", out, "--method", "lasso", *options,
                      cwd=tmp_path).returncode == 0
    fast, small = ((tmp_path / out / "liu5_model.c").read_text() for out in ("fast", "small"))
    assert "static void" in fast and "static bool" in fast
    assert "static void" not in small and "static bool" not in small
    assert re.search(r"\.fast += NULL", small) and re.search(r"\.step += NULL", small)
    tables = [re.findall(r"\[\d+\] = \{|crc +=.*", text) for text in (fast, small)]
    assert tables[0] == tables[1]
    for name in ("liu5.json", "liu5_model.h", "liu5.dbc"):
        assert (tmp_path / "fast" / name).read_bytes() == (tmp_path / "small" / name).read_bytes()


def test_design_given_json_prints_the_figures(tmp_path):
    done = design(MODELS / "liu5.toml", "--out", "out", "--method", "kalman", "--json",
                  cwd=tmp_path)
    figures = json.loads(done.stdout)
    assert figures["name"] == "liu5"
    assert figures["methods"]["kalman"]["trace_P"] == pytest.approx(0.8317, abs=5e-5)
    assert len(figures["files"]) == 4
    assert figures["warnings"] == []


def test_design_given_unknown_model_serves_it(tmp_path):
    file = write(tmp_path, UNKNOWN)
    done = design(file, "--out", "out", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    document = json.loads((tmp_path / "out" / "rig.json").read_text())
    assert {"kalman", "lasso"} <= set(document["methods"])
    low, high = document["plant"]["y_min"], document["plant"]["y_max"]
    assert (low[0], high[0], high[1]) == (-100.0, 100.0, 50.0)
    half_open = document["model"]["range"][1]
    assert half_open[1] == 50.0 and half_open[0] < -1e8
    assert document["model"]["range"][2] is None


@pytest.mark.parametrize("text, message", [
    (UNDETECTABLE, "no sensor sees the mode 1 (|z| = 1): it is not detectable"),
    (UNDETECTABLE.replace("R = [1.0, 1.0]", "R = [1.0, 0.0]"),
     "plant.R has the variance 0 in row 2 (y2)"),
    (UNDETECTABLE.replace("Q =", "q ="), "plant: unknown key 'q'; did you mean 'Q'?"),
    (UNDETECTABLE + "[method.lasso]\ngama = 1\n",
     "method.lasso: unknown key 'gama'; did you mean 'gamma'?"),
    (UNKNOWN.replace("[0.1, 0.1]]", "[0.1, 1e39]]"),
     "table plant.Bu[9] = 1e+39 does not fit float32"),
])
def test_design_given_impossible_model_refuses_and_writes_nothing(tmp_path, text, message):
    file = write(tmp_path, text)
    assert message in refusal(design(file, "--out", "out", cwd=tmp_path), tmp_path)


def test_design_given_method_that_refuses_says_why(tmp_path):
    file = write(tmp_path, chain(10))
    message = refusal(design(file, "--out", "out", "--method", "lasso", cwd=tmp_path), tmp_path)
    assert "chain" not in message or "lasso" in message
    done = design(file, "--out", "out", cwd=tmp_path)
    assert done.returncode == 0
    assert "lasso      refused: " in done.stdout
    document = json.loads((tmp_path / "out" / "chain.json").read_text())
    assert "lasso" in document["refused"] and "kalman" in document["methods"]


@pytest.mark.parametrize("attack, warned", [
    ("p = 1", False), ("p = 2", True), ("p = 0", False), ('p = 2\nstrong = ["y2"]', False)])
def test_design_given_more_attacked_than_the_sensors_bear_warns(tmp_path, attack, warned):
    file = write(tmp_path, chain(2) + f"[attack]\n{attack}\n")
    done = design(file, "--out", "out", "--method", "kalman", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert ("warning: p = 2, but the state follows from the sensors with at most 1 of them "
            "attacked: too few see the mode 0.95; see bulwark analyze\n" in done.stdout) == warned


@pytest.mark.parametrize("A, Q", [
    ([[0.9, 0.5, 0.0], [0.0, 0.0, 0.5], [0.0, 0.0, 0.0]], [1e-3, 0.1, 0.0]),
    ([[0.9, 0.0, 0.0], [0.0, 0.5, 0.0], [0.0, 0.0, 0.1]], [0.0, 0.0, 0.0])])
def test_design_given_states_that_are_known_exactly_serves_them(tmp_path, A, Q):
    C = [[0.6, -0.2, 2.2], [-0.2, 0.1, 0.2], [-0.5, 2.2, 0.1]]
    file = write(tmp_path, f'name = "still"\ndt_s = 0.1\n[plant]\nA = {A}\nC = {C}\nQ = {Q}\n'
                           "R = [0.1, 0.2, 0.1]\n")
    done = design(file, "--out", "out", "--json", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    figures = json.loads(done.stdout)["methods"]
    assert figures["kalman"]["cond_P"] is None
    assert {"kalman", "bank", "guard"} <= set(figures)


def test_design_given_unknown_method_suggests_one(tmp_path):
    done = design(MODELS / "liu5.toml", "--out", "out", "--method", "kalmann", cwd=tmp_path)
    assert "unknown method 'kalmann'; did you mean 'kalman'?" in refusal(done, tmp_path)


def test_design_given_output_that_is_a_file_refuses(tmp_path):
    (tmp_path / "taken").write_text("")
    done = design(MODELS / "liu5.toml", "--out", "taken", cwd=tmp_path)
    assert done.returncode == 2
    assert "taken" in done.stderr and done.stderr.count("\n") == 1
