# SPDX-License-Identifier: MIT
"""The emulated targets, one after the other."""

import pytest
from emulated import available

from blw.cost import targets


@pytest.fixture(params=targets.TARGETS)
def target(request):
    """Every target in turn."""
    return available(request.param)
