# SPDX-License-Identifier: MIT
"""The C library's guard behind ctypes, compiled by the test itself: float or double, any model."""

import ctypes as ct
import shutil
import subprocess
import zlib
from pathlib import Path

import numpy as np
import pytest

from blw.design import plant_tables
from blw.tables import Struct

LIB = Path(__file__).resolve().parents[2] / "lib"
SOURCES = ("blw_la", "blw_model", "blw_step", "blw_guard", "blw_guard_check", "blw_guard_search",
           "blw_guard_solve", "blw_guard_beside", "blw_guard_bound", "blw_guard_filters",
           "blw_guard_S")
FLAGS = ["-std=c99", "-ffp-contract=off", "-O2", "-fPIC", "-shared"]
METHOD_GUARD = 7

KALMAN, CONVERGED, BOUND, HELD = range(4)
MISSING, DEGRADED, BLIND, WARMING_UP = 1, 2, 4, 8


def compile_library(folder: Path, width: str) -> Path:
    """libblw_guard as a shared object; width is "f32" or "f64".  Skips without a C compiler."""
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        pytest.skip("no C compiler")
    target = folder / f"guard_{width}.so"
    define = ["-DBLW_REAL_DOUBLE"] if width == "f64" else []
    files = [str(LIB / "src" / f"{name}.c") for name in SOURCES]
    subprocess.run([compiler, *FLAGS, *define, f"-I{LIB / 'include'}", f"-I{LIB / 'src'}", *files,
                    "-lm", "-o", str(target)], check=True)
    return target


def layouts(real: type) -> dict[str, type]:
    """The public structures for one width of blw_real_t."""
    pointer, byte, word = ct.POINTER(real), ct.c_uint8, ct.c_uint16

    class Plant(ct.Structure):
        _fields_ = [(k, byte) for k in "nmlp"] + [
            (k, pointer) for k in ("A", "Bu", "C", "offset", "y_min", "y_max", "x0")]

    class Head(ct.Structure):
        _fields_ = [("abi", word), ("method", byte), ("crc", ct.c_uint32),
                    ("plant", ct.POINTER(Plant))]

    class GuardModel(ct.Structure):
        _fields_ = ([("head", Head)]
                    + [(k, byte) for k in ("r", "reach", "n_u", "n_units", "most", "search",
                                         "pairs")]
                    + [(k, word) for k in ("max_updates", "warm_up")]
                    + [(k, ct.POINTER(word)) for k in ("unit", "rank")]
                    + [(k, pointer) for k in ("Lam", "b", "S", "V", "s", "Fu", "Gu", "Xu",
                                              "Xs", "Sig", "effect", "drift")]
                    + [(k, real) for k in ("k", "exclude", "gain", "kappa", "omega", "sigma")]
                    + [(k, ct.c_void_p) for k in ("advance", "multiply", "squares", "average",
                                                 "fuse", "move")])

    class Guard(ct.Structure):
        _fields_ = ([("ops", ct.c_void_p), ("model", ct.c_void_p)]
                    + [(k, pointer) for k in ("eta", "e", "l", "average", "h", "suspicion",
                                              "x_bar", "x_ref", "x_hat", "d", "step", "turned",
                                              "L")]
                    + [(k, ct.c_uint64) for k in ("all", "attacked", "excluded")]
                    + [(k, word) for k in ("updates", "warm_up")])

    class Out(ct.Structure):
        _fields_ = [("x_hat", pointer), ("suspicion", pointer), ("statistic", real),
                    ("threshold", real), ("bound", real), ("excluded", ct.c_uint64),
                    ("used", ct.c_uint64), ("iterations", word), ("outcome", byte),
                    ("flags", byte)]

    return {"plant": Plant, "model": GuardModel, "guard": Guard, "out": Out}


def memory_numbers(n: int, m: int, r: int, most: int) -> int:
    """BLW_GUARD_MEM."""
    return 4 * m * r + 2 * m + 4 * n + 3 * r + most * r * (most * r + 3) // 2


class GuardLibrary:
    """One estimator in the C library.

    library  what compile_library made; model, kalman, designed: as the design tool returns them
    """

    def __init__(self, library: Path, model, kalman, designed):
        self.real = ct.c_double if library.stem.endswith("f64") else ct.c_float
        self.dtype = np.float64 if library.stem.endswith("f64") else np.float32
        self.lib = ct.CDLL(str(library))
        self.n, self.m = model.n, model.m
        self._keep: list[object] = []
        types = layouts(self.real)
        plant = plant_tables(model, kalman)
        self.plant = self._fill(types["plant"], plant)
        self.model = self._fill(types["model"], designed.tables)
        crc = 0
        for struct in (plant, designed.tables):
            for values in struct.reals():
                crc = zlib.crc32(values.astype(self.dtype).tobytes(), crc)
        self.model.head.abi = 0x0100 + ct.sizeof(self.real)
        self.model.head.method, self.model.head.crc = METHOD_GUARD, crc
        self.model.head.plant = ct.pointer(self.plant)
        self.memory = (self.real * memory_numbers(*designed.mem))()
        self.self, self.out = types["guard"](), types["out"]()
        self.status = self.init()

    def init(self) -> int:
        """blw_guard_init with exactly the memory that BLW_GUARD_MEM states."""
        return self.lib.blw_guard_init(ct.byref(self.self), ct.byref(self.model), self.memory,
                                       ct.c_size_t(len(self.memory)))

    def reset(self, x0=None) -> int:
        """blw_guard_reset."""
        return self.lib.blw_guard_reset(ct.byref(self.self), self._array(x0))

    def run(self, y, u=None, valid=None) -> dict[str, np.ndarray]:
        """Steps over y [steps, m], u [steps, l]: x_hat [steps, n] and out, member by member."""
        steps = len(y)
        y = np.ascontiguousarray(y, dtype=self.dtype)
        u = None if u is None else np.ascontiguousarray(u, dtype=self.dtype)
        valid = np.full(steps, (1 << self.m) - 1, np.uint64) if valid is None else valid
        names = ("statistic", "bound", "excluded", "used", "iterations", "outcome", "flags")
        found = {name: np.empty(steps) for name in names}
        found["x_hat"] = np.empty((steps, self.n))
        found["suspicion"] = np.empty((steps, self.m))
        guard, out, pointer = ct.byref(self.self), ct.byref(self.out), ct.POINTER(self.real)
        for k in range(steps):
            u_k = None if u is None else u[k].ctypes.data_as(pointer)
            status = self.lib.blw_guard_step(guard, u_k, y[k].ctypes.data_as(pointer),
                                             ct.c_uint64(int(valid[k])), out)
            assert status == 0
            for name in names:
                found[name][k] = getattr(self.out, name)
            if k == 0:  # the arrays stay where they are
                x_hat = np.ctypeslib.as_array(self.out.x_hat, (self.n,))
                suspicion = np.ctypeslib.as_array(self.out.suspicion, (self.m,))
            found["x_hat"][k], found["suspicion"][k] = x_hat, suspicion
        return found

    def _array(self, values):
        if values is None:
            return None
        values = np.asarray(values, dtype=self.dtype).ravel()
        return (self.real * len(values))(*values.tolist())

    def _fill(self, kind: type, struct: Struct):
        target = kind()
        fields = dict(target._fields_)
        for name, value in struct.to_json().items():
            if isinstance(value, list):
                element = fields[name]._type_
                array = (element * len(value))(*value)
                self._keep.append(array)
                value = ct.cast(array, ct.POINTER(element))
            if value is not None:
                setattr(target, name, value)
        return target
