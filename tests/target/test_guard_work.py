# SPDX-License-Identifier: MIT
"""What a step of guard takes on the Cortex-M4F, whatever one sensor sends (docs/guard.md)."""

from dataclasses import replace

import numpy as np
import pytest
from emulated import available

from blw.atomic import write_changed
from blw.cost import cases, programs
from blw.cost.targets import ICOUNT
from blw.design import design_all
from blw.emit_c import files
from blw.model import load

STEPS = 1_000
PERIOD = 20

#: Kind of attack: whether the liar stays the same, and standard deviations of what it adds.
FAMILIES = {"one liar": (True, 1e6), "one liar, small": (True, 30.0), "changing": (False, 1e6),
            "changing, small": (False, 30.0)}
LIMITS = {"liu5": (1_800, 5_000), "random6": (12_000, 30_000)}


def samples(model, stays, largest):
    """y [STEPS, m] about a state at rest: noise, and after PERIOD steps noise of 1 to `largest`
    standard deviations on one sensor, of another size and maybe sensor every PERIOD steps."""
    generator = np.random.default_rng(7)
    y = generator.standard_normal((STEPS, model.m)) @ np.linalg.cholesky(model.R).T
    liar = generator.integers(model.m)
    for start in range(PERIOD, STEPS, PERIOD):
        liar = liar if stays else generator.integers(model.m)
        size = largest ** generator.random() * np.sqrt(model.R[liar, liar])
        y[start : start + PERIOD, liar] += size * generator.standard_normal(PERIOD)
    return y


@pytest.mark.parametrize("name", LIMITS)
def test_guard_given_any_liar_keeps_to_its_instructions(name, record_property):
    target = available("m4f")
    model = replace(load(cases.HOST_SIM / "models" / f"{name}.toml"), name=f"{name}_work")
    made = design_all(model, ["kalman", "guard"])
    folder = cases.FOLDER / "cases" / model.name
    built = f"blw_add_replay({model.name} guard guard)\n"
    write_changed(folder, {**files(made), "replays.cmake": built})
    program = programs.Program.on(target, model.name, "guard")
    programs.build([program])
    for family, (stays, largest) in FAMILIES.items():
        y = samples(model, stays, largest)
        valid = np.full(STEPS, (1 << model.m) - 1, np.uint64)
        log = cases.Log(np.zeros((STEPS, model.l)), y, valid)
        replay = programs.run(program, cases.Prepared(cases.CASES[name], made, log, folder), ICOUNT)
        counts = replay.instructions(target)
        typical, worst = LIMITS[name]
        record_property(f"{family}, worst", int(counts.max()))
        assert np.median(counts[replay.steps["outcome"] == 0]) <= typical
        assert counts.max() <= worst
