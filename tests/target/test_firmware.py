# SPDX-License-Identifier: MIT
"""Firmware in the loop: what the example node says, against the library on the host."""

import json
import os
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest
import tomli_w
from emulated import available

from blw import pil, pil_drive
from blw.build import BUILD, ROOT, build_programs, simulator
from blw.design import design_all, document, json_text
from blw.model import load

#: A step is six frames to the firmware and four back: 1,000 frames, extended 20,000.
STEPS = 2_000 if os.environ.get("BULWARK_EXTENDED") else 100
METHOD = "canonical"


@pytest.fixture(scope="module")
def design():
    available(pil.TARGET.name)
    return design_all(load(ROOT / "host_sim" / "models" / "pendulum.toml"), ["kalman", METHOD])


def simulate(design, steps, out, **attack):
    """An attacked run of so many steps, in one process."""
    attack = attack or {"kind": "uniform", "value": 1.5}
    scenario = out / "scenario.toml"
    scenario.write_text(tomli_w.dumps({
        "model": str(ROOT / "host_sim" / "models" / "pendulum.toml"), "steps": steps,
        "controller": {"kind": "feedback", "method": "truth",
                       "gain": [[-0.604, -1.678, -39.514, -9.721]]},
        "attack": [{"sensor": "angle", "from": steps // 5, **attack}]}))
    tables = out / "design.json"
    tables.write_text(json_text(document(design)))
    subprocess.run([simulator("f32"), "run", scenario, "--design", tables, "--out", out,
                    "--method", METHOD], check=True, capture_output=True)


def test_node_given_attacked_frames_answers_all_with_the_bits_of_the_host(design, tmp_path):
    simulate(design, STEPS, tmp_path)
    outcome = pil.check(design, METHOD, tmp_path)
    assert (outcome.lost, outcome.different) == (0, 0)
    assert (outcome.steps, outcome.sent, outcome.received) == (STEPS, 6 * STEPS, 4 * STEPS)
    assert outcome.sent + outcome.received == 10 * STEPS
    assert json.loads((tmp_path / "pil.json").read_text())["steps"] == STEPS


def test_node_given_missing_samples_answers_all_with_the_bits_of_the_host(design, tmp_path):
    simulate(design, 60, tmp_path, kind="drop", probability=0.7, to=59)
    outcome = pil.check(design, METHOD, tmp_path)
    assert (outcome.steps, outcome.lost, outcome.different) == (60, 0, 0)


def test_run_given_the_transport_pil_runs_the_scenario_and_the_firmware(tmp_path):
    available(pil.TARGET.name)
    scenario = ROOT / "host_sim" / "scenarios" / "pendulum_cost.toml"
    done = subprocess.run(
        [sys.executable, "-m", "blw", "run", scenario, "--out", tmp_path, "--transport", "pil",
         "--method", METHOD], env=os.environ | {"PYTHONPATH": str(ROOT / "tools")},
        capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "300 steps, 1800 frames there and 1200 back, 0 answers lost, 0 differ" in done.stderr
    assert (tmp_path / f"{METHOD}.csv").is_file()


def test_check_given_other_outputs_than_the_firmware_s_finds_them(design, tmp_path):
    simulate(design, 20, tmp_path)
    wrong = tmp_path / f"{METHOD}.csv"
    lines = wrong.read_text().splitlines(keepends=True)
    cells = lines[7].split(",")
    cells[3] = str(float(cells[3]) * (1 + 2e-7) + 1e-30)
    wrong.write_text("".join([*lines[:7], ",".join(cells), *lines[8:]]))
    outcome = pil.check(design, METHOD, tmp_path)
    assert (outcome.lost, outcome.different, outcome.ok) == (0, 1, False)


def test_node_given_socketcan_in_between_answers_all_with_the_bits_of_the_host(design, tmp_path):
    simulate(design, STEPS, tmp_path)

    def driver(line: Path, steps):
        sent, heard = tmp_path / "sent", tmp_path / "heard"
        sent.write_text("".join(pil_drive.text(frames) + "\n" for frames in steps))
        with socket.socket(socket.AF_UNIX) as uart:
            connect(uart, line)
            handle = uart.fileno()
            done = subprocess.run(
                [ROOT / "tests" / "bus" / "in_uml.sh", "-k", f"ssl0=fd:{handle},fd:{handle}", "--",
                 ROOT / "tests" / "target" / "slcan_drive.sh", sys.executable, sent, heard],
                env=os.environ | {"PYTHONPATH": str(ROOT / "tools")}, pass_fds=[handle],
                capture_output=True, text=True)
        if done.returncode == 77:
            pytest.skip(done.stderr.strip())
        assert done.returncode == 0, done.stdout + done.stderr
        return [pil_drive.parse(text) for text in heard.read_text().splitlines()]

    outcome = pil.check(design, METHOD, tmp_path, driver)
    assert (outcome.lost, outcome.different) == (0, 0)
    assert (outcome.steps, outcome.sent, outcome.received) == (STEPS, 6 * STEPS, 4 * STEPS)


def connect(uart, line):
    """To QEMU's serial line, which is there as soon as QEMU is."""
    for _ in range(500):
        try:
            uart.connect(str(line))
            return
        except OSError:
            time.sleep(0.02)
    uart.connect(str(line))


@pytest.mark.parametrize("name", ["m0p", "m4f", "m7", "rv32imac", "rv32imafc", "rv64gc"])
def test_bare_loop_given_a_lying_sensor_keeps_its_estimate(name):
    target = available(name)
    build_programs(name, ["firmware_bare"])
    program = BUILD / name / "port" / "firmware" / "firmware_bare"
    done = subprocess.run([ROOT / "port" / "qemu.sh", target.qemu, target.machine, program])
    assert done.returncode == 0
