# SPDX-License-Identifier: MIT
"""The model of cycles, against Arm's tables read by hand."""

from collections import Counter

import pytest

from blw.cost.cycles import _sum, instruction


@pytest.mark.parametrize("mnemonic, operands, cycles", [
    ("adds", "r0, r1, #1", 1), ("vadd.f32", "s15, s14, s13", 1), ("vmul.f32", "s0, s1, s2", 1),
    ("vfma.f32", "s0, s1, s2", 3), ("vmls.f32", "s0, s1, s2", 3), ("vdiv.f32", "s0, s1, s2", 14),
    ("vsqrt.f32", "s0, s1", 14), ("vldr", "s13, [r2, #4]", 2), ("ldr.w", "r0, [r1, r2]", 2),
    ("strd", "r2, r3, [sp]", 3), ("push", "{r4, r6-r8, lr}", 6), ("vpop", "{d8-d9}", 5),
    ("vldmia", "r3!, {s12, s13}", 3), ("bne.n", "1c4 <f>", 1), ("vcmpe.f32", "s15, s9", 1)])
def test_instruction_given_a_line_takes_what_the_manual_says(mnemonic, operands, cycles):
    assert instruction(mnemonic, operands).cycles == cycles


def run(*lines):
    """Modelled cycles of these instructions, one after the other, before one that returns."""
    code = {4 * i: instruction(*line, function="f") for i, line in enumerate(lines)}
    code[4 * len(lines)] = instruction("movs", "r0, r0", function="replay")
    pairs = Counter({(4 * i, 4 * i + 4): 1 for i in range(len(lines))})
    return _sum([pairs], code).total


def test_sum_given_neighbouring_loads_pipelines_them():
    assert run(("vldr", "s0, [r0]"), ("vldr", "s1, [r1]"), ("vldr", "s2, [r2]")).cycles == 2 + 1 + 1


def test_sum_given_a_result_that_is_consumed_at_once_waits_a_cycle():
    assert run(("vmul.f32", "s0, s1, s2"), ("vadd.f32", "s3, s3, s0")).cycles == 1 + 1 + 1
    assert run(("vmul.f32", "s0, s1, s2"), ("vstr", "s0, [r0]")).cycles == 1 + 1 + 2
    assert run(("vmul.f32", "s0, s1, s2"), ("vadd.f32", "s3, s3, s4")).cycles == 1 + 1


def test_sum_given_an_addend_just_computed_does_not_wait():
    assert run(("vmul.f32", "s0, s1, s2"), ("vfma.f32", "s0, s4, s5")).cycles == 1 + 3
    assert run(("vmul.f32", "s0, s1, s2"), ("vfma.f32", "s4, s0, s5")).cycles == 1 + 1 + 3


def test_sum_given_a_branch_that_is_taken_refills_the_pipeline():
    code = {0: instruction("bne.n", "8 <f>", function="f", size=2),
            2: instruction("movs", "r0, #1", function="f", size=2),
            8: instruction("movs", "r0, #2", function="replay", size=2)}
    assert _sum([Counter({(0, 8): 1})], code).total.cycles == 3
    assert _sum([Counter({(0, 2): 1, (2, 8): 1})], code).total.cycles == 1 + 3


def test_sum_given_two_steps_counts_both_and_the_calls_in_them():
    code = {0: instruction("vldr", "s0, [r0]", function="f"),
            4: instruction("vadd.f32", "s1, s1, s0", function="g"),
            8: instruction("movs", "r0, r0", function="replay")}
    trace = _sum([Counter({(0, 4): 1, (4, 8): 1})] * 2, code)
    assert (trace.steps, trace.total.instructions, trace.total.cycles) == (2, 4, 6)
    assert [trace.functions[name].entries for name in "fg"] == [0, 2]
