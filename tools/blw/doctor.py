# SPDX-License-Identifier: MIT
"""`bulwark doctor`: what is installed and what is missing."""

import platform
import re
import shutil
import subprocess
from importlib import metadata

import click

import blw
from blw.build import BUILD, ROOT
from blw.design import json_text
from blw.methods import REGISTRY

PACKAGES = ROOT / "tools" / "setup" / "packages"
REQUIREMENTS = ROOT / "tools" / "requirements.in"
UNITY = "unity (from the source package ntpsec)"


@click.command()
@click.option("--json", "as_json", is_flag=True, help="Print it as JSON.")
def doctor(as_json: bool) -> None:
    """Tell which methods, programs and libraries are here and which are missing."""
    packages = _packages()
    versions = {"bulwark": blw.__version__, "python": platform.python_version(),
                **_distributions(), **_installed(packages)}
    missing = [name for name in packages if name not in versions]
    if not (BUILD / "unity" / "unity.c").is_file():
        missing.append(UNITY)
    if as_json:
        click.echo(json_text({"methods": list(REGISTRY), "versions": versions,
                              "missing": missing}), nl=False)
        return
    click.echo("methods: " + ", ".join(REGISTRY))
    for name, version in versions.items():
        click.echo(f"  {name:<24} {version}")
    for name in missing:
        click.echo(f"  {name:<24} missing: for {packages.get(name, 'test')}")
    if missing:
        click.echo("The commands that need what is missing install it.")


def _packages() -> dict[str, str]:
    """Debian package -> what it is for (a group of tools/setup/packages)."""
    lines = PACKAGES.read_text(encoding="utf-8").splitlines()
    pairs = (line.split() for line in lines if line and not line.startswith("#"))
    return {name: group for group, name in pairs}


def _installed(packages: dict[str, str]) -> dict[str, str]:
    """Version of each Debian package that is installed; nothing on other systems."""
    if shutil.which("dpkg-query") is None:
        return {}
    form = "${db:Status-Status} ${Package} ${Version}\n"
    query = subprocess.run(["dpkg-query", "-W", "-f", form, *packages], check=False, text=True,
                           stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    rows = (line.split(" ") for line in query.stdout.splitlines())
    return {name: version for status, name, version in rows if status == "installed"}


def _distributions() -> dict[str, str]:
    """Version of each Python package that the tools ask for."""
    names = re.findall(r"^[a-z][\w-]*", REQUIREMENTS.read_text(encoding="utf-8"), re.MULTILINE)
    return {name: metadata.version(name) for name in names}
