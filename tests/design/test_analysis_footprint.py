# SPDX-License-Identifier: MIT
"""Footprint formulas against the compiled headers and tables."""

import shutil
import subprocess

import golden
import pytest

from blw import model
from blw.analysis import footprint, headers
from blw.design import design_all, plant_tables
from blw.emit_c import files
from blw.kalman import steady_state
from blw.methods import REGISTRY

COMPILER = "arm-none-eabi-gcc"
MODULES = [name for name in REGISTRY if name not in footprint.MODULE]


def compiled(folder, text, *options):
    if shutil.which(COMPILER) is None:
        pytest.skip(f"no {COMPILER}")
    source = folder / "sizes.c"
    source.write_text(text)
    return subprocess.run(
        [COMPILER, "-std=c11", "-mcpu=cortex-m4", "-mthumb", "-ffreestanding", "-I",
         str(headers.HEADERS.parent), "-c", str(source), "-o", str(folder / "sizes.o"), *options],
        capture_output=True, text=True)


def test_structure_sizes_are_those_of_the_compiler(tmp_path):
    types = ["blw_model_t", "blw_plant_t", "blw_l1_model_t", "blw_jordan_model_t", "blw_l1_t"]
    for name in MODULES:
        types += [f"blw_{name}_t", f"blw_{name}_model_t"]
    text = "".join(f'#include "blw/{path.name}"\n' for path in headers.HEADERS.glob("*.h"))
    text += "".join(f'_Static_assert(sizeof({t}) == {headers.size_of(t)}, "{t}");\n' for t in types)
    done = compiled(tmp_path, text)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("name", ["pendulum", "drone6"])
def test_memory_and_flash_are_those_of_the_emitted_sources(tmp_path, name):
    loaded = model.load(golden.MODELS / f"{name}.toml")
    design = design_all(loaded, ["kalman", "lasso"])
    for method, designed in design.methods.items():
        one = type(design)(design.model, design.plant, {method: designed})
        (tmp_path / method).mkdir()
        for file, text in files(one).items():
            (tmp_path / method / file).write_text(text)
        arguments = ", ".join(f"{value}U" for value in designed.mem)
        cost = footprint.footprint(method, designed, design.plant)
        macro = f"BLW_{method.upper()}_MEM"
        done = compiled(
            tmp_path,
            f'#include "{name}_model.c"\n#include "blw/blw_{method}.h"\n_Static_assert(4U *'
            f' {macro}({arguments}) + sizeof(blw_{method}_t) == {cost.ram_bytes}U, "RAM");\n',
            "-I", str(tmp_path / method), "-Os", "-fdata-sections")
        assert done.returncode == 0, done.stderr
        assert read_only_bytes(tmp_path / "sizes.o") == cost.flash_bytes


def read_only_bytes(object_file):
    """Of all tables but the detector's, which every model has and the linker drops if unused."""
    lines = subprocess.run(["arm-none-eabi-size", "-A", str(object_file)], capture_output=True,
                           text=True, check=True).stdout.splitlines()
    return sum(int(line.split()[1]) for line in lines if line.startswith(".rodata.")
               and "chi2" not in line)


def test_macros_with_conditions_follow_both_branches():
    rows = headers.macro("BLW_L1_ROWS")
    assert rows(15, 12, 15) == 13
    assert rows(15, 12, 10) == 15


def test_every_method_has_a_footprint():
    loaded = model.load(golden.MODELS / "pendulum.toml")
    gains = steady_state(loaded.A, loaded.C, loaded.W, loaded.R)
    plant = plant_tables(loaded, gains)
    for name, designed in design_all(loaded).methods.items():
        cost = footprint.footprint(name, designed, plant)
        assert cost.flash_bytes > 0 and cost.ram_bytes > 0
        assert cost.macs_typical is None or cost.macs_typical <= cost.macs_worst
