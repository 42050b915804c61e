# SPDX-License-Identifier: MIT
"""The C library's bank behind ctypes, compiled by the test itself: float or double, any model."""

import ctypes as ct
from pathlib import Path

import numpy as np
from c_library import CLibrary, common_layouts, compile_method

MODULES = ("blw_bank", "blw_bank_check", "blw_bank_judge")
METHOD_BANK = 6

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
    """bank as a shared object; width is "f32" or "f64".  Skips without a C compiler."""
    loop = folder / "loop.c"
    loop.write_text(LOOP)
    return compile_method(folder, "bank", width, MODULES, [loop])


def layouts(real: type) -> dict[str, type]:
    """The public structures for one width of blw_real_t."""
    pointer, byte, word = ct.POINTER(real), ct.c_uint8, ct.c_uint16
    words = ct.POINTER(word)
    common = common_layouts(real)

    class BankModel(ct.Structure):
        _fields_ = ([("head", common["head"])]
                    + [(k, byte) for k in ("sets", "subsets", "per_set", "horizon", "groups",
                                           "filtered", "max_gap")]
                    + [(k, word) for k in ("window", "warm_up")]
                    + [(k, words) for k in ("set_mask", "subset_mask", "pair")]
                    + [(k, real) for k in ("gain", "ceiling")]
                    + [(k, pointer) for k in ("K", "Z", "scale", "start", "gate")])

    class Bank(ct.Structure):
        _fields_ = ([("ops", ct.c_void_p), ("model", ct.c_void_p)]
                    + [(k, pointer) for k in ("x_hat", "x_ref", "x_bar", "scratch", "d", "past_d",
                                              "past_e", "past_move", "block", "x_fir", "response",
                                              "average", "worst", "gross", "suspicion")]
                    + [("k", word), ("blocks", word), ("newest", byte), ("choice", byte),
                       ("decided", ct.c_bool), ("age", byte * 8), ("silent", byte * 8),
                       ("wait", byte * 28)])

    return common | {"model": BankModel, "bank": Bank}


class BankLibrary(CLibrary):
    """One bank in the C library; arguments as CLibrary."""

    def __init__(self, library: Path, model, kalman, designed):
        super().__init__(library, model, kalman, designed, METHOD_BANK, layouts)
        self.memory = (self.real * designed.info["footprint"]["memory_numbers"])()
        self.self = self.types["bank"]()
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
