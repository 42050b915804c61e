# SPDX-License-Identifier: MIT
"""What a step of joint takes on the Cortex-M4F, against what `analyze` says."""

import numpy as np
import pytest
from emulated import available

from blw.analysis.footprint import footprint
from blw.atomic import write_changed
from blw.cost import cases, programs
from blw.cost.targets import ICOUNT
from blw.design import design_all
from blw.emit_c import files
from blw.model import parse

STEPS = 60


def plant(gains, n, m, strong):
    """Stable, every state seen by every sensor; the first `strong` sensors are strong."""
    generator = np.random.default_rng(n + m)
    A = generator.standard_normal((n, n))
    C = generator.standard_normal((m, n))
    return parse({"name": f"joint_work_{gains}", "dt_s": 1.0,
                  "plant": {"A": (0.9 * A / np.abs(np.linalg.eigvals(A)).max()).tolist(),
                            "C": C.tolist(), "Q": np.eye(n).tolist(), "R": np.eye(m).tolist()},
                  "attack": {"p": 1, "strong": [f"y{i + 1}" for i in range(strong)]},
                  "method": {"joint": {"gains": gains}}}, "joint_work")


@pytest.mark.parametrize("gains, n, m, strong", [("schedule", 7, 9, 4), ("recursive", 5, 5, 3)])
def test_joint_given_any_size_takes_the_instructions_that_analyze_tells(gains, n, m, strong):
    target = available("m4f")
    made = design_all(plant(gains, n, m, strong), ["joint"])
    name = made.model.name
    folder = cases.FOLDER / "cases" / name
    write_changed(folder, {**files(made), "replays.cmake": f"blw_add_replay({name} joint joint)\n"})
    program = programs.Program.on(target, name, "joint")
    programs.build([program])
    y = np.random.default_rng(1).standard_normal((STEPS, m))
    log = cases.Log(np.zeros((STEPS, 0)), y, np.full(STEPS, (1 << m) - 1, np.uint64))
    counts = programs.run(program, cases.Prepared(cases.Case(name), made, log, folder),
                          ICOUNT).instructions(target)
    told = footprint("joint", made.methods["joint"], made.plant).instructions_typical
    assert np.median(counts) == pytest.approx(told, rel=0.1)
