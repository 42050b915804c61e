# SPDX-License-Identifier: MIT
"""The library in builds that know nothing of ours: one header, a list of sources, no Python."""

import shutil
import subprocess

import pytest

STRICT = ["-O2", "-ffp-contract=off", "-Wall", "-Wextra", "-Wpedantic", "-Werror"]
COMPILERS = {"c": ["gcc", "-std=c99"], "c++": ["g++", "-std=c++11"]}


def compiled(*command, **options):
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True,
                          check=False, **options)
    assert done.returncode == 0, done.stderr


def source_list(root, tmp_path):
    """BLW_SOURCES as a foreign build would read it."""
    script = tmp_path / "print.cmake"
    script.write_text(f'include("{root}/lib/blw_sources.cmake")\nmessage("${{BLW_SOURCES}}")\n')
    done = subprocess.run(["cmake", "-P", script], capture_output=True, text=True, check=True)
    return done.stderr.strip().split(";")


@pytest.fixture(scope="module")
def header(bulwark, tmp_path_factory):
    """The amalgamation."""
    path = tmp_path_factory.mktemp("include") / "bulwark.h"
    done = bulwark("amalgamate", "--out", path)
    assert done.returncode == 0, done.stderr
    return path


@pytest.fixture(scope="module")
def library(header):
    """The one object that it takes."""
    source, path = header.with_name("library.c"), header.with_name("library.o")
    source.write_text("#define BLW_IMPLEMENTATION\n#include <bulwark.h>\n")
    compiled(*COMPILERS["c"], *STRICT, "-I", header.parent, "-c", source, "-o", path)
    return path


@pytest.mark.parametrize("language, main", [("c", "main.c"), ("c++", "main.cpp")])
def test_amalgamation_given_a_consumer_builds_and_runs(root, library, tmp_path, language, main):
    consumer = root / "tests" / "install" / "consumer" / main
    compiled(*COMPILERS[language], *STRICT, "-I", library.parent, consumer, library, "-lm", "-o",
             tmp_path / "consumer")
    assert subprocess.call([tmp_path / "consumer"]) == 0


def test_amalgamation_given_a_generated_model_builds_firmware_from_both(root, library, tmp_path):
    """The model, as it is, knows the library's headers by their own names."""
    models = root / "lib" / "models"
    compiled(*COMPILERS["c"], *STRICT, "-I", library.parent, "-I", models, library,
             models / "pendulum_physical_model.c", root / "port" / "firmware" / "bare.c", "-lm",
             "-o", tmp_path / "firmware")
    assert subprocess.call([tmp_path / "firmware"]) == 0


def test_amalgamation_given_every_public_symbol_has_it(root, library, tmp_path):
    parts = []
    for source in source_list(root, tmp_path):
        parts.append(tmp_path / (source.rsplit("/", 1)[1] + ".o"))
        compiled("gcc", "-std=c99", "-ffp-contract=off", "-I", root / "lib" / "include", "-c",
                 source, "-o", parts[-1])
    assert symbols(library) == set().union(*map(symbols, parts))


def symbols(path):
    done = subprocess.run(["nm", "--defined-only", "--extern-only", path], capture_output=True,
                          text=True, check=True)
    return {line.split()[-1] for line in done.stdout.splitlines()}


def test_source_list_given_a_plain_compiler_builds_firmware_without_python(root, tmp_path):
    """Committed model, library and the loop of port/firmware: a compiler is all it takes."""
    sources = source_list(root, tmp_path)
    assert {source.rsplit("/", 1)[1] for source in sources} == {
        path.name for path in (root / "lib" / "src").glob("*.c")}
    tools = tmp_path / "bin"
    tools.mkdir()
    for name in ("gcc", "as", "ld"):
        (tools / name).symlink_to(shutil.which(name))
    compiled(tools / "gcc", "-std=c99", *STRICT, "-I", root / "lib" / "include", "-I",
             root / "lib" / "src", "-I", root / "lib" / "models", *sources,
             root / "lib" / "models" / "pendulum_physical_model.c",
             root / "port" / "firmware" / "bare.c", "-lm", "-o", tmp_path / "firmware",
             env={"PATH": str(tools)})
    assert subprocess.call([tmp_path / "firmware"]) == 0
