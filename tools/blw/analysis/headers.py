# SPDX-License-Identifier: MIT
"""Sizes of the library's structures on a 32-bit target and its BLW_..._MEM macros.

Both are read from the public headers, so that no formula exists twice.
"""

import ast
import re
from collections.abc import Callable
from functools import cache
from typing import Any

from blw.build import ROOT

HEADERS = ROOT / "lib" / "include" / "blw"

POINTER = 4
SCALARS = {"bool": 1, "uint8_t": 1, "uint16_t": 2, "uint32_t": 4, "uint64_t": 8, "size_t": 4,
           "blw_real_t": 4, "blw_mask_t": 8}

_COMMENT = re.compile(r"/\*.*?\*/", re.DOTALL)
_STRUCT = re.compile(r"typedef struct \w+ \{(.*?)\} (\w+);", re.DOTALL)
_MACRO = re.compile(r"#define (BLW_\w+)(?:\(([^)]*)\))?[ \t]+((?:.*\\\n)*.*)")
_MEMBER = re.compile(r"(?:const\s+)?(\w+)\s*(\*?)\s*(?:const\s+)?(\w+)(?:\[(\w+)\])?$")


@cache
def _source() -> str:
    texts = (path.read_text(encoding="utf-8") for path in sorted(HEADERS.glob("*.h")))
    return _COMMENT.sub(" ", "\n".join(texts))


@cache
def _structs() -> dict[str, str]:
    return {name: body for body, name in _STRUCT.findall(_source())}


@cache
def _macros() -> dict[str, tuple[list[str], str]]:
    return {name: ([part.strip() for part in arguments.split(",") if part.strip()], body)
            for name, arguments, body in _MACRO.findall(_source())}


def size_of(ctype: str) -> int:
    """Bytes of a scalar or structure of the library with 4-byte pointers and float numbers."""
    return _layout(ctype)[0]


@cache
def _layout(ctype: str) -> tuple[int, int]:
    """Size and alignment."""
    if ctype in SCALARS:
        return SCALARS[ctype], SCALARS[ctype]
    offset, widest = 0, 1
    for declaration in filter(None, map(str.strip, _structs()[ctype].split(";"))):
        kind, star, _, count = _MEMBER.match(" ".join(declaration.split())).groups()
        pointer = star or kind.endswith("_kernel_t")
        size, alignment = (POINTER, POINTER) if pointer else _layout(kind)
        offset = -(-offset // alignment) * alignment + size * (macro(count)() if count else 1)
        widest = max(widest, alignment)
    return -(-offset // widest) * widest, widest


def macro(name: str) -> Callable[..., int]:
    """A macro of the headers as a function of integers."""
    arguments, body = _macros()[name]
    text = re.sub(r"\(size_t\)|\\\n", " ", body)
    text = re.sub(r"\b(\d+)U\b", r"\1", text)
    tree = ast.parse(" ".join(_conditional(text).split()), mode="eval")
    used = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
    code = compile(tree, name, "eval")

    def evaluate(*values: int) -> int:
        known: dict[str, Any] = dict(zip(arguments, values, strict=True))
        known |= {other: macro(other) for other in used - set(arguments)}
        return int(eval(code, {"__builtins__": {}}, known))  # noqa: S307  our own headers

    return evaluate


def _conditional(text: str) -> str:
    """C's `c ? a : b` and `/` as Python's, inside out."""
    inner = re.compile(r"\(([^()]*)\)")
    kept: list[str] = []

    def fold(match: re.Match) -> str:
        kept.append(_flat(match[1]))
        return f"@{len(kept) - 1}@"

    while inner.search(text):
        text = inner.sub(fold, text)
    text = _flat(text)
    while "@" in text:
        text = re.sub(r"@(\d+)@", lambda match: f"({kept[int(match[1])]})", text)
    return text


def _flat(text: str) -> str:
    """An expression without parentheses."""
    text = text.replace("/", "//")
    if "?" not in text:
        return text
    condition, rest = text.split("?", 1)
    then, otherwise = rest.split(":", 1)
    return f"{then} if {condition} else {otherwise}"
