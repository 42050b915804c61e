# SPDX-License-Identifier: MIT
"""`bulwark bench` and `bulwark size`: what they print, and that it is what was executed."""

import json
import os
import shutil

import pytest
from click.testing import CliRunner

from blw.analysis import instructions
from blw.analysis.footprint import footprint
from blw.cost import cases, command, document, sizes
from blw.cost.programs import Program, build
from blw.cost.targets import DEFAULT, TARGETS

#: Largest error of the flash that `analyze` states for the tables.
FLASH_ERROR = 0.02
KEYS = {"method", "model", "target", "instructions_typical", "instructions_mean_attacked",
        "instructions_worst", "cycles_typical", "flash_bytes", "ram_bytes", "stack_bytes"}

pytestmark = pytest.mark.skipif(
    not (shutil.which("arm-none-eabi-gcc") and shutil.which("qemu-system-arm")),
    reason="no arm-none-eabi-gcc or no qemu-system-arm")


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


def section(root, title):
    """The lines of a table in docs/cost.md, without its head."""
    printed = (root / "docs" / "cost.md").read_text().split(f"## {title}\n")[1].split("##")[0]
    return [line for line in printed.splitlines() if line.startswith("| ")][1:]


@pytest.mark.parametrize("title, options", [
    *((TARGETS[name].title, ["--target", name]) for name in DEFAULT),
    ("Built for size", ["--target", "m4f", "--small"])])
def test_bench_given_the_first_model_agrees_with_the_document(bulwark, root, title, options):
    done = bulwark("bench", "--model", "liu5", "--json", *options)
    assert done.returncode == 0, done.stderr
    shown = [line for line in section(root, title) if line.startswith("| liu5")]
    assert shown == document.table(json.loads(done.stdout)["rows"])[2:-1]


@pytest.mark.skipif(os.environ.get("BULWARK_EXTENDED") != "1", reason="BULWARK_EXTENDED is not 1")
def test_bench_given_all_models_writes_the_document_again(root, tmp_path):
    done = CliRunner().invoke(command.bench, ["--write", str(tmp_path / "cost.md")])
    assert done.exit_code == 0, done.output
    assert (tmp_path / "cost.md").read_text() == (root / "docs" / "cost.md").read_text()


@pytest.mark.parametrize("name", ["liu5", "pendulum"])
def test_footprint_given_every_method_is_what_the_linker_kept(name):
    """The formulas of the design tool against the programs: tables and state, to the byte."""
    prepared = cases.prepare(cases.CASES[name])
    linked = [Program.on(TARGETS["m4f"], name, method) for method in prepared.design.methods]
    build(linked)
    for program in linked:
        designed = prepared.design.methods[program.method]
        computed = footprint(program.method, designed, prepared.design.plant)
        flash = pytest.approx(computed.flash_bytes, rel=FLASH_ERROR)  # jump tables of the kernels
        assert sizes.table_bytes(program) == flash, program.method
        assert sizes.ram_bytes(program) == computed.ram_bytes, program.method


def documented(root):
    """(model, method) and typical instructions of every row of the Cortex-M4F in docs/cost.md."""
    rows = [[cell.strip(" `") for cell in line.split("|")[1:]]
            for line in section(root, "Cortex-M4F")]
    return [(row[0], row[1], int(row[2].replace(",", ""))) for row in rows]


def test_footprint_given_the_documented_steps_is_within_a_tenth_of_their_instructions(root):
    """Every row of a method that the design tool gives instructions for."""
    checked = set()
    for model, method, measured in documented(root):
        if method not in instructions.FORMULAS:
            continue
        design = cases.designed(cases.CASES[model], method)
        designed = design.methods[method]
        computed = footprint(method, designed, design.plant).instructions_typical
        assert computed == pytest.approx(measured, rel=0.1), (model, method)
        checked.add(method)
    assert checked == set(instructions.FORMULAS)


@pytest.mark.parametrize("option, value, hint", [
    ("--target", "m4", "m4f"), ("--model", "lui5", "liu5"), ("--method", "lassoo", "lasso")])
def test_bench_given_an_unknown_name_is_refused_with_a_hint(bulwark, refused, option, value, hint):
    message = refused(bulwark("bench", option, value))
    assert value in message and hint in message
