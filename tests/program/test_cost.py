# SPDX-License-Identifier: MIT
"""`bulwark bench` and `bulwark size`: what they print, and that it is what was executed."""

import difflib
import json
import os
import shutil
import tomllib
from functools import cache

import numpy as np
import pytest
from click.testing import CliRunner

from blw.analysis import instructions, l1_instructions, l1_work
from blw.analysis.footprint import footprint
from blw.cost import cases, command, sizes
from blw.cost.programs import Program, build
from blw.cost.targets import TARGETS

#: Largest error of the flash that `analyze` states for the tables.
FLASH_ERROR = 0.02
KEYS = {"method", "model", "target", "instructions_typical", "instructions_mean_attacked",
        "instructions_worst", "cycles_typical", "flash_bytes", "ram_bytes", "stack_bytes"}

pytestmark = pytest.mark.skipif(
    not (shutil.which("arm-none-eabi-gcc") and shutil.which("qemu-system-arm")),
    reason="no arm-none-eabi-gcc or no qemu-system-arm")


@cache
def designed(name):
    """The design of a case, with every method that accepts the model."""
    return cases.designed(cases.CASES[name])


@pytest.fixture(scope="module")
def kalman_bench(bulwark):
    done = bulwark("bench", "--target", "m4f", "--model", "liu5", "--method", "kalman", "--json")
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_bench_given_one_estimator_yields_one_complete_row(kalman_bench):
    (row,) = json.loads(kalman_bench)["rows"]
    assert row.keys() == KEYS
    assert (row["target"], row["model"], row["method"]) == ("m4f", "liu5", "kalman")
    assert 100 < row["instructions_typical"] <= row["instructions_worst"]
    assert row["instructions_typical"] < row["cycles_typical"] < 2 * row["instructions_typical"]
    assert row["instructions_typical"] <= row["instructions_mean_attacked"]
    assert row["ram_bytes"] > 4 * (3 + 3 + 5)  # x_hat, x_bar, suspicion, and pointers to them
    assert 0 < row["stack_bytes"] <= 512


def test_bench_given_the_same_twice_yields_the_same_bytes(bulwark, kalman_bench):
    again = bulwark("bench", "--target", "m4f", "--model", "liu5", "--method", "kalman", "--json")
    assert again.stdout == kalman_bench


def test_size_given_a_model_agrees_with_bench(bulwark, kalman_bench):
    done = bulwark("size", "--target", "m4f", "--model", "liu5", "--method", "kalman", "--json")
    (row,) = json.loads(done.stdout)["rows"]
    (measured,) = json.loads(kalman_bench)["rows"]
    assert row == {key: measured[key] for key in row}
    assert measured.keys() - row.keys() == {
        key for key in KEYS if key.startswith(("instructions", "cycles"))}


def test_size_given_a_method_that_refuses_lists_the_reason(bulwark):
    done = bulwark("size", "--target", "m4f", "--model", "liu5", "--method", "canonical", "--json")
    printed = json.loads(done.stdout)
    assert printed["rows"] == []
    (refusal,) = printed["refused"]
    assert (refusal["model"], refusal["method"]) == ("liu5", "canonical")
    assert "derogatory" in refusal["reason"]


@pytest.mark.skipif("OPENBLAS_CORETYPE" not in os.environ,
                    reason="designs have other last digits without AVX2: see tools/bulwark")
def test_bench_given_all_models_writes_the_document_again(root, tmp_path):
    done = CliRunner().invoke(command.bench, ["--write", str(tmp_path / "cost.md")])
    assert done.exit_code == 0, done.output
    written, kept = ((folder / "cost.md").read_text().splitlines()
                     for folder in (tmp_path, root / "docs"))
    assert list(difflib.unified_diff(kept, written, lineterm="", n=0)) == []


@pytest.mark.parametrize("name", ["liu5", "pendulum"])
def test_footprint_given_every_method_is_what_the_linker_kept(name):
    """The formulas of the design tool against the programs: tables and state, to the byte."""
    design = cases.prepare(cases.CASES[name]).design
    linked = [Program.on(TARGETS["m4f"], name, method) for method in design.methods]
    build(linked)
    for program in linked:
        computed = footprint(program.method, design.methods[program.method], design.plant)
        flash = pytest.approx(computed.flash_bytes, rel=FLASH_ERROR)  # jump tables of the kernels
        assert sizes.table_bytes(program) == flash, program.method
        assert sizes.ram_bytes(program) == computed.ram_bytes, program.method


def documented(root):
    """(model, method), typical and mean attacked instructions of every row of the Cortex-M4F in
    docs/cost.md."""
    section = (root / "docs" / "cost.md").read_text().split("## Cortex-M4F\n")[1].split("##")[0]
    lines = [line for line in section.splitlines() if line.startswith("| ")][1:]
    rows = [[cell.strip(" `") for cell in line.split("|")[1:]] for line in lines]
    return [(*row[:2], *(int(cell.replace(",", "")) for cell in row[2:4])) for row in rows]


def test_footprint_given_the_documented_steps_is_within_a_tenth_of_their_instructions(root):
    """Every row of a method that the design tool gives instructions for."""
    checked = set()
    for model, method, measured, _ in documented(root):
        if method not in instructions.FORMULAS:
            continue
        design = designed(model)
        computed = footprint(method, design.methods[method], design.plant).instructions_typical
        assert computed == pytest.approx(measured, rel=0.1), (model, method)
        checked.add(method)
    assert checked == set(instructions.FORMULAS)


def attack_of(name, model, steps):
    """[steps x m] what the scenario of the cost table adds to the samples."""
    path = cases.HOST_SIM / "scenarios" / f"{name}_cost.toml"
    (attack,) = tomllib.loads(path.read_text())["attack"]
    generator, k, value = np.random.default_rng(5), np.arange(steps), attack["value"]
    added = np.zeros((steps, model.m))
    added[:, model.sensors.index(attack["sensor"])] = {
        "bias": lambda: np.full(steps, value),
        "uniform": lambda: generator.uniform(-value, value, steps),
        "white": lambda: value * generator.standard_normal(steps),
        "sine": lambda: value * np.sin(2.0 * np.pi * k * model.dt_s / attack["period_s"]),
    }[attack["kind"]]()
    return added


def near(measured, simulated, spread):
    return measured == pytest.approx(simulated, abs=max(0.1 * measured, 2.0 * spread))


def test_simulated_work_given_the_documented_steps_is_within_a_tenth_of_their_instructions(root):
    """A figure of the document is that of one window, of 50 steps without attack or of the first
    200 of an attack, which slow local filters take to follow; where windows differ by more than
    that among themselves, it has to be within two of their standard deviations."""
    rows = [row for row in documented(root) if row[1] in l1_instructions.METHODS]
    for name, method, typical, attacked in rows:
        design = designed(name)
        attack = attack_of(name, design.model, l1_work.STEPS)
        prices = l1_instructions.prices_of(design, method)
        N = design.methods[method].tables.to_json()["l1"]["N"]
        benign, under = (l1_instructions.instructions(work, N, prices)
                         for work in l1_work.count(design, method, attack))
        windows = np.median(benign.reshape(-1, cases.BENIGN_STEPS), axis=1)
        assert near(typical, windows.mean(), windows.std()), (name, method, windows.mean())
        windows = under.reshape(-1, cases.ATTACKED_STEPS).mean(axis=1)
        assert near(attacked, windows[0], windows[1:].std()), (name, method, windows[0])
    assert len(rows) == 9


@pytest.mark.parametrize("option, value, hint", [
    ("--target", "m4", "m4f"), ("--model", "lui5", "liu5"), ("--method", "lassoo", "lasso")])
def test_bench_given_an_unknown_name_is_refused_with_a_hint(bulwark, refused, option, value, hint):
    message = refused(bulwark("bench", option, value))
    assert value in message and hint in message
