# SPDX-License-Identifier: MIT
"""What tests in several files share."""

from pathlib import Path

import pytest
from report_case import Folder


@pytest.fixture
def folder(tmp_path: Path) -> Folder:
    """A small run for `report`, which a test may spoil before it is written."""
    return Folder(tmp_path / "run")
