# SPDX-License-Identifier: MIT
"""What the tests on emulated targets share: cases, and a skip where a target cannot be had."""

from functools import cache

import pytest

from blw.cost import cases, targets


@cache
def prepared(name, steps):
    """A case of the cost table with a log of so many steps."""
    return cases.prepare(cases.CASES[name], steps)


def available(name):
    """The target with this name, or a skip if its compiler or its QEMU is not installed."""
    one = targets.TARGETS[name]
    if one.missing():
        pytest.skip(f"not installed: {', '.join(one.missing())}")
    return one
