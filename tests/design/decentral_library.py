# SPDX-License-Identifier: MIT
"""The C library's `decentral` behind ctypes, compiled by the test: float or double, any model."""

import ctypes as ct
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from c_library import CLibrary, common_layouts, compile_method, each, structure

MODULES = ("blw_decentral", "blw_decentral_check", "blw_decentral_recursive",
           "blw_decentral_search", "blw_decentral_steady")
METHOD_DECENTRAL = 5


def compile_library(folder: Path, width: str) -> Path:
    """decentral as a shared object; width is "f32" or "f64".  Skips without a C compiler."""
    return compile_method(folder, "decentral", width, MODULES)


def layouts(real: type) -> dict[str, type]:
    """The public structures for one width of blw_real_t."""
    pointer, byte, word = ct.POINTER(real), ct.c_uint8, ct.c_uint16
    words = ct.POINTER(word)
    common = common_layouts(real)
    sets = structure("Sets", *each(word, "n_sets", "n_candidates"),
                  *each(words, "parent", "sensor", "candidate"))
    ranking = structure("Ranking", *each(word, "n_dof", "n_ranked", "n_knots"), ("removed", words),
                     *each(pointer, "thr", "knots", "c"))
    steady = structure("Steady", ("d", word), *each(pointer, *"FKN", "Psi", *"QYH"), ("at", words),
                    ("M", pointer))
    recursive = structure("Recursive", *each(pointer, "S", "t", "V", "E", "L0", "Psi"))
    model = structure("Model", ("head", common["head"]),
                   *each(word, "mu", "rows", "warm_up", "readmit", "max_gap"), ("reseed", byte),
                   ("first", words), *each(pointer, "Phi", "scale"), ("sets", ct.POINTER(sets)),
                   ("ranking", ct.POINTER(ranking)), ("gains", ct.c_void_p),
                   ("steady", ct.POINTER(steady)), ("recursive", ct.POINTER(recursive)))
    return common | {"model": model}


@dataclass(frozen=True)
class Run:
    """What the library said at every step: x [steps, n], suspicion [steps, m], others [steps]."""

    x: np.ndarray
    suspicion: np.ndarray
    g: np.ndarray
    excluded: np.ndarray
    outcome: np.ndarray
    flags: np.ndarray
    iterations: np.ndarray


class Decentral(CLibrary):
    """One estimator in the C library; arguments as CLibrary."""

    def __init__(self, library: Path, model, kalman, designed):
        super().__init__(library, model, kalman, designed, METHOD_DECENTRAL, layouts)
        self.memory = (self.real * (designed.info["footprint"]["ram_bytes"] // 4))()
        self.state = (ct.c_uint64 * 64)()
        assert self.init(len(self.memory)) == 0

    def init(self, length: int) -> int:
        """blw_decentral_init with that many numbers of memory."""
        return self.lib.blw_decentral_init(self.state, ct.byref(self.model), self.memory,
                                           ct.c_size_t(length))

    def reset(self, x0=None) -> None:
        """blw_decentral_reset."""
        assert self.lib.blw_decentral_reset(self.state, self._array(x0)) == 0

    def run(self, y, u=None, valid=None) -> Run:
        """All steps over y [steps, m], u [steps, l] (u(k-1)), valid [steps] masks."""
        pointer = ct.POINTER(self.real)
        y = np.ascontiguousarray(y, dtype=self.dtype)
        u = None if u is None else np.ascontiguousarray(u, dtype=self.dtype)
        steps, out = len(y), self.out
        x, suspicion = np.empty((steps, self.n)), np.empty((steps, self.m))
        rest = np.empty((steps, 5))
        for k in range(steps):
            u_k = None if u is None else u[k].ctypes.data_as(pointer)
            mask = (1 << self.m) - 1 if valid is None else int(valid[k])
            status = self.lib.blw_decentral_step(self.state, u_k, y[k].ctypes.data_as(pointer),
                                                 ct.c_uint64(mask), ct.byref(out))
            assert status == 0
            x[k], suspicion[k] = out.x_hat[:self.n], out.suspicion[:self.m]
            rest[k] = out.statistic, out.excluded, out.outcome, out.flags, out.iterations
        return Run(x, suspicion, rest[:, 0], *rest[:, 1:].astype(int).T)
