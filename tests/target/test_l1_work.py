# SPDX-License-Identifier: MIT
"""What the certificate of `lasso` takes on the Cortex-M4F."""

from dataclasses import replace

import numpy as np
from emulated import available

from blw.atomic import write_changed
from blw.cost import cases, cycles, programs
from blw.design import design_all
from blw.emit_c import files
from blw.model import load

STEPS = 10

#: Functions of one blw_l1_solve() where nu = 0 is optimal.
CERTIFICATE = ["blw_l1_solve", "lasso_l1_fast_certify"]
MOST = 900


def test_lasso_given_no_attack_keeps_to_the_instructions_of_its_certificate(record_property):
    target = available("m4f")
    model = replace(load(cases.HOST_SIM / "models" / "liu5.toml"), name="liu5_certificate",
                    methods={"lasso": {"gamma": 1e3}})
    made = design_all(model, ["kalman", "lasso"])
    folder = cases.FOLDER / "cases" / model.name
    write_changed(folder, {**files(made), "replays.cmake":
                           f"blw_add_replay({model.name} lasso lasso)\n"})
    program = programs.Program.on(target, model.name, "lasso")
    programs.build([program])
    y = np.random.default_rng(7).standard_normal((STEPS, model.m))
    log = cases.Log(np.zeros((STEPS, model.l)), y, np.full(STEPS, (1 << model.m) - 1, np.uint64))
    prepared = cases.Prepared(cases.CASES["liu5"], made, log, folder, settling=0)
    assert not programs.run(program, prepared).steps["iterations"].any()
    trace = cycles.follow(program, prepared, typical=3_000)
    taken = sum(trace.functions[name].instructions for name in CERTIFICATE) / trace.steps
    record_property("certificate and x_hat", taken)
    assert not {"multiply", "blw_la_copy"} & trace.functions.keys()  # of the loops in their place
    assert trace.steps == STEPS and taken <= MOST
