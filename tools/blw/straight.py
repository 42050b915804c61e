# SPDX-License-Identifier: MIT
"""Straight-line C for the steps whose every number is known at design time.

The functions do what the loops of the library do, in the same order of summation, without loop,
index or table: zeros are left out and factors of one are not multiplied.  That changes no bit: a
sum that starts from +0 is never -0, so a term of +-0 does not matter.  The numbers are written in,
so that the compiler places them next to the code.
"""

import textwrap
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from blw.design import plant_tables
from blw.literals import literal
from blw.model import Model
from blw.tables import FLOAT32, Code

if TYPE_CHECKING:
    from blw.kalman import Kalman

Array = NDArray[np.float64]

#: Longest function, in multiply-adds: beyond, its flash is too much for what it saves.
MOST_TERMS = 320

#: (3) of blw_kalman.h serves instead of (1) and (2) where it takes less than this part of the
#: operations: then the plant is dense, and the one rounds as much as the other.
CLOSED_PART = 0.8

#: blw_real_t is float: bounds of the library, with room for rounding.
SIGNAL_LIMIT = 1e14
RANGE_LIMIT = 0.99

WIDTH = 96


def closed(model: Model, K: Array) -> tuple[Array, Array] | None:
    """Acl = A - K C A and Bcl = Bu - K C Bu where they serve better than A, Bu and C."""
    Acl, Bcl = (flushed(M - K @ model.C @ M) for M in (model.A, model.Bu))
    apart = _operations(*(flushed(M) for M in (model.A, model.Bu, model.C, K)))
    return (Acl, Bcl) if _operations(Acl, Bcl, flushed(K)) < CLOSED_PART * apart else None


def kalman_step(model: Model, kalman: "Kalman") -> Code | None:
    """blw_kalman_kernel_t of a plant, or None where loops serve it better."""
    n, m, l = model.n, model.m, model.l
    limit = quick_limit(model, kalman)
    merged = closed(model, kalman.K)
    A, Bu = merged or (flushed(model.A), flushed(model.Bu))
    C = np.zeros((m, n)) if merged else flushed(model.C)
    K = flushed(kalman.K)
    terms = n * (n + l + (m if merged else 2 * m))
    if terms > MOST_TERMS or limit is None:
        return None
    x, u, y = names("x", n), names("u", l), names("y", m)
    lines = [*loads("x_hat", x), *loads("u", u), *loads("y", y), *_size_check([*x, *u, *y], limit)]
    for i in range(n):
        known = total(Bu[i], u)
        lines += statement(f"const blw_real_t p{i} =",
                           f"(BLW_R(0.0){tail(A[i], x)})" + (f" + ({known});" if known else ";"))
    for i in range(m):
        offset = tail(-flushed(model.offset[i:i + 1]), ["1"])
        sample = f"(y{i}{offset})" if offset else f"y{i}"
        expected = total(C[i], names("p", n))
        lines += statement(f"const blw_real_t e{i} =",
                           f"{sample} - ({expected});" if expected else f"{sample};")
    for j in range(n):
        lines += statement(f"x_hat[{j}] =", f"p{j}{tail(K[j], names('e', m))};")
    comment = (f"x_hat from k-1 to k: {_count(A, Bu, C, K)} multiply-adds of {terms}, the rest are "
               "zeros")
    unused = [] if l else ["(void)u;"]
    return Code("bool", "const blw_real_t *u, const blw_real_t *y, blw_real_t *x_hat",
                (*unused, *lines, "return true;"), comment)


def _size_check(values: Sequence[str], limit: float) -> list[str]:
    """Refuse unless |values|_2 <= limit, and NaN."""
    squares = " + ".join(f"({v} * {v})" for v in values)
    return [*statement("const blw_real_t size2 =", f"{squares};"), "",
            f"if (!(size2 <= {real(limit**2)})) {{", "    return false;", "}"]


def jordan_step(J: Array, b: Array, D: Array) -> Code | None:
    """blw_jordan_kernel_t for J [r x r], b [m r] and D [m r x l], or None if too long."""
    r, (N, l) = len(J), D.shape
    if N * (2 + l) > MOST_TERMS:
        return None
    J, b, D = flushed(J), flushed(b), flushed(D)
    z, y, u = names("z", N), names("y", N // r), names("u", l)
    bands = (0, 1, 2, -1)  # the order of the sum in blw_jordan_step_sensor()
    state = [f"zeta[{i}]" for i in range(N)]
    lines = [*loads("y", y)]
    for i in range(N):
        row, start = i % r, i - i % r
        at = [row + band for band in bands if 0 <= row + band < r]
        factors = np.append(J[row, at], b[i])
        value = total(factors, [*(state[start + column] for column in at), y[i // r]])
        lines += statement(f"blw_real_t {z[i]} =", f"{value or 'BLW_R(0.0)'};")
    if l:
        lines += ["", "if (u != NULL) {", *(f"    {line}" for line in loads("u", u))]
        for i in range(N):
            if value := total(D[i], u):
                lines += [f"    {line}" for line in statement(f"{z[i]} +=", f"{value};")]
        lines.append("}")
    lines += [f"{state[i]} = {z[i]};" for i in range(N)]
    unused = [] if l else ["(void)u;"]
    comment = f"all local filters from k-1 to k: {_count(np.tile(J, N // r), b, D)} multiply-adds"
    return Code("void", "const blw_real_t *u, const blw_real_t *y, blw_real_t *zeta",
                tuple(unused + lines), comment)


def quick_limit(model: Model, kalman: "Kalman") -> float | None:
    """|(x, u, y)|_2 below which no sample can leave its range and no state its bound."""
    plant: dict[str, Any] = plant_tables(model, kalman).to_json()
    edges = np.minimum(-np.array(plant["y_min"]), np.array(plant["y_max"]))
    if edges.min() <= 0.0:
        return None
    largest = [float(np.abs(M).sum(axis=1).max(initial=0.0))
               for M in (np.hstack([model.A, model.Bu]), model.C, kalman.K)]
    predicted = max(1.0, largest[0])
    growth = predicted + largest[2] * (2.0 + largest[1] * predicted)
    limit = float(min(RANGE_LIMIT * edges.min(), SIGNAL_LIMIT / growth))
    if limit <= np.abs(model.offset).max():
        return None
    return limit


def flushed(matrix: Array) -> Array:
    """As tables.table() stores it: so that what is zero there is zero here."""
    values = np.asarray(matrix, dtype=float)
    return np.where(np.abs(values) < float(FLOAT32.tiny), 0.0, values)


def names(letter: str, count: int) -> list[str]:
    return [f"{letter}{i}" for i in range(count)]


def loads(array: str, names: Iterable[str]) -> list[str]:
    return [f"const blw_real_t {name} = {array}[{i}];" for i, name in enumerate(names)]


def real(x: float) -> str:
    return f"BLW_R({literal(x)})"


def _product(factor: float, name: str) -> str:
    if name == "1":
        return real(factor)
    return name if factor == 1.0 else f"({real(factor)} * {name})"


def tail(factors: Array, names: Sequence[str]) -> str:
    """" + (a * x) - (b * y)": the terms of a sum that goes on."""
    return "".join(f" {'-' if a < 0.0 else '+'} {_product(abs(a), name)}"
                   for a, name in zip(factors.tolist(), names, strict=True) if a)


def total(factors: Array, names: Sequence[str]) -> str:
    """The same from its first term on; empty if all factors are zero."""
    first = next((i for i, a in enumerate(factors.tolist()) if a), None)
    if first is None:
        return ""
    a = float(factors[first])
    lead = f"-{names[first]}" if a == -1.0 else _product(a, names[first])
    return lead + tail(factors[first + 1:], names[first + 1:])


def statement(left: str, right: str) -> list[str]:
    """left right, wrapped."""
    return textwrap.wrap(f"{left} {right}", WIDTH, subsequent_indent="    ")


def _operations(*matrices: Array) -> int:
    """What the products take: a sum a number, and load and product unless it is one."""
    return sum(int(np.count_nonzero(M)) + 2 * int(np.count_nonzero(M * (np.abs(M) - 1.0)))
               for M in matrices)


def _count(*matrices: Array) -> int:
    return sum(int(np.count_nonzero(matrix)) for matrix in matrices)
