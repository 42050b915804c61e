# SPDX-License-Identifier: MIT
"""Names of models (C identifiers) and of states, sensors and inputs (columns, C enumerators)."""

import re
from collections.abc import Iterable
from typing import Any

from blw.errors import ModelError
from blw.options import suggestion

C_KEYWORDS = frozenset(
    "auto break case char const continue default do double else enum extern float for goto if "
    "inline int long register restrict return short signed sizeof static struct switch typedef "
    "union unsigned void volatile while".split())

# Columns of the logs and of the estimates that are not signals.
RESERVED = frozenset("k t_s status statistic threshold iterations bound excluded".split())

_IDENTIFIER = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,30}")
_LABEL = re.compile(r"[!-~](?:[ -~]*[!-~])?")
_UNIT = re.compile(r"_((?:[munk]?(?:m|s|g|V|A|N|W|J|F|H|Pa|Hz|bar|mol)|rad|deg|Nm|K|C|Ohm|T|lx"
                   r"|pct|rpm))(?:_((?:m|u)?s|h|min|m)([234]?))?$")


def check_model_name(name: Any, where: str) -> str:
    """The name if it is a C identifier of at most 31 characters and no keyword, else ModelError."""
    if not isinstance(name, str) or not _IDENTIFIER.fullmatch(name):
        raise ModelError(f"{where}: name must be a C identifier of at most 31 letters, digits and "
                         f"underscores that starts with a letter, not {name!r}")
    if name in C_KEYWORDS:
        raise ModelError(f"{where}: name '{name}' is a keyword of C")
    return name


def enumerator(label: str) -> str:
    """The label as it appears in C: upper case, everything else than [A-Z0-9] one underscore."""
    return re.sub(r"[^A-Z0-9]+", "_", label.upper()).strip("_")


def unit(label: str) -> str:
    """The unit that ends a label, "angle_rad_s" -> "rad/s"; empty if none is recognised."""
    match = _UNIT.search(label)
    if not match:
        return ""
    above, below, power = match.groups()
    return f"{above}/{below}{power}" if below else above


def check_labels(labels: list[str], where: str) -> None:
    """Raise ModelError unless the labels can be columns of a log and distinct C enumerators."""
    seen: dict[str, str] = {}
    for label in labels:
        if not _LABEL.fullmatch(label) or re.search("[,;:\"']", label):
            raise ModelError(f"{where}: {label!r} must be printable ASCII, not empty, without "
                             "comma, colon, semicolon, quotes and outer spaces")
        if label in RESERVED:
            raise ModelError(f"{where}: '{label}' is the name of another column of the logs")
        name = enumerator(label)
        if not name:
            raise ModelError(f"{where}: '{label}' has no letter or digit to make a C name from")
        if name in seen:
            same = "is given twice" if seen[name] == label else \
                f"and '{seen[name]}' have the same C name {name}"
            raise ModelError(f"{where}: '{label}' {same}")
        seen[name] = label


def check_known(given: Iterable[str], sensors: list[str], where: str) -> None:
    """Raise ModelError if one of the given names is no sensor or is there twice."""
    seen = set()
    for name in given:
        if name not in sensors:
            raise ModelError(f"{where} names '{name}', which is no sensor; "
                             f"{suggestion(name, sensors)}")
        if name in seen:
            raise ModelError(f"{where} names '{name}' twice")
        seen.add(name)
