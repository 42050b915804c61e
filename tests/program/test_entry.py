# SPDX-License-Identifier: MIT
"""tools/bulwark: dispatch, exit statuses, messages, and what its set-up would install."""

import json
import os
import re
from pathlib import Path

import pytest
from conftest import call

from blw.cli import COMMANDS
from blw.demo import SCENARIO

STUBS = {
    # A missing package makes dpkg-query say nothing about it.
    "dpkg-query": "echo installed python3",
    "apt-get": 'echo "apt-get $*" >>"$CALLS"',
    "sudo": 'echo "sudo $*" >>"$CALLS"; exec "$@"',
    "id": "echo 1000",
}
ALL_INSTALLED = "echo installed python3; echo installed python3-venv"


@pytest.fixture
def set_up(tmp_path: Path, root: Path):
    """Run ensure_packages with stubs for the programs that would change the machine."""
    stubs = tmp_path / "bin"
    stubs.mkdir()

    def run(*groups: str, **scripts: str):
        for name, script in (STUBS | scripts).items():
            (stubs / name).write_text(f"#!/bin/sh\n{script}\n")
            (stubs / name).chmod(0o755)
        calls = tmp_path / "calls"
        calls.write_text("")
        script = f". {root}/tools/setup/setup.sh; ensure_packages {' '.join(groups)}"
        done = call(["sh", "-euc", script],
                    env={"PATH": f"{stubs}:/usr/bin:/bin", "CALLS": str(calls),
                         "root": str(root), "build": str(tmp_path)})
        return done, calls.read_text().splitlines()
    return run


def test_set_up_given_nothing_missing_is_silent(set_up):
    done, calls = set_up("python", **{"dpkg-query": ALL_INSTALLED})
    assert (done.returncode, done.stderr, calls) == (0, "", [])


def test_set_up_given_missing_package_installs_just_that(set_up):
    done, calls = set_up("python")
    assert done.returncode == 0, done.stderr
    assert done.stderr == "bulwark: installing Debian packages: python3-venv \n"
    assert calls[0] == "sudo apt-get -qq update"
    assert re.search(r"apt-get -qq -y .* install --no-install-recommends python3-venv$", calls[-1])


def test_set_up_given_root_needs_no_sudo(set_up):
    done, calls = set_up("python", id="echo 0", sudo="exit 1")
    assert done.returncode == 0, done.stderr
    assert all(line.startswith("apt-get ") for line in calls)


def test_set_up_given_failing_apt_says_so(set_up):
    done, _ = set_up("python", **{"apt-get": "exit 100"})
    assert done.returncode == 1
    assert done.stderr.endswith("bulwark: apt-get update failed\n")


def test_entry_knows_the_same_commands_as_the_command_line(root):
    text = (root / "tools" / "bulwark").read_text()
    assert re.search(r"^commands='(.*)'$", text, re.MULTILINE)[1].split() == sorted(COMMANDS)


def test_entry_given_help_lists_every_command(entry):
    done = entry("--help")
    assert (done.returncode, done.stderr) == (0, "")
    assert all(re.search(rf"^  {name} ", done.stdout, re.MULTILINE) for name in COMMANDS)


@pytest.mark.parametrize("command", sorted(COMMANDS))
def test_entry_given_command_and_help_explains_it(entry, command):
    done = entry(command, "--help")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith(f"Usage: bulwark {command} ")


@pytest.mark.parametrize("arguments, message", [
    (("desing",), "unknown command 'desing'; there are: amalgamate analyze"),
    (("--verbose",), "unknown option '--verbose'; see tools/bulwark --help"),
    (("design",), "Missing argument 'MODEL'"),
    (("design", "no.toml", "--out", "out"), "no.toml: "),
    (("run", "no.toml", "--out", "out"), "'SCENARIO': File 'no.toml' does not exist"),
    (("run", SCENARIO), "Missing option '--out'"),
    (("run", SCENARIO, "--out", "out", "--runs", "0"), "'--runs': 0"),
    (("run", SCENARIO, "--out", "out", "--precision", "f16"), "'--precision': 'f16'"),
    (("run", SCENARIO, "--out", "out", "--method", "laso"), "did you mean 'lasso'?"),
    (("replay", SCENARIO, "--out", "out"), "Missing option '--design'"),
    (("replay", "no.csv", "--design", SCENARIO, "--out", "out"), "File 'no.csv' does not exist"),
    (("replay", SCENARIO, "--design", "no.json", "--out", "out"), "'no.json' does not exist"),
    (("report", "no"), "no"),
    (("test", "unti"), "no test has the label 'unti'"),
])
def test_entry_given_wrong_usage_refuses_with_one_line(
        entry, refused, tmp_path, arguments, message):
    assert message in refused(entry(*arguments, cwd=tmp_path))
    assert list(tmp_path.iterdir()) == []


def test_entry_given_no_argument_shows_help_and_fails(entry):
    done = entry()
    assert done.returncode == 2
    assert "Commands:" in done.stdout + done.stderr


def test_doctor_given_json_names_methods_versions_and_what_is_missing(entry):
    done = entry("doctor", "--json")
    assert (done.returncode, done.stderr) == (0, "")
    told = json.loads(done.stdout)
    assert {"kalman", "lasso"} <= set(told["methods"])
    assert {"bulwark", "python", "numpy", "scipy"} <= set(told["versions"])
    assert isinstance(told["missing"], list)


@pytest.mark.skipif("OPENBLAS_CORETYPE" not in os.environ, reason="no processor with AVX2")
def test_entry_given_other_blas_kernels_designs_the_same_bits(entry, root, tmp_path):
    for kernels, threads in (("Haswell", "1"), ("Nehalem", "2")):
        done = entry("design", root / "host_sim/models/random10.toml", "--method", "kalman",
                     "--out", tmp_path / kernels, env=os.environ | {
                         "OPENBLAS_CORETYPE": kernels, "OPENBLAS_NUM_THREADS": threads})
        assert done.returncode == 0, done.stderr
    for written in (tmp_path / "Haswell").iterdir():
        assert written.read_bytes() == (tmp_path / "Nehalem" / written.name).read_bytes()


def test_ci_runs_the_test_command_and_nothing_else(root):
    lines = (root / ".ci" / "run").read_text().splitlines()
    code = [line for line in lines if line and not line.startswith("#")]
    assert code == ['exec "$(dirname -- "$0")/../tools/bulwark" test']


def test_demo_writes_a_report_that_needs_no_other_file(bulwark, tmp_path):
    done = bulwark("demo", "--out", tmp_path / "demo", "--json")
    assert done.returncode == 0, done.stderr
    figures = json.loads(done.stdout)
    assert {"kalman", "lasso", "oracle"} <= set(figures["methods"])
    page = tmp_path / "demo" / "report.html"
    assert done.stderr == f"report: {page}\n"
    assert not re.search(r'(src|href)="(?!data:|#)', page.read_text(encoding="utf-8"))


@pytest.fixture(scope="session")
def simulated(bulwark, root, tmp_path_factory):
    """A short run of two methods in double precision: its folder."""
    folder = tmp_path_factory.mktemp("entry")
    (folder / "short.toml").write_text(f'model = "{root}/host_sim/models/liu5.toml"\nsteps = 20\n'
                                       '[controller]\nkind = "feedback"\nmethod = "truth"\n'
                                       "gain = [[0.0, 0.0, -1.8]]\n")
    done = bulwark("run", "short.toml", "--out", "out", "--method", "lasso", "--seed", "7",
                   "--precision", "f64", "--json", cwd=folder)
    assert (done.returncode, done.stderr) == (0, "")
    assert json.loads(done.stdout)["seed"] == 7
    return folder / "out"


def test_run_given_precision_and_methods_writes_results_and_design(simulated):
    written = {str(path.relative_to(simulated)) for path in simulated.rglob("*") if path.is_file()}
    assert written == {"log.csv", "kalman.csv", "lasso.csv", "oracle.csv", "summary.json",
                       "design/liu5.json"}
    assert json.loads((simulated / "summary.json").read_text())["precision"] == "f64"


def test_replay_of_a_run_repeats_its_estimates(bulwark, simulated, tmp_path):
    done = bulwark("replay", simulated / "log.csv", "--design", simulated / "design/liu5.json",
                   "--out", tmp_path, "--precision", "f64")
    assert (done.returncode, done.stderr) == (0, "")
    for name in ("kalman.csv", "lasso.csv"):
        assert (tmp_path / name).read_bytes() == (simulated / name).read_bytes()


def test_run_given_model_that_is_no_file_writes_nothing(bulwark, refused, tmp_path):
    (tmp_path / "bad.toml").write_text('model = "no.toml"\nsteps = 20\n')
    assert "no.toml" in refused(bulwark("run", "bad.toml", "--out", "out", cwd=tmp_path))
    assert not (tmp_path / "out").exists()


def test_run_given_scenario_that_only_the_simulator_can_refuse_writes_nothing(
        bulwark, refused, root, tmp_path):
    (tmp_path / "bad.toml").write_text(f'model = "{root}/host_sim/models/liu5.toml"\nstep = 20\n')
    message = refused(bulwark("run", "bad.toml", "--out", "out", "--method", "kalman",
                              cwd=tmp_path))
    assert "bad.toml" in message and "step" in message
    assert not (tmp_path / "out").exists()
