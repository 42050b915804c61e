# SPDX-License-Identifier: MIT
"""A small run for the tests of `report`.

It has k = 0..10, two states that are 0, and three sensors of which y2 is attacked at k = 4..6.  The
oracle errs by (0, 1) always, kalman by (3, 4) under attack and (0, 1) otherwise.  `guard` tests:
its alarm is raised at k = 2 (false), 5 and 6, and y2 is excluded at k = 5 and 6, y1 at k = 6.
"""

import csv
import json
from pathlib import Path

STATES = ["angle_rad", "angle_rad_s"]
SENSORS = ["y1", "y2", "y3"]
ATTACKED = range(4, 7)
HEAD = ["k", "t_s", "status", *STATES, "statistic", "threshold", "iterations", "bound", "excluded",
        *(f"suspicion:{s}" for s in SENSORS)]


class Folder:
    """What `run` would write, as lists of rows that a test may spoil before write()."""

    def __init__(self, path: Path, truth: bool = True) -> None:
        self.path = path
        names = [*SENSORS, "u1", *(f"x:{s}" for s in STATES if truth), *(f"a:{s}" for s in SENSORS)]
        self.tables = {
            "log": [["k", "t_s", *names], *(self.log_row(k, truth) for k in range(11))],
            "oracle": [HEAD, *(self.row(k, 0, 1) for k in range(1, 11))],
            "kalman": [HEAD, *(self.row(k, 3 if k in ATTACKED else 0, 4 if k in ATTACKED else 1)
                               for k in range(1, 11))],
            "guard": [HEAD, *(self.guard_row(k) for k in range(1, 11))],
        }
        self.summary = {"name": "two", "seed": 7, "model_sha256": "abc", "versions": {"blw": "1"}}

    @staticmethod
    def log_row(k: int, truth: bool) -> list:
        return [k, k / 10, 1, 2 if k in ATTACKED else 1, "" if k == 9 else 1, 0.5,
                *([0, 0] if truth else []), 0, 1 if k in ATTACKED else 0, 0]

    @staticmethod
    def row(k: int, x1: float, x2: float) -> list:
        return [k, k / 10, "kalman", x1, x2, 0, 0, 0, 0, "", 0, 0, 0]

    @staticmethod
    def guard_row(k: int) -> list:
        alarm = k in (2, 5, 6)
        excluded = {5: "y2", 6: "y1;y2"}.get(k, "")
        return [k, k / 10, "converged+missing" if alarm else "kalman", 0, 2, 9 if alarm else 1, 4,
                3 if alarm else 0, 0, excluded, 0, 0.9 if alarm else 0.1, 0]

    def write(self) -> Path:
        self.path.mkdir(exist_ok=True)
        for name, rows in self.tables.items():
            with (self.path / f"{name}.csv").open("w", newline="") as file:
                csv.writer(file).writerows(rows)
        if self.summary is not None:
            (self.path / "summary.json").write_text(json.dumps(self.summary))
        return self.path
