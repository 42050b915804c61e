# SPDX-License-Identifier: MIT
"""`bulwark amalgamate`: the whole library as one header file.

Like other single-header libraries: every file that uses it includes the header, and exactly one
defines BLW_IMPLEMENTATION before it.  Generated models include the library's headers by their own
names, so beside the one header stands the folder blw/ with those names, each a line that includes
the one.  Static functions of different files may share a name; each file's names get the file's own
name behind them.
"""

import re
from collections.abc import Iterator
from pathlib import Path

import click

import blw
from blw.atomic import write_files
from blw.build import ROOT

LIB = ROOT / "lib"
SWITCH = "BLW_IMPLEMENTATION"

_INCLUDE = re.compile(r'^#include "([^"]+)"\n', re.MULTILINE)
_SPDX = "/* SPDX-License-Identifier: MIT */\n"
_SOURCE = re.compile(r"\$\{CMAKE_CURRENT_LIST_DIR\}/src/(\S+\.c)")
_STATIC = re.compile(r"^static (?!inline)[^;={(]*?\b(\w+)(?=\(|\[| =|;)", re.MULTILINE)
_MACRO = re.compile(r"^#define (\w+)", re.MULTILINE)
_ENUM = re.compile(r"^enum \{([^}]*)\}", re.MULTILINE)
_TYPE = re.compile(r"^\} (\w+);", re.MULTILINE)
_TAG = re.compile(r"^(?:typedef )?(?:struct|enum|union) (\w+) \{", re.MULTILINE)


@click.command(short_help="The library as one header file.")
@click.option("--out", required=True, type=click.Path(path_type=Path, dir_okay=False),
              help="The header to write.")
def amalgamate(out: Path) -> None:
    """Write the library as a single header.

    Define BLW_IMPLEMENTATION in one source file before including it, and compile that file with
    -ffp-contract=off.  The folder blw/ beside it only lets generated models include it under the
    names they know.
    """
    write_files(out.parent / "blw", {name.removeprefix("blw/"): forward(out.name)
                                     for name in headers()})
    write_files(out.parent, {out.name: text()})
    click.echo(f"wrote {out}")


def forward(name: str) -> str:
    """A header in blw/ that stands for the one called `name`, a folder above."""
    return f'{_SPDX}#include "../{name}"\n'


def headers() -> list[str]:
    """The names of the public headers, as they are included."""
    return sorted(f"blw/{path.name}" for path in (LIB / "include" / "blw").glob("*.h"))


def text() -> str:
    """The header."""
    taken: set[str] = set()
    public = "".join(_headers(headers(), taken))
    private = "".join(_source(name, taken) for name in sources())
    return "\n".join([
        _SPDX.rstrip(),
        f"/* Bulwark {blw.__version__}, made by tools/bulwark amalgamate.  Do not edit.",
        f" * One source file defines {SWITCH} before it includes this one. */",
        "#ifndef BLW_AMALGAMATION_H", "#define BLW_AMALGAMATION_H",
        public + "#endif", "",
        f"#if defined({SWITCH}) && !defined(BLW_IMPLEMENTED)", "#define BLW_IMPLEMENTED",
        private + "#endif", ""])


def sources() -> list[str]:
    """The names of the library's sources, in the order of lib/blw_sources.cmake."""
    return _SOURCE.findall((LIB / "blw_sources.cmake").read_text(encoding="utf-8"))


def _headers(names: list[str], taken: set[str]) -> Iterator[str]:
    """The headers and what they include, each once, what is included first."""
    for name in names:
        if name in taken:
            continue
        taken.add(name)
        content = _read(name)
        yield from _headers(_INCLUDE.findall(content), taken)
        yield f"/* {name} */\n" + _INCLUDE.sub("", content).removeprefix(_SPDX)


def _source(name: str, taken: set[str]) -> str:
    """A source after the private headers that it is the first to need; its own names made unique,
    its macros ended."""
    content = (LIB / "src" / name).read_text(encoding="utf-8")
    before = "".join(_headers(_INCLUDE.findall(content), taken))
    body = _INCLUDE.sub("", content).removeprefix(_SPDX)
    own = {*_STATIC.findall(body), *_TYPE.findall(body), *_TAG.findall(body), *_enumerators(body)}
    if own:  # not members, though they may be called the same
        words = re.compile(rf"(?<![\w.])(?<!->)({'|'.join(sorted(own))})\b")
        body = words.sub(rf"\1_{name.removesuffix('.c')}", body)
    ends = "".join(f"#undef {macro}\n" for macro in sorted(set(_MACRO.findall(body))))
    return before + f"/* {name} */\n" + body + ends


def _enumerators(content: str) -> set[str]:
    return {word for body in _ENUM.findall(content) for word in re.findall(r"\b([A-Z]\w*)\b", body)}


def _read(name: str) -> str:
    folder = LIB / ("include" if name.startswith("blw/") else "src")
    return (folder / name).read_text(encoding="utf-8")
