# SPDX-License-Identifier: MIT
"""The generated C: compiled as C99 and C++, as float and double, and held against the JSON."""

import re
import shutil
import subprocess
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from blw import design, emit_c, model
from blw.tables import Struct, index, real, table

ROOT = Path(__file__).resolve().parents[2]
MODELS = ROOT / "host_sim" / "models"
INCLUDE = ROOT / "lib" / "include"

WARNINGS = """-Wall -Wextra -Wpedantic -Wconversion -Wsign-conversion -Wdouble-promotion
    -Wfloat-equal -Wshadow -Wundef -Wcast-align -Wcast-qual -Wswitch-enum -Wvla -Werror""".split()
C_WARNINGS = ["-Wstrict-prototypes", "-Wmissing-prototypes"]
WIDTHS = {"f32": [], "f64": ["-DBLW_REAL_DOUBLE"]}
C_COMPILERS = ["gcc", "clang-14"]
CXX_COMPILERS = ["g++", "clang++-14"]

# Tables alone, without the library: what the compiler made of them, for a comparison bit by bit.
PRINT = r"""
#include <stdio.h>
#include "NAME_model.h"
int main(void)
{
    const blw_plant_t *const plant = blw_NAME_kalman.head.plant;
    printf("%u %u %u %u %08x\n", plant->n, plant->m, plant->l, plant->p,
           (unsigned)blw_NAME_kalman.head.crc);
    for (size_t i = 0U; i < (size_t)NAME_UPPER_N * NAME_UPPER_M; i++) {
        printf("%a\n", (double)blw_NAME_kalman.K[i]);
    }
    return 0;
}
"""


TYPES = """
#include <stddef.h>
#include <stdint.h>
typedef float blw_real_t;
#define BLW_R(x) x##F
typedef struct { unsigned n; const blw_real_t *K; } leaf_t;
typedef struct { const leaf_t *leaf; const leaf_t *many; blw_real_t rho; const uint16_t *first;
                 int offset; } blw_plant_t;
extern const blw_plant_t blw_liu5_plant;
"""


def designed(name: str) -> design.Design:
    return design.design_all(model.load(MODELS / f"{name}.toml"), ["kalman"])


def write(folder: Path, made: design.Design) -> str:
    for file, text in emit_c.files(made).items():
        (folder / file).write_text(text)
    return made.model.name


def run(*command: object) -> str:
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert not done.stderr
    return done.stdout


def need(compiler: str) -> str:
    if shutil.which(compiler) is None:
        pytest.skip(f"{compiler} is not installed")
    return compiler


@pytest.fixture(scope="module")
def everything(tmp_path_factory) -> tuple[Path, design.Design]:
    """A folder with the C files of a model, by every method that accepts it, and its design."""
    folder = tmp_path_factory.mktemp("generated")
    made = design.design_all(model.load(MODELS / "pendulum.toml"))
    write(folder, made)
    return folder, made


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("compiler", C_COMPILERS)
def test_files_given_all_methods_compile_as_c99_without_warning(everything, compiler, width):
    folder, made = everything
    run(need(compiler), "-std=c99", *WARNINGS, *C_WARNINGS, *WIDTHS[width], f"-I{INCLUDE}",
        "-c", folder / f"{made.model.name}_model.c", "-o", folder / "model.o")


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("compiler", CXX_COMPILERS)
def test_files_given_all_methods_compile_as_cxx_without_warning(everything, compiler, width):
    folder, made = everything
    header = folder / "header.cpp"
    header.write_text(f'#include "{made.model.name}_model.h"\n')
    common = [*WARNINGS, *WIDTHS[width], f"-I{INCLUDE}", f"-I{folder}", "-fsyntax-only"]
    run(need(compiler), "-std=c++11", *common, header)
    run(need(compiler), "-std=c++20", *common, "-x", "c++", folder / f"{made.model.name}_model.c")


@pytest.mark.parametrize("width", WIDTHS)
def test_source_given_tables_compiles_to_the_same_numbers(tmp_path, width):
    made = designed("torsion")
    name = write(tmp_path, made)
    main = tmp_path / "main.c"
    main.write_text(PRINT.replace("NAME_UPPER", name.upper()).replace("NAME", name))
    run(need("gcc"), "-std=c99", *WIDTHS[width], f"-I{INCLUDE}", tmp_path / f"{name}_model.c",
        main, "-o", tmp_path / "main")
    sizes, *numbers = run(tmp_path / "main").split("\n")[:-1]
    dtype = np.float32 if width == "f32" else np.float64
    expected = made.methods["kalman"].tables.members["K"].array.astype(dtype).ravel()
    np.testing.assert_array_equal([float.fromhex(text) for text in numbers], expected)
    crc = emit_c.checksum((made.plant, made.methods["kalman"].tables), np.dtype(dtype).str)
    assert sizes == f"6 5 1 1 {crc:08x}"


def archive(folder: Path, flags: list[str]) -> Path:
    """The library, compiled into folder."""
    folder.mkdir()
    for source in (ROOT / "lib" / "src").glob("*.c"):
        run(need("gcc"), *flags, "-c", source, "-o", folder / f"{source.stem}.o")
    run("ar", "rcs", folder / "libblw.a", *folder.glob("*.o"))
    return folder / "libblw.a"


def init_call(name: str, method: str, made: design.Designed) -> str:
    owner = made.tables.ctype.removesuffix("_model_t")
    macro = f"BLW_{name}_{method}".upper()
    return (f"status[{method}] = {owner}_init(&est_{method}, &blw_{name}_{made.tables.suffix},"
            f" est_{method}_mem, {macro}_MEM);")


@pytest.mark.parametrize("width", WIDTHS)
def test_storage_given_every_method_is_accepted_by_the_library(everything, width):
    folder, made = everything
    name, methods = made.model.name, made.methods
    main = folder / "main.c"
    main.write_text("\n".join([
        f'#include <stdio.h>\n#include "{name}_model.h"',
        *(f"BLW_{name.upper()}_{method.upper()}_STORAGE(est_{method});" for method in methods),
        "enum {" + ", ".join(methods) + "};",
        f"int main(void)\n{{\nint status[{len(methods)}];",
        *(init_call(name, method, item) for method, item in methods.items()),
        *(f'printf("{method} %d\\n", status[{method}]);' for method in methods),
        "return 0;\n}\n"]))
    flags = ["-std=c99", "-ffp-contract=off", *WIDTHS[width], f"-I{INCLUDE}"]
    program = folder / f"main_{width}"
    run(need("gcc"), *flags, folder / f"{name}_model.c", main, archive(folder / width, flags),
        "-lm", "-o", program)
    assert run(program).split("\n")[:-1] == [f"{method} 0" for method in methods]


def test_header_given_pendulum_names_everything_for_the_firmware_author():
    text = emit_c.header(designed("pendulum"))
    for line in ("PENDULUM_X_ANGLE_RAD   = 2, /**< angle_rad, in rad */",
                 "PENDULUM_X_ANGLE_RAD_S = 3 /**< angle_rad_s, in rad/s */",
                 "PENDULUM_Y_CART1 = 0, /**< cart1 */",
                 "PENDULUM_U_FORCE_N = 0 /**< force_N, in N */",
                 "#define PENDULUM_N 4U /**< states */",
                 "extern const blw_plant_t blw_pendulum_plant;",
                 "extern const blw_kalman_model_t blw_pendulum_kalman;",
                 "#define BLW_PENDULUM_KALMAN_MEM BLW_KALMAN_MEM(4U, 4U)",
                 "#define BLW_PENDULUM_KALMAN_STORAGE(name) \\"):
        assert line in text


def test_files_given_same_model_twice_are_identical_and_undated():
    first, second = (emit_c.files(designed("liu5")) for _ in range(2))
    assert first == second
    assert not re.search(r"20\d\d", first["liu5_model.c"].split("\n", 3)[1])
    assert "sha256 " + designed("liu5").model.sha256[:12] in first["liu5_model.h"]


def test_files_given_any_model_keep_the_line_width():
    for text in emit_c.files(designed("torsion")).values():
        assert max(map(len, text.splitlines())) <= emit_c.WIDTH


def test_source_given_nested_structs_defines_what_they_point_to_first(tmp_path):
    leaves = [Struct("leaf_t", "leaf", {"n": 2, "K": table([1.0, 2.0], "gain */ of /* one")}),
              Struct("leaf_t", "leaf", {"n": 0, "K": None})]
    top = Struct("blw_plant_t", "plant", {
        "leaf": leaves[0], "many": leaves, "rho": real(0.5), "first": index([0, 3], "rows"),
        "offset": -3})
    text = emit_c.source(design.Design(model.load(MODELS / "liu5.toml"), top, {}))
    (tmp_path / "liu5_model.h").write_text(TYPES)
    (tmp_path / "nested.c").write_text(text)
    run(need("gcc"), "-std=c99", *WARNINGS, "-c", tmp_path / "nested.c", "-o", tmp_path / "n.o")


def nearest_float32(text: str) -> np.float32:
    """Correctly rounded, ties to even: what a C compiler makes of the decimal with suffix F."""
    exact = Fraction(text)
    guess = np.float32(float(exact))
    near = [guess, *(np.nextafter(guess, np.float32(end)) for end in (-np.inf, np.inf))]
    return min(near, key=lambda f: (abs(Fraction(float(f)) - exact), int(f.view(np.uint32)) & 1))


@pytest.mark.parametrize("x", [
    0.0, 1.0, -1.5, 0.1, 1e-5, 1e22, 3.4e38, 1.17549436e-38,
    1 + 2**-24,                # half-way, its 17 digits lie above
    1 + 3 * 2**-24,            # half-way, its 17 digits lie below
    2.0**-126 + 2.0**-150,     # half-way at the smallest normal number
])
def test_literal_given_number_is_exact_as_double_and_rounds_once_as_float(x):
    text = emit_c.literal(x)
    assert re.fullmatch(r"-?\d+(\.\d+)?(e[+-]?\d+)?", text) and re.search(r"[.e]", text)
    assert float(text) == x
    assert nearest_float32(text) == np.float32(x)
