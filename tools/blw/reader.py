# SPDX-License-Identifier: MIT
"""Values of one table of a TOML file, each checked for type, shape and finiteness."""

import math
import sys
from collections.abc import Iterable, Mapping
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from blw.errors import ModelError
from blw.options import check_keys

Array = NDArray[np.float64]


def is_number(value: Any) -> bool:
    """True for an integer or a float, false for everything else, booleans included."""
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def is_finite(value: int | float) -> bool:
    """True for what a double holds; unlike math.isfinite also defined for huge integers."""
    return abs(value) <= sys.float_info.max


class Reader:
    """One table.  Every method raises ModelError with the prefix `where`, e.g. "m.toml: plant."."""

    def __init__(self, raw: Mapping[str, Any], where: str, known: Iterable[str]) -> None:
        self.raw = raw
        self.where = where
        check_keys(raw, known, where.rstrip(":. "))

    def fail(self, key: str, problem: str) -> NoReturn:
        """Raise ModelError: where.key problem."""
        raise ModelError(f"{self.where}{key} {problem}")

    def has(self, key: str) -> bool:
        """Whether the file gives this key."""
        return key in self.raw

    def require(self, key: str) -> Any:
        """The raw value; an error if it is missing."""
        if key not in self.raw:
            self.fail(key, "is missing")
        return self.raw[key]

    def table(self, key: str, required: bool = False) -> Mapping[str, Any]:
        """A sub-table; empty if it is missing."""
        value = self.require(key) if required else self.raw.get(key, {})
        if not isinstance(value, Mapping):
            self.fail(key, f"must be a table, not {value!r}")
        return value

    def positive(self, key: str) -> float:
        """A finite number above 0."""
        value = self.require(key)
        if not is_number(value) or not (is_finite(value) and value > 0):
            self.fail(key, f"must be a positive number, not {value!r}")
        return float(value)

    def integer(self, key: str, default: int) -> int:
        """An integer."""
        value = self.raw.get(key, default)
        if not isinstance(value, int) or isinstance(value, bool):
            self.fail(key, f"must be an integer, not {value!r}")
        return value

    def boolean(self, key: str) -> bool:
        """True or false; false if it is missing."""
        value = self.raw.get(key, False)
        if not isinstance(value, bool):
            self.fail(key, f"must be true or false, not {value!r}")
        return value

    def strings(self, key: str, default: list[str]) -> list[str]:
        """A list of strings."""
        return self._strings(key, self.raw.get(key, default))

    def string_lists(self, key: str) -> list[list[str]]:
        """A list of non-empty lists of strings; empty if it is missing."""
        value = self.raw.get(key, [])
        if not isinstance(value, list):
            self.fail(key, f"must be a list of lists of names, not {value!r}")
        groups = [self._strings(f"{key}, group {i},", item) for i, item in enumerate(value, 1)]
        for number, group in enumerate(groups, start=1):
            if not group:
                self.fail(key, f"has nothing in group {number}")
        return groups

    def vector(self, key: str, size: int, default: Array) -> Array:
        """[size] finite numbers."""
        if key not in self.raw:
            return default
        return self._row(key, "", self.raw[key], size)

    def matrix(self, key: str, rows: int | None, columns: int | None,
               default: Array | None = None) -> Array:
        """[rows, columns] finite numbers, a list of rows; None leaves a size open."""
        if default is not None and key not in self.raw:
            return default
        value = self.require(key)
        if not isinstance(value, list) or not value:
            self.fail(key, f"must be a list of rows, not {value!r}")
        if rows is not None and len(value) != rows:
            self.fail(key, f"has {len(value)} rows, expected {rows}")
        width = columns if columns is not None else self._width(key, value[0])
        return np.array([self._row(key, f"row {i}", row, width)
                         for i, row in enumerate(value, start=1)])

    def matrix_or_diagonal(self, key: str, size: int) -> Array:
        """[size, size] finite numbers, given as rows or as the diagonal alone."""
        value = self.require(key)
        if isinstance(value, list) and value and all(is_number(item) for item in value):
            return np.diag(self._row(key, "", value, size))
        return self.matrix(key, size, size)

    def ranges(self, key: str, size: int) -> Array:
        """[size, 2] lower and upper limits; -inf and inf where there is none."""
        limits = np.tile([-np.inf, np.inf], (size, 1))
        if key not in self.raw:
            return limits
        value = self.raw[key]
        if not isinstance(value, list) or len(value) != size:
            self.fail(key, f"must be a list of {size} pairs [low, high], one per sensor")
        for i, pair in enumerate(value):
            sound = isinstance(pair, list) and len(pair) == 2 and all(map(self._is_limit, pair))
            if not sound or not pair[0] < pair[1]:
                self.fail(key, f"row {i + 1} must be a pair [low, high] with low < high, "
                               f"not {pair!r}")
            limits[i] = pair
        return limits

    @staticmethod
    def _is_limit(value: Any) -> bool:
        return is_number(value) and (is_finite(value) or value in (-math.inf, math.inf))

    def _strings(self, key: str, value: Any) -> list[str]:
        if not isinstance(value, list) or not all(isinstance(item, str) for item in value):
            self.fail(key, f"must be a list of names, not {value!r}")
        return list(value)

    def _width(self, key: str, row: Any) -> int:
        if not isinstance(row, list) or not row:
            self.fail(key, f"row 1 must be a list of numbers, not {row!r}")
        return len(row)

    def _row(self, key: str, place: str, row: Any, size: int) -> Array:
        name = f"{key} {place}".strip()
        if not isinstance(row, list):
            self.fail(name, f"must be a list of numbers, not {row!r}")
        if len(row) != size:
            self.fail(name, f"has {len(row)} numbers, expected {size}")
        for column, value in enumerate(row, start=1):
            entry = f"{name}, column {column}," if place else f"{name} entry {column}"
            if not is_number(value):
                self.fail(entry, f"must be a number, not {value!r}")
            if not is_finite(value):
                self.fail(entry, f"is {value}; it must be finite")
        return np.array(row, dtype=float)
