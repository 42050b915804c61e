# SPDX-License-Identifier: MIT
"""The C library's guard behind ctypes, compiled by the test itself: float or double, any model."""

import ctypes as ct
from pathlib import Path

import numpy as np
from c_library import LIB, CLibrary, common_layouts, compile_method

MODULES = [path.stem for path in sorted((LIB / "src").glob("blw_guard*.c"))]
METHOD_GUARD = 7


def compile_library(folder: Path, width: str) -> Path:
    """guard as a shared object; width is "f32" or "f64".  Skips without a C compiler."""
    return compile_method(folder, "guard", width, MODULES)


def layouts(real: type) -> dict[str, type]:
    """The public structures for one width of blw_real_t."""
    pointer, byte, word = ct.POINTER(real), ct.c_uint8, ct.c_uint16
    common = common_layouts(real)

    class GuardModel(ct.Structure):
        _fields_ = ([("head", common["head"])]
                    + [(k, byte) for k in ("r", "reach", "n_u", "n_units", "most", "search",
                                         "pairs")]
                    + [(k, word) for k in ("max_updates", "warm_up")]
                    + [(k, ct.POINTER(word)) for k in ("unit", "rank")]
                    + [(k, pointer) for k in ("Lam", "b", "S", "V", "s", "Fu", "Gu", "Xu",
                                              "Xs", "Sig", "effect", "drift")]
                    + [(k, real) for k in ("k", "exclude", "gross", "gain", "kappa", "omega",
                                           "sigma")]
                    + [(k, ct.c_void_p) for k in ("solver", "advance", "multiply", "squares",
                                                 "average", "fuse", "move")])

    class Guard(ct.Structure):
        _fields_ = ([("ops", ct.c_void_p), ("model", ct.c_void_p)]
                    + [(k, pointer) for k in ("eta", "e", "l", "average", "h", "suspicion",
                                              "x_bar", "x_ref", "x_hat", "d", "step", "turned",
                                              "L")]
                    + [(k, ct.c_uint64) for k in ("all", "attacked", "excluded")]
                    + [(k, word) for k in ("updates", "warm_up")])

    return common | {"model": GuardModel, "guard": Guard}


def memory_numbers(n: int, m: int, r: int, most: int) -> int:
    """BLW_GUARD_MEM."""
    return 4 * m * r + 2 * m + 4 * n + 4 * r + most * r * (most * r + 3) // 2


class GuardLibrary(CLibrary):
    """One estimator in the C library; arguments as CLibrary."""

    def __init__(self, library: Path, model, kalman, designed):
        super().__init__(library, model, kalman, designed, METHOD_GUARD, layouts)
        self.memory = (self.real * memory_numbers(*designed.mem))()
        self.self = self.types["guard"]()
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
