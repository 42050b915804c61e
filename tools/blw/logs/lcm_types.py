# SPDX-License-Identifier: MIT
"""The message types of host_sim/lcm/bulwark.lcm in Python, made by lcm-gen when they change."""

import hashlib
import importlib.util
import shutil
import subprocess
import sys
import tempfile
from functools import cache
from pathlib import Path
from types import ModuleType

from blw.build import BUILD, ROOT
from blw.errors import BulwarkError

SOURCE = ROOT / "host_sim" / "lcm" / "bulwark.lcm"

CHANNELS = {"sync": "BLW_SYNC", "measurement": "BLW_MEASUREMENT", "input": "BLW_INPUT",
            "estimate": "BLW_ESTIMATE", "truth": "BLW_TRUTH", "alarm": "BLW_ALARM"}


@cache
def types() -> ModuleType:
    """The package `bulwark` with measurement_t and the rest.  Raises BulwarkError."""
    folder = BUILD / "lcm" / hashlib.sha256(SOURCE.read_bytes()).hexdigest()[:16]
    if not folder.is_dir():
        _generate(folder)
    package = folder / "bulwark"
    spec = importlib.util.spec_from_file_location(
        "bulwark", package / "__init__.py", submodule_search_locations=[str(package)])
    module = importlib.util.module_from_spec(spec)
    sys.modules["bulwark"] = module
    spec.loader.exec_module(module)
    return module


def _generate(folder: Path) -> None:
    program = shutil.which("lcm-gen")
    if program is None:
        raise BulwarkError("lcm-gen is not installed; it is in Debian's package liblcm-bin")
    folder.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder.parent) as scratch:
        made = Path(scratch) / "made"
        subprocess.run([program, "--python", "--ppath", made, SOURCE], check=True,
                       capture_output=True)
        if not folder.is_dir():
            made.rename(folder)
