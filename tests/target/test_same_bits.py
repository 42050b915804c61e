# SPDX-License-Identifier: MIT
"""The same attacked steps on the host and on every target: the same bits, in every output word."""

from functools import cache

import numpy as np
import pytest
from emulated import available, prepared

from blw.cost import programs
from blw.cost.programs import Program

STEPS = 10_000
METHODS = {"kalman": "pendulum", "lasso": "pendulum", "canonical": "pendulum",
           "decentral": "pendulum", "bank": "pendulum", "joint": "grid4", "guard": "pendulum"}


def outputs(program):
    log = prepared(program.model, STEPS)  # writes what is built next
    programs.build([program])
    return programs.run(program, log).outputs()


@cache
def on_host(method, precision):
    return outputs(Program(METHODS[method], method, None, f"host-{precision}"))


def on_target(target, method, variant=""):
    return outputs(Program.on(target, METHODS[method], method, variant))


def first_difference(here, there):
    """Step and word of the first one, None if there is none."""
    for step in np.flatnonzero(here != there):
        for name in here.dtype.names:
            if here[step][name].tobytes() != there[step][name].tobytes():
                return f"step {step + 1}: {name} {here[step][name]} and {there[step][name]}"
    return None


@pytest.mark.parametrize("method", METHODS)
def test_replay_given_attacked_steps_yields_the_bits_of_the_host(target, method):
    host = on_host(method, "f64" if target.is_double else "f32")
    there = on_target(target, method)
    assert len(there) == len(host) == STEPS
    assert np.all(host["status"] == 0)
    assert there.tobytes() == host.tobytes(), first_difference(host, there)


@pytest.mark.parametrize("method", METHODS)
def test_replay_given_contraction_yields_other_bits(method):
    contracted = on_target(available("m4f"), method, ".contracted")
    assert contracted.tobytes() != on_host(method, "f32").tobytes()
