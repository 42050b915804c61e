# SPDX-License-Identifier: MIT
"""One description of every constant table, from which both the C source and the JSON come.

A Struct stands for one const C object.  Its members, in the order of the C declaration, are

    int             an integer member
    real(x)         a blw_real_t member
    table(array)    a pointer to const blw_real_t, row-major
    index(array)    a pointer to a const integer table
    Struct          a pointer to a const object
    [Struct, ...]   a pointer to a const array of objects of one type
    Code            a pointer to a function written for this design; C source only, NULL in JSON
    None            NULL

Numbers below the smallest normal float32 in magnitude are stored as zero, so that one table serves
both widths of blw_real_t.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from blw.errors import DesignError

FLOAT32 = np.finfo(np.float32)
_INTEGER_TYPES = {"uint8_t": 2**8, "uint16_t": 2**16, "uint32_t": 2**32}


@dataclass(frozen=True, eq=False)
class Real:
    """A blw_real_t that a structure holds itself."""

    value: float


@dataclass(frozen=True, eq=False)
class Table:
    """A const array of blw_real_t; the shape is kept for the layout of the C source only."""

    array: NDArray[np.float64]
    comment: str = ""


@dataclass(frozen=True, eq=False)
class Index:
    """A const array of integers of the C type ctype."""

    array: NDArray[np.int64]
    comment: str = ""
    ctype: str = "uint16_t"


@dataclass(frozen=True, eq=False)
class Code:
    """A static C function: result and parameters of its type, lines of its body."""

    result: str
    parameters: str
    body: tuple[str, ...]
    comment: str


@dataclass(frozen=True, eq=False)
class Link:
    """The address of a const object of the library; JSON knows it by its short name."""

    symbol: str
    name: str


def real(x: float) -> Real:
    """A scalar blw_real_t member."""
    return Real(float(_flush(np.asarray(x, dtype=float))))


def table(array: ArrayLike, comment: str = "") -> Table | None:
    """A table of blw_real_t; comment states dimensions, unit and meaning.  Empty: NULL."""
    values = _flush(np.array(array, dtype=float))
    return Table(values, comment) if values.size else None


def index(array: ArrayLike, comment: str = "", ctype: str = "uint16_t") -> Index | None:
    """A table of integers of an unsigned C type; empty: NULL.  Raises ValueError out of range."""
    values = np.array(array)
    if not values.size:
        return None
    if not np.issubdtype(values.dtype, np.integer):
        raise ValueError(f"index table '{comment}' is not made of integers")
    if values.min() < 0 or values.max() >= _INTEGER_TYPES[ctype]:
        raise ValueError(f"index table '{comment}' does not fit {ctype}")
    return Index(values.astype(np.int64), comment, ctype)


Member = Union[int, Real, Table, Index, Code, Link, None, "Struct", list["Struct"]]


@dataclass(frozen=True, eq=False)
class Struct:
    """One const C object.

    ctype   its C type, e.g. "blw_kalman_model_t"
    suffix  ends its name: blw_<model>_<suffix>
    members C member name -> value, in the order of the C declaration, without `head`
    method  set for the model of a method: the object starts with `blw_model_t head`
    """

    ctype: str
    suffix: str
    members: Mapping[str, Member]
    method: str | None = None

    def to_json(self) -> dict[str, Any]:
        """Members by name: numbers, flat lists, objects, lists of objects, null."""
        return {name: _member_json(value) for name, value in self.members.items()}

    def reals(self) -> Iterator[NDArray[np.float64]]:
        """All real data in member order, depth first, flat: the walk of the checksum."""
        for _, values in self.named_reals(self.suffix):
            yield values

    def named_reals(self, path: str) -> Iterator[tuple[str, NDArray[np.float64]]]:
        """As reals(), each with the dotted path of its member below `path`."""
        for name, value in self.members.items():
            yield from _walk(f"{path}.{name}", value)

    def bare(self) -> "Struct":
        """The same without straight-line code: the loops of the library do what it did."""
        return Struct(self.ctype, self.suffix,
                      {name: _bare(value) for name, value in self.members.items()}, self.method)

    def check(self) -> None:
        """Raise DesignError naming the first number that is not finite or overflows float32."""
        for path, values in self.named_reals(self.suffix):
            bad = np.flatnonzero(~(np.abs(values) <= float(FLOAT32.max)))
            if bad.size:
                entry = f"{path}[{bad[0]}]" if values.size > 1 else path
                raise DesignError(f"table {entry} = {values[bad[0]]:.6g} does not fit float32; "
                                  "scale the units of the model")


def _bare(value: Member) -> Member:
    if isinstance(value, list):
        return [item.bare() for item in value]
    if isinstance(value, Struct):
        only_code = all(isinstance(member, Code) for member in value.members.values())
        return None if only_code else value.bare()
    return None if isinstance(value, Code) else value


def _flush(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Exact zeros instead of -0 and of numbers that float32 cannot hold at full precision."""
    return np.where(np.abs(values) < float(FLOAT32.tiny), 0.0, values)


def _member_json(value: Member) -> Any:
    if isinstance(value, Struct):
        return value.to_json()
    if isinstance(value, list):
        return [item.to_json() for item in value]
    if isinstance(value, Real):
        return value.value
    if isinstance(value, (Table, Index)):
        return value.array.ravel().tolist()
    if isinstance(value, Link):
        return value.name
    return None if value is None or isinstance(value, Code) else int(value)


def _walk(path: str, value: Member) -> Iterator[tuple[str, NDArray[np.float64]]]:
    if isinstance(value, Struct):
        yield from value.named_reals(path)
    elif isinstance(value, list):
        for number, item in enumerate(value):
            yield from item.named_reals(f"{path}[{number}]")
    elif isinstance(value, Real):
        yield path, np.array([value.value])
    elif isinstance(value, Table):
        yield path, value.array.ravel()
