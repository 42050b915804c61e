# SPDX-License-Identifier: MIT
"""A CSV file of numbers with a header, whose errors name file, line and column."""
from __future__ import annotations

import csv
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from blw.errors import BulwarkError
from blw.report.series import Array


@dataclass(frozen=True)
class CsvFile:
    """A CSV file as text; cells are turned into numbers on demand, so that errors name the cell."""

    path: Path
    header: list[str]
    rows: list[list[str]]

    @classmethod
    def read(cls, path: Path) -> CsvFile:
        try:
            with path.open(newline="", encoding="utf-8-sig") as file:
                lines = list(csv.reader(file, skipinitialspace=True))
        except FileNotFoundError as error:
            raise BulwarkError(
                f"{path}: no such file; `run` and `replay` write it into their --out folder"
            ) from error
        except (OSError, UnicodeDecodeError, csv.Error) as error:
            raise BulwarkError(f"{path}: {error}") from error
        if len(lines) < 2:
            raise BulwarkError(f"{path}: a header and at least one row are wanted")
        width = len(lines[0])
        for number, row in enumerate(lines, start=1):
            if len(row) != width:
                raise BulwarkError(f"{path}:{number}: {len(row)} cells, the header has {width}")
        return cls(path, lines[0], lines[1:])

    def column(self, name: str) -> Sequence[str]:
        if name not in self.header:
            raise BulwarkError(f"{self.path}:1: no column '{name}'")
        at = self.header.index(name)
        return [row[at] for row in self.rows]

    def numbers(self, names: Sequence[str]) -> Array:
        """[T, len(names)]; an empty cell is NaN."""
        out = np.empty((len(self.rows), len(names)))
        for j, name in enumerate(names):
            cells = self.column(name)
            try:
                out[:, j] = [float(c) if c else np.nan for c in cells]
            except ValueError:
                self._refuse(name, cells, lambda c: not c or _converts(float, c), "a number")
        return out

    def times(self, name: str) -> Array:
        """[T], finite and never going back."""
        values = self.numbers([name])[:, 0]
        bad = np.flatnonzero(~np.isfinite(values) | (np.diff(values, prepend=values[0]) < 0.0))
        if len(bad) > 0:
            line = bad[0] + 2
            raise BulwarkError(f"{self.path}:{line}: column '{name}' is empty or goes back")
        return values

    def integers(self, name: str) -> NDArray[np.int64]:
        """[T], strictly increasing: this is how steps are counted."""
        cells = self.column(name)
        try:
            values = np.array([int(c) for c in cells], dtype=np.int64)
        except ValueError:
            self._refuse(name, cells, lambda c: _converts(int, c), "an integer")
        back = np.flatnonzero(np.diff(values) <= 0)
        if len(back) > 0:
            raise BulwarkError(f"{self.path}:{back[0] + 3}: column '{name}' does not increase")
        return values

    def sets(self, name: str, members: list[str]) -> NDArray[np.bool_]:
        """[T, len(members)] from cells that join members by ';'."""
        out = np.zeros((len(self.rows), len(members)), dtype=bool)
        index = {member: i for i, member in enumerate(members)}
        for row, cell in enumerate(self.column(name)):
            for part in cell.split(";") if cell else ():
                if part not in index:
                    raise BulwarkError(f"{self.path}:{row + 2}: '{part}' is no sensor")
                out[row, index[part]] = True
        return out

    def _refuse(
        self, name: str, cells: Sequence[str], good: Callable[[str], bool], wanted: str
    ) -> NoReturn:
        line, cell = next((i, c) for i, c in enumerate(cells, start=2) if not good(c))
        message = f"{self.path}:{line}: column '{name}': '{cell}' is not {wanted}"
        raise BulwarkError(message) from None


def _converts(kind: type, cell: str) -> bool:
    try:
        kind(cell)
    except ValueError:
        return False
    return True
