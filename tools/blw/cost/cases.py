# SPDX-License-Identifier: MIT
"""The plants whose costs are measured: their tables as C sources, and an attacked log of each."""

import csv
import subprocess
import tempfile
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w
from numpy.typing import NDArray

from blw import kalman
from blw.atomic import write_changed, write_files
from blw.build import BUILD, ROOT, StepFailed, simulator
from blw.design import Design, design_all, document, json_text, small
from blw.emit_c import files
from blw.errors import BulwarkError
from blw.model import load
from blw.options import suggestion

#: In every scenario <name>_cost.toml the first steps serve to settle, the next are without attack,
#: and all the others are attacked.  A method that warms up for longer settles for a multiple.
SETTLING_STEPS = 50
BENIGN_STEPS = 50
ATTACKED_STEPS = 200

#: What settled local filters still have of where they began.
FORGOTTEN = 0.01

#: Folder in that of a case: the same without straight-line code.
SMALL = "small"

FOLDER = BUILD / "cost"
HOST_SIM = ROOT / "host_sim"


@dataclass(frozen=True)
class Case:
    """A plant of host_sim/models whose scenario is <name>_cost.toml; options overrides those of
    the model file, per method."""

    name: str
    options: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)


#: [L] compares its methods at gamma = 0.75, where no step is the plain Kalman estimate.
CASES = {case.name: case for case in (
    Case("liu5", {"lasso": {"gamma": 0.75}}),
    Case("pendulum"),
    Case("torsion"),
    Case("grid4"),
    Case("random6"),
    Case("random10"),
)}


@dataclass(frozen=True, eq=False)
class Log:
    """Samples of one run: u(k-1) [steps x l], y(k) [steps x m] and masks of the valid ones."""

    u: NDArray[np.float64]
    y: NDArray[np.float64]
    valid: NDArray[np.uint64]

    def packed(self, dtype: str) -> bytes:
        """As the replay program reads it; dtype "<f4" or "<f8"."""
        fields = [("u", dtype, self.u.shape[1:]), ("y", dtype, self.y.shape[1:]), ("valid", "<u8")]
        rows = np.zeros(len(self.y), dtype=fields)
        rows["u"], rows["y"], rows["valid"] = self.u, self.y, self.valid
        return rows.tobytes()


@dataclass(frozen=True, eq=False)
class Prepared:
    """A case with its design and its log, of which the first `settling` steps serve to settle; the
    sources are in `folder`."""

    case: Case
    design: Design
    log: Log
    folder: Path
    settling: int = SETTLING_STEPS

    def settled_for(self, method: str) -> "Prepared":
        """The same with a log that begins with as many steps as the method needs to settle."""
        settling = settling_steps(self.design, method)
        if settling == self.settling:
            return self
        log = simulate(self.case, self.design, settling=settling)
        return replace(self, log=log, settling=settling)


def named(names: Sequence[str]) -> list[Case]:
    """The cases with these names, all without names.  Raises BulwarkError for an unknown one."""
    for name in names:
        if name not in CASES:
            raise BulwarkError(f"unknown model '{name}'; {suggestion(name, CASES)}")
    return [CASES[name] for name in names or CASES]


def prepare(case: Case, steps: int | None = None) -> Prepared:
    """Design every method, write the C sources for port/replay, simulate the log.

    steps: length of the log if it is not that of the scenario.
    """
    design = designed(case)
    folder = FOLDER / "cases" / case.name
    lines = [f"blw_add_replay({case.name} {method} {owner(design, method)})"
             for method in design.methods]
    write_changed(folder / SMALL, files(small(design)))
    write_changed(folder, {**files(design), "replays.cmake": "\n".join(lines) + "\n"})
    return Prepared(case, design, simulate(case, design, steps), folder)


def designed(case: Case, *methods: str) -> Design:
    """The case's design: every method that accepts the model, or these methods."""
    model = load(HOST_SIM / "models" / f"{case.name}.toml")
    return design_all(replace(model, methods={**model.methods, **case.options}), methods)


def owner(design: Design, method: str) -> str:
    """The C module that has the method: "lasso" for canonical."""
    ctype = design.methods[method].tables.ctype
    return ctype.removeprefix("blw_").removesuffix("_model_t")


def settling_steps(design: Design, method: str) -> int:
    """Before the first step that costs what every later one does: a warm-up, and where the work
    depends on the data, local filters that have forgotten that they began without error."""
    designed = design.methods[method]
    warm_up = designed.tables.members.get("warm_up", 0)
    slowest = max((abs(complex(pole["re"], pole["im"]))
                   for pole in designed.info.get("eigenvalues", [])), default=0.0)
    forgotten = int(np.log(FORGOTTEN) / np.log(slowest)) if slowest > 0.0 else 0
    return SETTLING_STEPS * max(1, -(-max(warm_up, forgotten) // SETTLING_STEPS))


def simulate(case: Case, design: Design, steps: int | None = None,
             settling: int = SETTLING_STEPS) -> Log:
    """One run of the case's scenario by the simulator, the attack put off until `settling` steps
    and those without attack are over."""
    scenario = HOST_SIM / "scenarios" / f"{case.name}_cost.toml"
    content = tomllib.loads(scenario.read_text(encoding="utf-8"))
    content["model"] = str(HOST_SIM / "models" / f"{case.name}.toml")
    later = settling - SETTLING_STEPS
    content["steps"] = (steps or content["steps"]) + later
    for attack in content["attack"]:
        attack["from"] += later
    only = replace(design, methods={kalman.NAME: design.methods[kalman.NAME]})
    with tempfile.TemporaryDirectory(prefix="bulwark.") as name:
        folder = Path(name)
        tables, run = write_files(folder, {"design.json": json_text(document(only)),
                                           "scenario.toml": tomli_w.dumps(content)})
        done = subprocess.run([simulator("f32"), "run", run, "--design", tables, "--out", folder,
                               "--method", kalman.NAME], capture_output=True, text=True)
        if done.returncode != 0:
            raise StepFailed(f"{scenario}: {done.stderr.strip()}")
        return read_log(folder / "log.csv", design)


def read_log(path: Path, design: Design) -> Log:
    """log.csv of a simulation: row k has y(k) and u(k); the step to k uses u(k-1)."""
    with path.open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    u = _columns(rows, design.model.inputs)
    y = _columns(rows, design.model.sensors)
    valid = np.isfinite(y) @ (np.uint64(1) << np.arange(y.shape[1], dtype=np.uint64))
    return Log(np.nan_to_num(u[:-1]), np.nan_to_num(y[1:]), valid[1:])


def _columns(rows: list[dict[str, str]], names: Sequence[str]) -> NDArray[np.float64]:
    values = [[float(row[name] or "nan") for name in names] for row in rows]
    return np.array(values).reshape(len(rows), len(names))
