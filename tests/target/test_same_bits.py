# SPDX-License-Identifier: MIT
"""The same attacked steps on the host and on every target: the same bits, in every output word."""

from functools import cache

import numpy as np
import pytest
from emulated import available, prepared

from blw.cost import measure, programs
from blw.cost.programs import Program

STEPS = 10_000
METHODS = {"kalman": "pendulum", "lasso": "pendulum", "canonical": "pendulum",
           "decentral": "pendulum", "bank": "pendulum", "joint": "grid4", "guard": "pendulum"}

#: Complex poles have an engine of their own, whose steps are long without an FPU.
CASES = [*((method, model, STEPS) for method, model in METHODS.items()),
         ("canonical", "grid4", 200)]


def outputs(program, steps):
    log = prepared(program.model, steps)  # writes what is built next
    programs.build([program])
    return programs.run(program, log).outputs()


@cache
def on_host(model, method, steps, precision):
    return outputs(Program(model, method, None, f"host-{precision}"), steps)


def first_difference(here, there):
    """Step and word of the first one, None if there is none."""
    for step in np.flatnonzero(here != there):
        for name in here.dtype.names:
            if here[step][name].tobytes() != there[step][name].tobytes():
                return f"step {step + 1}: {name} {here[step][name]} and {there[step][name]}"
    return None


@pytest.mark.parametrize("method, model, steps", CASES)
def test_replay_given_attacked_steps_yields_the_bits_of_the_host(target, method, model, steps):
    host = on_host(model, method, steps, "f64" if target.is_double else "f32")
    there = outputs(Program.on(target, model, method), steps)
    assert len(there) == len(host) == steps
    assert np.all(host["status"] == 0)
    assert there.tobytes() == host.tobytes(), first_difference(host, there)


@pytest.mark.parametrize("method", METHODS)
def test_replay_given_a_build_for_size_yields_the_bits_of_the_host(method):
    model = METHODS[method]
    small = outputs(Program.on(available("m4f"), model, method, measure.SMALL), STEPS)
    host = on_host(model, method, STEPS, "f32")
    assert small.tobytes() == host.tobytes(), first_difference(host, small)


@pytest.mark.parametrize("method", METHODS)
def test_replay_given_contraction_yields_other_bits(method):
    model = METHODS[method]
    contracted = outputs(Program.on(available("m4f"), model, method, ".contracted"), STEPS)
    assert contracted.tobytes() != on_host(model, method, STEPS, "f32").tobytes()
