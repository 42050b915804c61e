# SPDX-License-Identifier: MIT
"""The deepest path through a call graph."""

import pytest

from blw.build import StepFailed
from blw.cost.stack import CallGraph

POINTER = "__indirect_call"


def graph(frames, calls):
    return CallGraph({POINTER: 0, **frames}, {name: set(to) for name, to in calls.items()})


def test_deepest_given_two_branches_takes_the_larger_one():
    made = graph({"root": 8, "a": 16, "b": 4, "c": 40}, {"root": ["a", "b"], "b": ["c"]})
    assert made.deepest("root") == 8 + 4 + 40


def test_deepest_given_a_pointer_takes_the_deepest_function_it_may_mean():
    made = graph({"root": 8, "engine": 100, "kernel": 20},
                 {"root": [POINTER], "engine": [POINTER], POINTER: ["engine", "kernel"]})
    assert made.deepest("root") == 8 + 100 + 20


def test_deepest_given_a_pointer_does_not_return_to_its_own_file():
    made = graph({"root": 8, "e.c:multiply": 10, "e.c:solve": 100, "kernel": 20},
                 {"root": [POINTER], "e.c:multiply": [POINTER],
                  POINTER: ["e.c:multiply", "e.c:solve", "kernel"]})
    assert made.deepest("root") == 8 + 100
    assert made.deepest("e.c:multiply") == 10 + 20


def test_deepest_given_a_pointer_does_not_lead_back_to_its_caller():
    made = graph({"root": 8, "squares": 10, "solver": 100, "helper": 1, "kernel": 20},
                 {"root": [POINTER, "squares"], "squares": [POINTER], "solver": ["helper"],
                  "helper": ["squares"], POINTER: ["solver", "kernel"]})
    assert made.deepest("squares") == 10 + 20
    assert made.deepest("root") == 8 + 100 + 1 + 10 + 20


def test_deepest_given_recursion_fails_by_name():
    made = graph({"root": 8, "a": 16}, {"root": ["a"], "a": ["root"]})
    with pytest.raises(StepFailed, match="recursion: root -> a -> root"):
        made.deepest("root")


def test_forget_given_a_routine_that_is_not_linked_leaves_the_others():
    made = graph({"root": 8, "a": 16}, {"root": ["a", "__aeabi_idiv"]})
    assert made.named() == {"__aeabi_idiv"}
    made.forget(made.named())
    assert made.deepest("root") == 8 + 16


def test_deepest_given_a_function_without_a_frame_fails_by_name():
    with pytest.raises(StepFailed, match="the stack of other is not known"):
        graph({"root": 8}, {"root": ["other"]}).deepest("root")
