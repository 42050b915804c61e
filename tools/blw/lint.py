# SPDX-License-Identifier: MIT
"""Checks of the sources themselves: format, static analysis, shell scripts."""

import json
import os
import re
import subprocess
import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import click

from blw.build import BUILD, ROOT, build_programs, configure
from blw.tally import Tally

LLVM = "14"  # Debian 12's; another version formats differently
CPPCHECK = ("cppcheck", "--quiet", "--std=c99", f"-j{os.cpu_count()}")
SHELL = ("tools/bulwark", "tools/setup/setup.sh", "tools/check_archive.sh", ".ci/run",
         "tests/archive/test_check_archive.sh", "tests/bus/in_netns.sh", "tests/bus/in_uml.sh")


def run() -> Tally:
    """Run every check; prints what they find."""
    database = configure("clang-f32")
    build_programs("clang-f32", ["blw_port_posix"])  # it makes the headers of LCM's messages
    library = _sources("lib/src", ".c")
    port = _sources("port/src", ".c") + _compiled("port/posix", database)
    written = (_sources("lib/include", ".h") + _sources("lib/src", ".c", ".h")
               + _sources("port", ".c", ".h") + _sources("host_sim", ".cpp", ".h")
               + _sources("tests", ".c", ".h", ".cpp", ".hpp"))
    commands = {
        "clang-format": [[f"clang-format-{LLVM}", "--dry-run", "-Werror", *written]],
        "clang-tidy": [[f"clang-tidy-{LLVM}", "--quiet", "-p", str(database), source]
                       for source in library + port],
        "cppcheck": [[*CPPCHECK, "--inline-suppr", "--error-exitcode=1",
                      "--enable=warning,performance,portability", "-Ilib/include", "-Ilib/src",
                      "-Iport/include", "-Iport/posix", *library, *port]],
        "shellcheck": [["shellcheck", "--external-sources", *SHELL]],
        "ruff": [[sys.executable, "-m", "ruff", "check", "--quiet", "tools", "tests"]],
    }
    checked = sum((_check(name, each) for name, each in commands.items()), Tally())
    return checked + _misra(library)


def _compiled(folder: str, database: Path) -> list[str]:
    """The sources that are part of a build: without LCM, its back end is not."""
    entries = json.loads((database / "compile_commands.json").read_text("utf-8"))
    built = {Path(entry["file"]) for entry in entries}
    return [source for source in _sources(folder, ".c") if ROOT / source in built]


def _sources(folder: str, *suffixes: str) -> list[str]:
    found = (ROOT / folder).rglob("*")
    return sorted(str(path.relative_to(ROOT)) for path in found if path.suffix in suffixes)


def _check(name: str, commands: Sequence[Sequence[str]]) -> Tally:
    """One check, which may be several commands; what the failed ones printed is printed."""
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        results = list(pool.map(_call, commands))
    failed = [result for result in results if result.returncode != 0]
    for result in failed:
        click.echo(result.stdout.rstrip(), err=True)
    if failed:
        click.echo(f"bulwark: {name} found something", err=True)
    return Tally.of(not failed)


def _misra(library: Sequence[str]) -> Tally:
    """Hold the ledger of deviations in README.md against what cppcheck finds in the library."""
    scratch = BUILD / "cppcheck"  # else its files land beside the sources
    scratch.mkdir(exist_ok=True)
    found = _call([*CPPCHECK, "--addon=misra", "-Ilib/include", "-Ilib/src",
                   f"--cppcheck-build-dir={scratch}", *library]).stdout
    broken = set(re.findall(r"misra-c2012-([\d.]+)", found))
    rows = re.findall(r"^\| D-\d+ \| ([\d., ]+) \|", (ROOT / "README.md").read_text("utf-8"), re.M)
    listed = {rule for row in rows for rule in row.split(", ")}
    for rule in sorted(broken - listed):
        places = "\n".join(line for line in found.splitlines() if line.endswith(f"c2012-{rule}]"))
        click.echo(f"{places}\nbulwark: MISRA rule {rule} is broken and not in README.md", err=True)
    for rule in sorted(listed - broken):
        click.echo(f"bulwark: MISRA rule {rule} is in README.md but not broken", err=True)
    return Tally.of(broken == listed)


def _call(command: Sequence[str]) -> subprocess.CompletedProcess:
    try:
        return subprocess.run(command, cwd=ROOT, check=False, text=True,
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    except FileNotFoundError:
        return subprocess.CompletedProcess(command, 127, f"{command[0]} is not installed")
