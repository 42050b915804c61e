# SPDX-License-Identifier: MIT
"""Straight-line C for the tableau of the l1 fusion: the bits of the loops of lib/src/blw_la.c and
blw_l1_tableau.c, whose order of summation every function here follows (see straight.py).

The matrices are arguments, packed by rows: one function serves S, W and the tableau.
"""

from blw.straight import loads, names, statement
from blw.tables import Code

#: Rows that the loops take at a time.
STRIP = 3

#: Most rows of zeta: 36 bytes of flash for each number of a packed matrix.
MOST_ROWS = 16


def symv(N: int) -> Code | None:
    """blw_l1_symv_kernel_t, or None where the loops serve better."""
    if N > MOST_ROWS:
        return None
    x, lines = names("x", N), loads("x", names("x", N))
    for first in range(0, N, STRIP):
        rows = range(first, first + STRIP) if first + STRIP <= N else range(first, N)
        for strip in [rows] if len(rows) == STRIP else [range(i, i + 1) for i in rows]:
            for i in strip:
                terms = [product(i, j, x) for j in range(strip.stop)]
                lines += statement(f"blw_real_t y{i} =", " + ".join(terms) + ";")
            for j in range(strip.start):
                terms = [product(i, j, x, i) for i in strip]
                lines += statement(f"y{j} =", " + ".join([f"y{j}", *terms]) + ";")
    lines += [f"y[{i}] = y{i};" for i in range(N)]
    return Code("void", "const blw_real_t *S, const blw_real_t *x, blw_real_t *y", tuple(lines),
                f"y = S x: {N * N} multiply-adds")


def product(i: int, j: int, x: list[str], of: int | None = None) -> str:
    """"(S_ij * x_j)", or times x_of."""
    return f"(S[{at(i, j)}] * {x[j if of is None else of]})"


def at(i: int, j: int) -> int:
    """Where a packed lower triangle has S_ij."""
    row, column = max(i, j), min(i, j)
    return row * (row + 1) // 2 + column


def reduce(N: int) -> Code | None:
    """blw_l1_reduce_kernel_t, or None where the loops serve better."""
    if N > MOST_ROWS:
        return None
    x = names("x", N)
    lines = loads("col", x)
    for i in range(N):
        lines.append(f"const blw_real_t a{i} = {x[i]} * share;")
        lines += [f"T[{at(i, j)}] -= a{i} * {x[j]};" for j in range(i + 1)]
    return Code("void", "const blw_real_t *col, blw_real_t share, blw_real_t *T", tuple(lines),
                f"T -= share col col': {N * (N + 1) // 2} multiply-adds")
