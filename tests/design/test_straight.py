# SPDX-License-Identifier: MIT
"""Straight-line kernels against the library's loops, bit for bit, and when there is none."""

import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from blw import design, emit_c, kalman, model, straight

ROOT = Path(__file__).resolve().parents[2]
MODELS = ROOT / "host_sim" / "models"
WIDTHS = {"f32": [], "f64": ["-DBLW_REAL_DOUBLE"]}

# Two estimators by METHOD over the same data, one without the kernel: benign samples, exact zeros,
# signs of zero, missing samples, spikes, infinities and NaN.  Prints the steps that differ in any
# bit of an output, and the steps that the kernel served.
COMPARE = r"""
#include <stdio.h>
#include <string.h>
#include "NAME_model.h"
BLW_UPPER_METHOD_STORAGE(fast);
BLW_UPPER_METHOD_STORAGE(loop);
static uint32_t seed = 1U;
static blw_real_t draw(void)
{
    seed = (seed * 1664525U) + 1013904223U;
    return ((blw_real_t)(seed >> 8) / BLW_R(8388608.0)) - BLW_R(1.0);
}
static blw_real_t sample(unsigned k)
{
    const blw_real_t zero  = BLW_R(0.0);
    const blw_real_t odd[6] = {zero, -zero, BLW_R(1e20), BLW_SIGNAL_MAX, zero / zero,
                               BLW_R(1.0) / zero};
    const blw_real_t usual = BLW_R(3.0) * draw();
    return (k < 40U) ? odd[k % 2U] : (((k % 37U) == 0U) ? odd[(k / 37U) % 6U] : usual);
}
int main(void)
{
    static OWNER_model_t bare;
    PARTS
    blw_estimator_out_t  a, b;
    blw_real_t           u[UPPER_L + 1U], y[UPPER_M];
    unsigned             differ = 0U;
    if ((OWNER_init(&fast, &blw_NAME_METHOD, fast_mem, BLW_UPPER_METHOD_MEM) != BLW_OK)
        || (OWNER_init(&loop, &bare, loop_mem, BLW_UPPER_METHOD_MEM) != BLW_OK)) {
        return 1;
    }
    for (unsigned k = 0U; k < 4000U; k++) {
        const blw_mask_t valid = BLW_MASK_ALL(UPPER_M) ^ (((k % 11U) == 0U) ? 2U : 0U);
        for (size_t i = 0U; i < UPPER_M; i++) {
            y[i] = sample(k);
        }
        for (size_t i = 0U; i < UPPER_L; i++) {
            u[i] = (k < 40U) ? BLW_R(0.0) : draw();
        }
        if ((OWNER_step(&fast, u, y, valid, &a) != OWNER_step(&loop, u, y, valid, &b))
            || (memcmp(a.x_hat, b.x_hat, UPPER_N * sizeof u[0]) != 0) || (a.used != b.used)
            || (memcmp(a.suspicion, b.suspicion, UPPER_M * sizeof u[0]) != 0)
            || (memcmp(&a.bound, &b.bound, sizeof a.bound) != 0)
            || (memcmp(&a.statistic, &b.statistic, sizeof a.statistic) != 0)
            || (a.iterations != b.iterations) || (a.flags != b.flags)) {
            differ++;
        }
    }
    printf("%u %d\n", differ, KERNEL);
    return 0;
}
"""

PARTS = {
    "kalman": "bare = blw_NAME_kalman; bare.step = NULL;",
    "lasso": """static blw_jordan_model_t filters; static blw_l1_model_t fusion;
    bare = blw_NAME_lasso; filters = *bare.jordan; filters.step = NULL; bare.jordan = &filters;
    fusion = *bare.l1; fusion.fast = NULL; bare.l1 = &fusion;""",
    "guard": """bare = blw_NAME_guard; bare.advance = NULL; bare.multiply = NULL; bare.move = NULL;
    bare.squares = NULL; bare.average = NULL; bare.fuse = NULL;""",
}
KERNEL = {"kalman": "blw_NAME_kalman.step != NULL", "lasso": "blw_NAME_lasso.jordan->step != NULL",
          "guard": "blw_NAME_guard.advance != NULL"}


def compare(folder: Path, made: design.Design, method: str, width: str) -> str:
    """What the program above prints."""
    if shutil.which("gcc") is None:
        pytest.skip("gcc is not installed")
    name = made.model.name
    for file, text in emit_c.files(made).items():
        (folder / file).write_text(text)
    text = COMPARE.replace("PARTS", PARTS[method]).replace("KERNEL", KERNEL[method])
    text = text.replace("OWNER", f"blw_{method}").replace("UPPER", name.upper())
    text = text.replace("METHOD", method).replace("NAME", name)
    text = text.replace(f"BLW_{name.upper()}_{method}_", f"BLW_{name.upper()}_{method.upper()}_")
    (folder / "main.c").write_text(text)
    modules = ["la", "model", "step", "kalman", "jordan", "lasso", "l1", "l1_active_set", "l1_admm",
               "l1_factor", "l1_kkt", "l1_newton", "l1_newton_finish", "l1_newton_start",
               "l1_newton_step", "l1_refine",
               "l1_support", "l1_tableau"]
    library = ROOT / "lib" / "src"
    sources = [*(library / f"blw_{module}.c" for module in modules), *library.glob("blw_guard*.c")]
    subprocess.run(["gcc", "-std=c99", "-O1", "-ffp-contract=off", *WIDTHS[width],
                    f"-I{ROOT / 'lib' / 'include'}", *sources, folder / f"{name}_model.c",
                    folder / "main.c", "-lm", "-o", folder / "main"], check=True)
    return subprocess.run([folder / "main"], capture_output=True, text=True, check=True).stdout


@pytest.mark.parametrize("method", PARTS)
@pytest.mark.parametrize("name, width", [("liu5", "f32"), ("liu5", "f64"), ("pendulum", "f32"),
                                         ("drone6", "f32")])
def test_kernel_given_any_data_has_the_bits_of_the_loops(tmp_path, name, width, method):
    plant = model.load(MODELS / f"{name}.toml")
    made = design.design_all(plant, ["kalman", "lasso", "guard"])
    assert compare(tmp_path, made, method, width) == "0 1\n"


def test_kernel_of_guard_given_modes_that_decay_has_the_bits_of_the_loops(tmp_path):
    made = design.design_all(model.load(MODELS / "random6.toml"), ["kalman", "guard"])
    assert made.methods["guard"].tables.to_json()["n_u"] < 6
    assert compare(tmp_path, made, "guard", "f32") == "0 1\n"


@pytest.mark.parametrize("width", WIDTHS)
def test_kernel_of_kalman_given_a_dense_plant_has_the_bits_of_the_loops(tmp_path, width):
    plant = model.load(MODELS / "random6.toml")
    assert straight.closed(plant, steady(plant).K) is not None
    assert compare(tmp_path, design.design_all(plant, ["kalman"]), "kalman", width) == "0 1\n"


def steady(plant: model.Model) -> kalman.Kalman:
    return kalman.steady_state(plant.A, plant.C, plant.W, plant.R)


def test_kalman_step_given_the_papers_example_counts_what_is_not_zero():
    plant = model.load(MODELS / "liu5.toml")
    code = straight.kalman_step(plant, steady(plant))
    assert code is not None
    assert "32 multiply-adds of 42" in code.comment  # A 3, Bu 1, C 13, K 15


def test_kalman_step_given_a_dense_plant_is_the_closed_form():
    plant = model.load(MODELS / "random6.toml")
    code = straight.kalman_step(plant, steady(plant))
    assert code is not None
    assert "90 multiply-adds of 90" in code.comment  # n (n + l + m), not n (n + l + 2 m) = 138


def test_closed_given_a_plant_of_ones_and_zeros_is_not_worth_it():
    plant = model.load(MODELS / "pendulum.toml")
    assert straight.closed(plant, steady(plant).K) is None


def test_kalman_step_given_a_range_that_excludes_zero_is_left_to_the_loops():
    plant = model.load(MODELS / "liu5.toml")
    limits = plant.range.copy()
    limits[1] = [5.0, 9.0]
    assert straight.kalman_step(replace(plant, range=limits), steady(plant)) is None


def test_kalman_step_given_a_large_plant_is_left_to_the_loops():
    n, m = 12, 16
    rows = np.random.default_rng(3).standard_normal((m, n)).tolist()
    plant = model.parse({"name": "large", "dt_s": 1.0,
                         "plant": {"A": (0.5 * np.eye(n)).tolist(), "C": rows,
                                   "Q": np.eye(n).tolist(), "R": np.eye(m).tolist()},
                         "attack": {"p": 1}}, "large")
    assert straight.kalman_step(plant, steady(plant)) is None
