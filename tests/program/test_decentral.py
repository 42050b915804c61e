# SPDX-License-Identifier: MIT
"""`decentral` on the whole chain: design tool and simulator."""

import csv
import json

import numpy as np
import pytest

from blw.design import design_all, document, json_text
from blw.model import load


@pytest.fixture(scope="module")
def designed(root, tmp_path_factory):
    """NAME.json of a shipped model with other options of decentral, by name and options."""
    folder = tmp_path_factory.mktemp("design")

    def make(name, **options):
        model = load(root / "host_sim" / "models" / f"{name}.toml")
        model.methods["decentral"] = options
        path = folder / f"{name}_{len(list(folder.iterdir()))}.json"
        path.write_text(json_text(document(design_all(model, ["kalman", "decentral"]))))
        return path

    return make


def write_log(path, y):
    """A CSV log of y [steps, m]; its first row is the initial state."""
    with path.open("w", newline="") as file:
        log = csv.writer(file)
        log.writerow(["k", "t_s", *(f"y{i + 1}" for i in range(y.shape[1]))])
        for k, row in enumerate(y):
            log.writerow([k, repr(0.02 * k), *map(repr, row.tolist())])


def column(path, name):
    with path.open(newline="") as file:
        return [row[name] for row in csv.DictReader(file)]


@pytest.mark.parametrize("gains", ["steady", "recursive"])
def test_run_given_the_papers_servo_reproduces_its_figures(blw_sim, designed, root, tmp_path,
                                                           gains):
    scenario = root / "host_sim" / "scenarios" / "torsion_servo.toml"
    done = blw_sim("run", scenario, "--design", designed("torsion", gains=gains), "--out", tmp_path,
                   "--method", "decentral")
    assert done.returncode == 0, done.stderr
    methods = json.loads((tmp_path / "summary.json").read_text())["methods"]
    ours, undefended = methods["decentral"], methods["kalman"]
    assert ours["detection_delay_steps"] <= 2
    assert ours["missed_exclusions"]["rate"] <= 0.01 and ours["wrong_exclusions"]["rate"] <= 0.001
    assert ours["rmse_state"]["during"][4] == pytest.approx(1.0e-3, rel=0.1)  # theta3
    assert undefended["rmse_state"]["during"][4] == pytest.approx(6.7e-2, rel=0.1)
    assert ours["ratio_to_oracle"]["during"] < 1.5


def test_replay_given_the_golden_log_agrees_with_it(blw_sim, designed, shared, tmp_path):
    path = shared / "golden" / "chi2_drone5.json"
    if not path.is_file():
        pytest.skip(f"no {path}")
    data = json.loads(path.read_text())
    log = tmp_path / "log.csv"
    write_log(log, np.array(data["y"]))
    done = blw_sim("replay", log, "--design", designed("drone5", false_alarm=data["delta"]),
                   "--out", tmp_path / "out", "--method", "decentral")
    assert done.returncode == 0, done.stderr
    written = tmp_path / "out" / "decentral.csv"
    x = np.array([column(written, f"x{i + 1}") for i in range(4)], dtype=float).T
    expected = np.array(data["xhat"])[-len(x):]
    np.testing.assert_allclose(x, expected, rtol=1e-3, atol=1e-4)
    names = [";".join(f"y{i + 1}" for i in range(5) if i not in data["sets"][j or 0])
             for j in data["J_index"]]
    assert column(written, "excluded") == names[-len(x):]


@pytest.mark.parametrize("options, message", [
    ({"false_alarm": 0.0}, "false_alarm must be greater than 0"),
    ({"gains": "steddy"}, "gains must be 'steady' or 'recursive'"),
    ({"readmitt": 3}, "unknown key 'readmitt'; did you mean 'readmit'?"),
    ({"max_flash_bytes": 100}, "more than the limit 100"),
    ({"gains": "recursive", "reseed": True}, "reseed needs gains = \"steady\""),
])
def test_design_given_wrong_options_refuses(bulwark, refused, root, tmp_path, options, message):
    model = (root / "host_sim" / "models" / "drone5.toml").read_text()
    lines = [f"{key} = {json.dumps(value)}" for key, value in options.items()]
    file = tmp_path / "drone5.toml"
    file.write_text(model + "\n[method.decentral]\n" + "\n".join(lines) + "\n")
    done = bulwark("design", file, "--out", tmp_path / "out", "--method", "decentral")
    assert message in refused(done)
    assert not (tmp_path / "out").exists() or not list((tmp_path / "out").iterdir())
