# SPDX-License-Identifier: MIT
"""Reference results and recorded logs, which are no part of the checkout: $BULWARK_SHARED."""

import json
import os
from pathlib import Path
from typing import Any

import pytest

SHARED = Path(os.environ.get("BULWARK_SHARED", Path(__file__).resolve().parents[2] / "shared"))


def golden(name: str) -> dict[str, Any]:
    """A golden file; skips if it is missing."""
    path = SHARED / "golden" / f"{name}.json"
    if not path.is_file():
        pytest.skip(f"no {path}: set BULWARK_SHARED")
    return json.loads(path.read_text())
