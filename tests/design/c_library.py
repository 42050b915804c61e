# SPDX-License-Identifier: MIT
"""An estimator of the C library behind ctypes, compiled by the test itself: float or double."""

import ctypes as ct
import shutil
import subprocess
import zlib
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest

from blw.design import plant_tables
from blw.tables import Link, Struct

LIB = Path(__file__).resolve().parents[2] / "lib"
SHARED_SOURCES = ("blw_la", "blw_model", "blw_step")
FLAGS = ["-std=c99", "-ffp-contract=off", "-O2", "-fPIC", "-shared"]

KALMAN, CONVERGED, BOUND, HELD = range(4)  # BLW_OUTCOME_...
MISSING, DEGRADED, BLIND, WARMING_UP = 1, 2, 4, 8  # BLW_FLAG_...


def compile_method(folder: Path, name: str, width: str, modules: Sequence[str],
                   extra: Sequence[Path] = ()) -> Path:
    """Modules of lib as a shared object; width is "f32" or "f64".  Skips without a C compiler."""
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        pytest.skip("no C compiler")
    target = folder / f"{name}_{width}.so"
    define = ["-DBLW_REAL_DOUBLE"] if width == "f64" else []
    files = [LIB / "src" / f"{module}.c" for module in (*SHARED_SOURCES, *modules)]
    subprocess.run([compiler, *FLAGS, *define, f"-I{LIB / 'include'}", f"-I{LIB / 'src'}",
                    *map(str, (*files, *extra)), "-lm", "-o", str(target)], check=True)
    return target


def structure(name: str, *fields: tuple[str, type]) -> type:
    """A C structure."""
    return type(name, (ct.Structure,), {"_fields_": list(fields)})


def each(kind: type, *names: str) -> list[tuple[str, type]]:
    """Members of one type."""
    return [(name, kind) for name in names]


def common_layouts(real: type) -> dict[str, type]:
    """blw_plant_t, blw_model_t and blw_estimator_out_t for one width of blw_real_t."""
    pointer, byte, word = ct.POINTER(real), ct.c_uint8, ct.c_uint16
    plant = structure("Plant", *each(byte, *"nmlp"),
                      *each(pointer, "A", "Bu", "C", "offset", "y_min", "y_max", "x0"))
    return {
        "plant": plant,
        "head": structure("Head", ("abi", word), ("method", byte), ("crc", ct.c_uint32),
                          ("plant", ct.POINTER(plant))),
        "out": structure("Out", *each(pointer, "x_hat", "suspicion"),
                         *each(real, "statistic", "threshold", "bound"),
                         *each(ct.c_uint64, "excluded", "used"), ("iterations", word),
                         *each(byte, "outcome", "flags")),
    }


class CLibrary:
    """What the estimators share: plant, model and out of one design.

    library  what compile_method made; model, kalman, designed: as the design tool returns them
    method   blw_method_t; layouts: types by name for one blw_real_t, "plant", "model" and "out"
             among them
    """

    def __init__(self, library: Path, model, kalman, designed, method: int,
                 layouts: Callable[[type], dict[str, type]]):
        double = library.stem.endswith("f64")
        self.real = ct.c_double if double else ct.c_float
        self.dtype = np.float64 if double else np.float32
        self.lib = ct.CDLL(str(library))
        self.n, self.m, self.l = model.n, model.m, model.l
        self.types = layouts(self.real)
        self._keep: list[object] = []
        plant = plant_tables(model, kalman)
        self.plant = self._fill(self.types["plant"], plant)
        self.model = self._fill(self.types["model"], designed.tables)
        crc = 0
        for struct in (plant, designed.tables):
            for values in struct.reals():
                crc = zlib.crc32(values.astype(self.dtype).tobytes(), crc)
        self.model.head.abi = 0x0200 + ct.sizeof(self.real)
        self.model.head.method, self.model.head.crc = method, crc
        self.model.head.plant = ct.pointer(self.plant)
        self.out = self.types["out"]()

    def _array(self, values):
        """C array of the values; NULL for None."""
        if values is None:
            return None
        values = np.asarray(values, dtype=self.dtype).ravel()
        return (self.real * len(values))(*values.tolist())

    def _fill(self, kind: type, struct: Struct):
        """The C object of one type with the members of struct; what it points to is kept alive."""
        target, fields, plain = kind(), dict(kind._fields_), struct.to_json()
        for name, member in struct.members.items():
            value = plain[name]
            if isinstance(member, Link):
                value = ct.addressof(ct.c_char.in_dll(self.lib, member.symbol))
            elif isinstance(member, Struct):
                value = ct.pointer(self._fill(fields[name]._type_, member))
            elif isinstance(value, list):
                element = fields[name]._type_
                value = ct.cast((element * len(value))(*value), ct.POINTER(element))
            if value is not None:
                self._keep.append(value)
                setattr(target, name, value)
        return target
