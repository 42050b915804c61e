# SPDX-License-Identifier: MIT
"""The C library's `decentral` behind ctypes, compiled by the test: float or double, any model."""

import ctypes as ct
import shutil
import subprocess
import zlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from blw.design import plant_tables
from blw.tables import Struct

LIB = Path(__file__).resolve().parents[2] / "lib"
SOURCES = ("blw_la", "blw_model", "blw_step", "blw_decentral", "blw_decentral_check",
           "blw_decentral_recursive", "blw_decentral_search", "blw_decentral_steady")
FLAGS = ["-std=c99", "-ffp-contract=off", "-O2", "-fPIC", "-shared"]
METHOD_DECENTRAL = 5

KALMAN, CONVERGED, BOUND, HELD = range(4)
MISSING, DEGRADED, BLIND, WARMING_UP = 1, 2, 4, 8


def compile_library(folder: Path, width: str) -> Path:
    """The estimator as a shared object; width is "f32" or "f64".  Skips without a C compiler."""
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        pytest.skip("no C compiler")
    target = folder / f"decentral_{width}.so"
    define = ["-DBLW_REAL_DOUBLE"] if width == "f64" else []
    files = [str(LIB / "src" / f"{name}.c") for name in SOURCES]
    subprocess.run([compiler, *FLAGS, *define, f"-I{LIB / 'include'}", f"-I{LIB / 'src'}", *files,
                    "-lm", "-o", str(target)], check=True)
    return target


def layouts(real: type) -> dict[str, type]:
    """The public structures for one width of blw_real_t, by C type."""
    pointer, byte, word = ct.POINTER(real), ct.c_uint8, ct.c_uint16
    words = ct.POINTER(word)

    def struct(name: str, *fields: tuple[str, type]) -> type:
        return type(name, (ct.Structure,), {"_fields_": list(fields)})

    def each(kind: type, *names: str) -> list[tuple[str, type]]:
        return [(name, kind) for name in names]

    plant = struct("Plant", *each(byte, *"nmlp"),
                   *each(pointer, "A", "Bu", "C", "offset", "y_min", "y_max", "x0"))
    head = struct("Head", ("abi", word), ("method", byte), ("crc", ct.c_uint32),
                  ("plant", ct.POINTER(plant)))
    sets = struct("Sets", *each(word, "n_sets", "n_candidates"),
                  *each(words, "parent", "sensor", "candidate"))
    ranking = struct("Ranking", *each(word, "n_dof", "n_ranked", "n_knots"), ("removed", words),
                     *each(pointer, "thr", "knots", "c"))
    steady = struct("Steady", ("d", word), *each(pointer, *"FKN", "Psi", *"QYH"), ("at", words),
                    ("M", pointer))
    recursive = struct("Recursive", *each(pointer, "S", "t", "V", "E", "L0", "Psi"))
    model = struct("Model", ("head", head),
                   *each(word, "mu", "rows", "warm_up", "readmit", "max_gap"), ("reseed", byte),
                   ("first", words), *each(pointer, "Phi", "scale"), ("sets", ct.POINTER(sets)),
                   ("ranking", ct.POINTER(ranking)), ("steady", ct.POINTER(steady)),
                   ("recursive", ct.POINTER(recursive)))
    out = struct("Out", *each(pointer, "x_hat", "suspicion"),
                 *each(real, "statistic", "threshold", "bound"),
                 *each(ct.c_uint64, "excluded", "used"), ("iterations", word),
                 *each(byte, "outcome", "flags"))
    return {"blw_plant_t": plant, "blw_decentral_sets_t": sets, "out": out,
            "blw_decentral_ranking_t": ranking, "blw_decentral_steady_t": steady,
            "blw_decentral_recursive_t": recursive, "blw_decentral_model_t": model}


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


class Decentral:
    """One estimator in the C library.

    library  what compile_library made; model, kalman, designed: as the design tool returns them
    """

    def __init__(self, library: Path, model, kalman, designed):
        double = library.stem.endswith("f64")
        self.real = ct.c_double if double else ct.c_float
        self.dtype = np.float64 if double else np.float32
        self.lib = ct.CDLL(str(library))
        self.n, self.m = model.n, model.m
        self.types = layouts(self.real)
        self._keep: list[object] = []
        plant = plant_tables(model, kalman)
        self.plant, self.model = self._fill(plant), self._fill(designed.tables)
        crc = 0
        for struct in (plant, designed.tables):
            for values in struct.reals():
                crc = zlib.crc32(values.astype(self.dtype).tobytes(), crc)
        self.model.head.abi = 0x0100 + ct.sizeof(self.real)
        self.model.head.method, self.model.head.crc = METHOD_DECENTRAL, crc
        self.model.head.plant = ct.pointer(self.plant)
        self.memory = (self.real * (designed.info["footprint"]["ram_bytes"] // 4))()
        self.state = (ct.c_uint64 * 64)()
        self.out = self.types["out"]()
        assert self.init(len(self.memory)) == 0

    def init(self, length: int) -> int:
        """blw_decentral_init with that many numbers of memory."""
        return self.lib.blw_decentral_init(self.state, ct.byref(self.model), self.memory,
                                           ct.c_size_t(length))

    def reset(self, x0=None) -> None:
        """blw_decentral_reset."""
        start = None if x0 is None else self._array(x0)
        assert self.lib.blw_decentral_reset(self.state, start) == 0

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

    def _array(self, values):
        values = np.asarray(values, dtype=self.dtype).ravel()
        return (self.real * len(values))(*values.tolist())

    def _fill(self, struct: Struct):
        target = self.types[struct.ctype]()
        fields = dict(target._fields_)
        for name, value in struct.members.items():
            if isinstance(value, Struct):
                nested = self._fill(value)
                self._keep.append(nested)
                setattr(target, name, ct.pointer(nested))
            elif isinstance(value, int):
                setattr(target, name, value)
            elif value is not None:
                element = fields[name]._type_
                numbers = value.array.ravel().tolist()
                array = (element * len(numbers))(*numbers)
                self._keep.append(array)
                setattr(target, name, ct.cast(array, ct.POINTER(element)))
        return target
