# SPDX-License-Identifier: MIT
"""The C library's bank behind ctypes, compiled by the test itself: float or double, any model."""

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
SOURCES = ("blw_la", "blw_model", "blw_step", "blw_bank", "blw_bank_check", "blw_bank_judge")
FLAGS = ["-std=c99", "-ffp-contract=off", "-O2", "-fPIC", "-shared"]
METHOD_BANK = 6

MISSING, DEGRADED = 1, 2  # BLW_FLAG_...

# Steps through a whole record: a call through ctypes takes longer than a step.
LOOP = """
#include <string.h>
#include "blw/blw_bank.h"
int record(blw_bank_t *bank, const blw_real_t *y, const blw_real_t *u, size_t steps, size_t tests,
           blw_real_t *x, blw_real_t *averages, blw_real_t *statistic, int *verdict)
{
    const blw_plant_t *plant = bank->model->head.plant;
    for (size_t k = 0U; k < steps; k++) {
        blw_estimator_out_t out;
        const int status = blw_bank_step(bank, (u != NULL) ? &u[k * plant->l] : NULL,
                                         &y[k * plant->m], BLW_MASK_ALL(plant->m), &out);
        if (status != BLW_OK) {
            return status;
        }
        memcpy(&x[k * plant->n], out.x_hat, plant->n * sizeof *x);
        memcpy(&averages[k * tests], bank->average, tests * sizeof *x);
        statistic[k] = out.statistic;
        verdict[2U * k] = (int)out.outcome;
        verdict[(2U * k) + 1U] = (int)out.excluded;
    }
    return 0;
}
"""


def compile_library(folder: Path, width: str) -> Path:
    """libblw_bank as a shared object; width is "f32" or "f64".  Skips without a C compiler."""
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        pytest.skip("no C compiler")
    target = folder / f"bank_{width}.so"
    loop = folder / "loop.c"
    loop.write_text(LOOP)
    define = ["-DBLW_REAL_DOUBLE"] if width == "f64" else []
    files = [str(LIB / "src" / f"{name}.c") for name in SOURCES]
    subprocess.run([compiler, *FLAGS, *define, f"-I{LIB / 'include'}", f"-I{LIB / 'src'}", *files,
                    str(loop), "-lm", "-o", str(target)], check=True)
    return target


def layouts(real: type) -> dict[str, type]:
    """The public structures for one width of blw_real_t."""
    pointer, byte, word = ct.POINTER(real), ct.c_uint8, ct.c_uint16
    words = ct.POINTER(word)

    class Plant(ct.Structure):
        _fields_ = [(k, byte) for k in "nmlp"] + [
            (k, pointer) for k in ("A", "Bu", "C", "offset", "y_min", "y_max", "x0")]

    class Head(ct.Structure):
        _fields_ = [("abi", word), ("method", byte), ("crc", ct.c_uint32),
                    ("plant", ct.POINTER(Plant))]

    class BankModel(ct.Structure):
        _fields_ = ([("head", Head)]
                    + [(k, byte) for k in ("sets", "subsets", "per_set", "horizon", "groups",
                                           "filtered")]
                    + [(k, word) for k in ("window", "warm_up")]
                    + [(k, words) for k in ("set_mask", "subset_mask", "pair")]
                    + [(k, real) for k in ("gain", "ceiling")]
                    + [(k, pointer) for k in ("K", "Z", "scale", "start", "gate")])

    class Bank(ct.Structure):
        _fields_ = ([("ops", ct.c_void_p), ("model", ct.c_void_p)]
                    + [(k, pointer) for k in ("x_hat", "x_ref", "x_bar", "scratch", "d", "past_d",
                                              "past_e", "past_move", "block", "x_fir", "average",
                                              "worst", "gross", "suspicion")]
                    + [("k", word), ("blocks", word), ("newest", byte), ("choice", byte),
                       ("decided", ct.c_bool), ("age", byte * 8), ("wait", byte * 28)])

    class Out(ct.Structure):
        _fields_ = [("x_hat", pointer), ("suspicion", pointer), ("statistic", real),
                    ("threshold", real), ("bound", real), ("excluded", ct.c_uint64),
                    ("used", ct.c_uint64), ("iterations", word), ("outcome", byte),
                    ("flags", byte)]

    return {"plant": Plant, "model": BankModel, "bank": Bank, "out": Out}


class BankLibrary:
    """One bank in the C library.

    library  what compile_library made; model, kalman, designed: as the design tool returns them
    """

    def __init__(self, library: Path, model, kalman, designed):
        self.double = library.stem.endswith("f64")
        self.real = ct.c_double if self.double else ct.c_float
        self.dtype = np.float64 if self.double else np.float32
        self.lib = ct.CDLL(str(library))
        self.n, self.m, self.l = model.n, model.m, model.l
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
        self.model.head.method, self.model.head.crc = METHOD_BANK, crc
        self.model.head.plant = ct.pointer(self.plant)
        self.memory = (self.real * designed.info["footprint"]["memory_numbers"])()
        self.self, self.out = types["bank"](), types["out"]()
        self.status = self.init()

    def init(self) -> int:
        """blw_bank_init with exactly the memory that the footprint states."""
        return self.lib.blw_bank_init(ct.byref(self.self), ct.byref(self.model), self.memory,
                                      ct.c_size_t(len(self.memory)))

    def reset(self, x0=None) -> int:
        """blw_bank_reset."""
        return self.lib.blw_bank_reset(ct.byref(self.self), self._array(x0))

    def step(self, y, u=None, valid=None) -> int:
        """blw_bank_step; the result is in self.out, see x_hat()."""
        valid = (1 << self.m) - 1 if valid is None else valid
        return self.lib.blw_bank_step(ct.byref(self.self), self._array(u), self._array(y),
                                      ct.c_uint64(valid), ct.byref(self.out))

    def x_hat(self):
        """The estimate, [n]."""
        return np.array(self.out.x_hat[:self.n], dtype=float)

    def run(self, y, u=None):
        """x_hat [steps, n], outcome, excluded, statistic [steps] and averages [steps, tests]."""
        steps, tests = len(y), self.model.sets * self.model.per_set * self.model.groups
        pointer = ct.POINTER(self.real)

        def where(array):
            return None if array is None else array.ctypes.data_as(pointer)

        y = np.ascontiguousarray(y, dtype=self.dtype)
        u = np.ascontiguousarray(u, dtype=self.dtype) if self.l else None
        x, averages = np.empty((steps, self.n), self.dtype), np.empty((steps, tests), self.dtype)
        statistic, verdict = np.empty(steps, self.dtype), np.empty((steps, 2), np.intc)
        status = self.lib.record(ct.byref(self.self), where(y), where(u), ct.c_size_t(steps),
                                 ct.c_size_t(tests), where(x), where(averages), where(statistic),
                                 verdict.ctypes.data_as(ct.POINTER(ct.c_int)))
        assert status == 0
        return (x.astype(float), *verdict.T, statistic.astype(float), averages.astype(float))

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
