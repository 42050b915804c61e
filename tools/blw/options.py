# SPDX-License-Identifier: MIT
"""Tables of options ([method.lasso] and the like) checked against a dataclass.

A method declares its options as a dataclass with defaults; the annotations drive the checks:
int, float, bool, str, Literal[...], list[...], tuple[...], unions and None are understood.  A float
accepts an integer; no number may be NaN or infinite.  Bounds come from the field's metadata:

    gamma: float | None = field(default=None, metadata={"gt": 0})

with the keys gt, ge, lt and le.
"""

import dataclasses
import difflib
import operator
import sys
import types
import typing
from collections.abc import Iterable, Mapping
from typing import Any, TypeVar

from blw.errors import ModelError

T = TypeVar("T")

_BOUNDS = {
    "gt": (operator.gt, "greater than"),
    "ge": (operator.ge, "at least"),
    "lt": (operator.lt, "less than"),
    "le": (operator.le, "at most"),
}


def suggestion(word: str, known: Iterable[str]) -> str:
    """A hint for an unknown word: the closest known one, or all of them if none is close."""
    choices = list(known)
    folded = {choice.lower(): choice for choice in choices}
    close = difflib.get_close_matches(word.lower(), folded, n=1, cutoff=0.6)
    if close:
        return f"did you mean '{folded[close[0]]}'?"
    return "known: " + ", ".join(choices) if choices else "none is known here"


def check_keys(raw: Mapping[str, Any], known: Iterable[str], where: str) -> None:
    """Raise ModelError for the first key of raw that is not known; where names the table."""
    known = list(known)
    for key in raw:
        if key not in known:
            raise ModelError(f"{where}: unknown key '{key}'; {suggestion(key, known)}")


def parse(options: type[T], raw: Mapping[str, Any], where: str) -> T:
    """Build the dataclass `options` from the table raw.

    where names the table in messages, e.g. "pendulum.toml: method.lasso".
    Raises ModelError for an unknown key, a wrong type, or a value out of its bounds.
    """
    if not isinstance(raw, Mapping):
        raise ModelError(f"{where} must be a table of options")
    hints = typing.get_type_hints(options)
    fields = {field.name: field for field in dataclasses.fields(options)}
    check_keys(raw, fields, where)
    values = {}
    for key, value in raw.items():
        place = f"{where}.{key}"
        values[key] = _convert(hints[key], value, place)
        _check_bounds(values[key], fields[key].metadata, place)
    return options(**values)


def describe(hint: Any) -> str:
    """A type annotation in words, for messages."""
    origin, args = typing.get_origin(hint), typing.get_args(hint)
    if origin is typing.Literal:
        return " or ".join(f"'{arg}'" if isinstance(arg, str) else str(arg) for arg in args)
    if origin in (typing.Union, types.UnionType):
        return " or ".join(describe(arg) for arg in args if arg is not types.NoneType)
    if (origin or hint) in (list, tuple):
        inner = [arg for arg in args if arg is not Ellipsis]
        return "a list" + (f" of ({describe(inner[0])})" if len(set(inner)) == 1 else "")
    words = {int: "an integer", float: "a finite number", bool: "true or false", str: "a string"}
    return words.get(hint, str(hint))


class _Mismatch(Exception):
    """The value is not of the type; used to try the members of a union in turn."""


def _convert(hint: Any, value: Any, place: str) -> Any:
    try:
        return _match(hint, value)
    except _Mismatch:
        raise ModelError(f"{place} must be {describe(hint)}, not {value!r}") from None


def _match(hint: Any, value: Any) -> Any:
    origin, args = typing.get_origin(hint), typing.get_args(hint)
    if hint is Any:
        return value
    if origin in (typing.Union, types.UnionType):
        return _match_union(args, value)
    if origin is typing.Literal:
        return _require(any(value == a and type(value) is type(a) for a in args), value)
    if (origin or hint) in (list, tuple):
        return _match_sequence(origin or hint, args, value)
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if hint is float:
        return float(_require(is_number and abs(value) <= sys.float_info.max, value))
    if hint is int:
        return _require(is_number and isinstance(value, int), value)
    return _require(isinstance(value, hint), value)


def _match_union(args: tuple[Any, ...], value: Any) -> Any:
    for arg in args:
        try:
            return _match(arg, value)
        except _Mismatch:
            continue
    raise _Mismatch


def _match_sequence(kind: type, args: tuple[Any, ...], value: Any) -> Any:
    _require(isinstance(value, (list, tuple)), value)
    if not args:
        return kind(value)
    if kind is list or Ellipsis in args:
        return kind(_match(args[0], item) for item in value)
    _require(len(args) == len(value), value)
    return tuple(_match(arg, item) for arg, item in zip(args, value, strict=True))


def _require(condition: bool, value: Any) -> Any:
    if not condition:
        raise _Mismatch
    return value


def _check_bounds(value: Any, metadata: Mapping[str, Any], place: str) -> None:
    if isinstance(value, (list, tuple)):
        for number, item in enumerate(value, start=1):
            _check_bounds(item, metadata, f"{place}, entry {number},")
        return
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return
    for key, (holds, words) in _BOUNDS.items():
        if key in metadata and not holds(value, metadata[key]):
            raise ModelError(f"{place} must be {words} {metadata[key]}, not {value!r}")
