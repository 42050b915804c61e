# SPDX-License-Identifier: MIT
"""What a step of the l1 fusion does on a given plant: counted in the C library itself.

Sweeps, pivots and Newton steps depend on the data, so a program (l1_work.c) runs the library on
simulated samples and counts the calls of its dense kernels, and the elements they go through.
"""

import hashlib
import shutil
import subprocess
import tempfile
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from blw.build import BUILD, ROOT, StepFailed
from blw.design import Design, small
from blw.emit_c import files
from blw.semidefinite import root

Array = NDArray[np.float64]

#: In the order of enum l1_kernel.
KERNELS = ("dot", "axpy", "move", "gemv", "symv", "trapv", "trapv_t", "solve", "norm", "factor",
           "matrix")

#: Modules whose calls of each other do not count.
PLAIN = ("la", "model", "step", "l1_factor")

#: Steps before those that count, and those without attack and under attack, at most; fewer where N
#: rows make them long, in multiples of WINDOW.
SETTLING = 500
STEPS = 2000
WINDOW = 50
_STEPS_TIMES_CUBED_ROWS = 3e8

#: The attack that a figure is told for: so many standard deviations on one sensor after another.
BIAS = 100.0

_SEED = 20261122

HERE = Path(__file__).parent
LIBRARY = ROOT / "lib" / "src"
INCLUDES = ("-I", ROOT / "lib" / "include", "-I", LIBRARY, "-I", HERE)
FLAGS = ("-std=c99", "-O1", "-ffp-contract=off")


@dataclass(frozen=True, eq=False)
class Work:
    """Per step: iterations as the library reports them, calls and elements of every kernel."""

    iterations: Array  #: [steps]
    calls: dict[str, Array]
    elements: dict[str, Array]

    def __getitem__(self, steps: slice) -> "Work":
        return Work(self.iterations[steps],
                    {name: values[steps] for name, values in self.calls.items()},
                    {name: values[steps] for name, values in self.elements.items()})


def affordable(N: int) -> int:
    """Steps of either kind for N rows; 0 where a step takes too long to simulate any."""
    return min(STEPS, WINDOW * int(_STEPS_TIMES_CUBED_ROWS / N**3 / WINDOW))


def one_by_one(design: Design, steps: int = STEPS) -> Array:
    """[steps x m] BIAS standard deviations on one sensor after another."""
    m = design.model.m
    liar = np.arange(steps) * m // steps
    return np.where(liar[:, None] == np.arange(m), BIAS * np.sqrt(np.diag(design.model.R)), 0.0)


def count(design: Design, method: str, attack: Array, steps: int = STEPS,
          ) -> tuple[Work, Work] | None:
    """Work of so many steps without attack, and then under the attack [k x m], which is added to
    the samples; None if there is no C compiler."""
    compiler = shutil.which("cc")
    if compiler is None:
        return None
    model = design.model
    settling = min(SETTLING, steps)
    total = settling + steps + len(attack)
    normal = np.random.default_rng(_SEED).standard_normal((total, model.n + model.m))
    draws = normal @ scipy.linalg.block_diag(root(model.W), root(model.R)).T
    draws[settling + steps :, model.n :] += attack
    with tempfile.TemporaryDirectory(prefix="bulwark.") as name:
        folder = Path(name)
        program = _compile(compiler, design, method, folder)
        (folder / "draws").write_bytes(draws.tobytes())
        _run(program, folder / "draws", folder / "out")
        rows = np.fromfile(folder / "out", np.uint32).reshape(total, 1 + 2 * len(KERNELS))
    rows = rows.astype(float)
    work = Work(rows[:, 0], dict(zip(KERNELS, rows[:, 1::2].T, strict=True)),
                dict(zip(KERNELS, rows[:, 2::2].T, strict=True)))
    return work[settling : settling + steps], work[settling + steps :]


def _compile(compiler: str, design: Design, method: str, folder: Path) -> Path:
    """The program for one method, without straight-line code: the loops do the same."""
    name = design.model.name
    only = replace(design, methods={method: design.methods[method]})
    for file, text in files(small(only)).items():
        (folder / file).write_text(text, encoding="utf-8")
    macro = f"BLW_{name.upper()}_{method.upper()}"
    names = (f'-DWORK_MODEL_HEADER="{name}_model.h"', f"-DWORK_MODEL=blw_{name}_{method}",
             f"-DWORK_STORAGE={macro}_STORAGE", f"-DWORK_MEM={macro}_MEM")
    program = folder / "l1_work"
    _run(compiler, *FLAGS, *INCLUDES, "-I", folder, *names, HERE / "l1_work.c",
         folder / f"{name}_model.c", *_library(compiler), "-lm", "-o", program)
    return program


def _library(compiler: str) -> list[Path]:
    """Objects of the modules, compiled once for all models."""
    plain = [LIBRARY / f"blw_{module}.c" for module in PLAIN]
    sources = sorted({*LIBRARY.glob("blw_l1*.c"), LIBRARY / "blw_jordan.c",
                      LIBRARY / "blw_lasso.c", *plain})
    headers = [*LIBRARY.glob("*.h"), *(ROOT / "lib" / "include" / "blw").glob("*.h"),
               HERE / "l1_work.h"]
    digest = hashlib.sha256(" ".join([compiler, *FLAGS]).encode())
    for path in [*sources, *sorted(headers)]:
        digest.update(path.read_bytes())
    made = BUILD / "l1_work" / digest.hexdigest()[:16]
    if not made.is_dir():
        made.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=made.parent) as name:
            fresh = Path(name, "objects")
            fresh.mkdir()
            for source in sources:
                counted = () if source in plain else ("-include", HERE / "l1_work.h")
                _run(compiler, *FLAGS, *INCLUDES, *counted, "-c", source, "-o",
                     fresh / f"{source.stem}.o")
            with suppress(OSError):  # another run was quicker
                fresh.rename(made)
    return sorted(made.glob("*.o"))


def _run(*command: str | Path) -> None:
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode != 0:
        said = done.stderr.strip() or f"status {done.returncode}"
        raise StepFailed(f"{Path(command[0]).name}: {said}")
