# SPDX-License-Identifier: MIT
"""What the whole-program tests share: the checkout, its programs, and the shared data."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from shared_data import SHARED

from blw.build import PRECISIONS, ROOT, simulator

Run = Callable[..., subprocess.CompletedProcess]

TIMEOUT_S = 300


def call(command: list[object], **options) -> subprocess.CompletedProcess:
    """Run a program to its end, its output captured as text."""
    return subprocess.run([str(word) for word in command], capture_output=True, text=True,
                          stdin=subprocess.DEVNULL, timeout=TIMEOUT_S, check=False, **options)


@pytest.fixture(scope="session")
def root() -> Path:
    """The checkout."""
    return ROOT


@pytest.fixture(scope="session")
def entry() -> Run:
    """tools/bulwark with its set-up, as a user calls it."""
    return lambda *arguments, **options: call([ROOT / "tools" / "bulwark", *arguments], **options)


@pytest.fixture(scope="session")
def bulwark() -> Run:
    """The same without the look at what is installed."""
    environment = os.environ | {"PYTHONPATH": str(ROOT / "tools")}
    return lambda *arguments, **options: call([sys.executable, "-m", "blw", *arguments],
                                              env=environment, **options)


@pytest.fixture(scope="session", params=PRECISIONS)
def blw_sim(request: pytest.FixtureRequest) -> Run:
    """The simulator, in either precision."""
    program = simulator(request.param)
    return lambda *arguments, **options: call([program, *arguments], **options)


@pytest.fixture(scope="session")
def shared() -> Path:
    """Reference results and recorded logs; a test that wants them skips where they are missing."""
    if not SHARED.is_dir():
        pytest.skip(f"no {SHARED}: set BULWARK_SHARED")
    return SHARED


@pytest.fixture
def refused() -> Callable[[subprocess.CompletedProcess], str]:
    """Check that a program refused its input as it should; returns its message."""
    return _refusal


def _refusal(done: subprocess.CompletedProcess) -> str:
    assert done.returncode == 2, done.stderr
    assert not done.stdout
    assert done.stderr.count("\n") == 1, done.stderr
    return done.stderr
