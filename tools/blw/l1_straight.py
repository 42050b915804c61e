# SPDX-License-Identifier: MIT
"""Straight-line C for the tableau of the l1 fusion: the bits of the loops of lib/src/blw_la.c and
blw_l1_tableau.c, whose order of summation every function here follows (see straight.py).

The matrices are arguments, packed by rows: one function serves S, W and the tableau.
"""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from blw.straight import loads, names, statement
from blw.tables import Code, Struct

#: Most rows of zeta: beyond, the loops cost little more and far less flash.
MOST_ROWS = 16

#: Of the rows of a product with S: whose sums, and zeta, the registers have room for.
FIRST_PART = 0.4

PASS_ON = "/* fall through */"


def kernels(suffix: str, S: NDArray[np.float64], n: int) -> Struct | None:
    """blw_l1_kernels_t for S [N x N], or None where the loops serve better."""
    N = len(S)
    if N > MOST_ROWS:
        return None
    members = {"certify": certify(S, n), "symv": symv(N), "column": column(N), "sweep": sweep(N),
               "fuse": fuse(n, N), "spread": spread(n, N), "predict": predict(n, N),
               "balance": balance(n, N)}
    return Struct("blw_l1_kernels_t", suffix, members)


def certify(S: NDArray[np.float64], n: int) -> Code:
    """blw_l1_certify_kernel_t: all of a step where nu = 0 is optimal.

    Every S_ij is loaded once, for l_i and l_j, a diagonal element of 1 not at all, and every zeta_i
    once for all that it goes into.  The sums of the first rows stay in registers while these meet
    the others; more rows than FIRST_PART have no room there.
    """
    N = len(S)
    first = round(FIRST_PART * N)
    unit = [bool(value == 1.0) for value in np.diag(S)]
    lines = ["const blw_l1_model_t *const m = self->model;", "const blw_real_t *const S = m->S;",
             "const blw_real_t *const F = m->F;", "const blw_real_t *const c = m->c;",
             "blw_real_t *const tau = self->tau;", "blw_real_t *const l = self->l;",
             "blw_real_t most = BLW_R(0.0);", ""]
    for i in range(N):
        lines += [f"const blw_real_t x{i} = zeta[{i}];", f"tau[{i}] = x{i};"]
        lines += [grown(f"s{j}", i, f"F[{j * N + i}] * x{i};") for j in range(n)]
        if i < first:
            lines += [*statement(f"blw_real_t y{i} =", row(i, range(i + 1), "x", unit[i]) + ";"),
                      *meeting(i, range(i), "x", "y")]
    lines += [f"x[{j}] = s{j};" for j in range(n)]
    for j in range(first):
        for i in range(first, N):
            lines += [grown(f"y{i}", j, f"S[{at(i, j)}] * x{j};"), *meeting(i, [j], "x", "y")]
        lines += found(j)
    for i in range(first, N):
        lines += statement(f"y{i} = y{i} +", row(i, range(first, i + 1), "x", unit[i]) + ";")
        lines += meeting(i, range(first, i), "x", "y")
    lines += [line for i in range(first, N) for line in found(i)]
    given = "const struct blw_l1 *self, const blw_real_t *zeta,\n    blw_real_t *x"
    return Code("blw_real_t", given, (*lines, "return most;"),
                f"l = S zeta, x = F zeta: {N * (N + n)} multiply-adds")


def grown(name: str, before: int, term: str) -> str:
    """The sum `name` plus the term behind so many others."""
    return f"{name} += {term}" if before else f"blw_real_t {name} = {term}"


def found(i: int) -> list[str]:
    """l_i is known."""
    return [f"l[{i}] = y{i};", f"most = blw_l1_larger(most, BLW_REAL_ABS(y{i}), c[{i}]);"]


def symv(N: int) -> Code:
    """blw_l1_symv_kernel_t: every S_ij is loaded once, for y_i and y_j.  Half of the sums at a time
    stay in registers: those of the first rows, also while these meet the others, then the others.
    A store after each row keeps the compiler from loading ahead what it has no registers for.
    """
    half = (N + 1) // 2
    lines = []
    for i in range(half):
        lines += [f"const blw_real_t x{i} = x[{i}];",
                  *statement(f"blw_real_t y{i} =", row(i, range(i + 1), "x") + ";"),
                  *meeting(i, range(i), "x", "y"), f"y[{i}] = y{i};"]
    for i in range(half, N):
        lines += [f"const blw_real_t x{i} = x[{i}];",
                  *statement(f"const blw_real_t y{i} =", row(i, range(half), "x") + ";"),
                  *meeting(i, range(half), "x", "y"), f"y[{i}] = y{i};"]
    lines += [f"y[{i}] = y{i};" for i in range(half)]
    for i in range(half, N):
        lines += [f"const blw_real_t u{i} = x[{i}];",
                  *statement(f"blw_real_t v{i} =", f"y[{i}] + {row(i, range(half, i + 1), 'u')};"),
                  *meeting(i, range(half, i), "u", "v"), f"y[{i}] = v{i};"]
    lines += [f"y[{i}] = v{i};" for i in range(half, N - 1)]
    return Code("void", "const blw_real_t *S, const blw_real_t *x, blw_real_t *y", tuple(lines),
                f"y = S x: {N * N} multiply-adds")


def row(i: int, columns: range, x: str, unit: bool = False) -> str:
    """What row i of S gives y_i in these columns; unit: S_ii = 1."""
    return " + ".join(f"{x}{j}" if unit and i == j else f"(S[{at(i, j)}] * {x}{j})"
                      for j in columns)


def meeting(i: int, rows: Iterable[int], x: str, y: str) -> list[str]:
    """What row i of S, as a column, gives the rows above."""
    return [f"{y}{j} += S[{at(i, j)}] * {x}{i};" for j in rows]


def column(N: int) -> Code:
    """blw_l1_column_kernel_t."""
    upper = [f"col[{j}] = row[{j}];" for j in range(N)]
    lower = [f"col[{j}] = below[{at(j, 0)}];" for j in range(1, N)]
    lines = ["const blw_real_t *const row = &T[(k * (k + 1U)) / 2U];",
             "const blw_real_t *const below = &T[k];", "",
             *descend(upper), *ascend(lower)]
    return Code("void", "size_t k, const blw_real_t *T, blw_real_t *col", tuple(lines),
                "column k of T")


def sweep(N: int) -> Code:
    """blw_l1_sweep_kernel_t."""
    x = names("x", N)
    lines = ["const blw_real_t factor = (share < BLW_R(0.0)) ? -share : share;",
             "const blw_real_t *const col = self->step;", "const blw_real_t *const S = self->T;",
             "const blw_real_t *const low = self->tau;", "const blw_real_t *const high = self->z;",
             "blw_real_t *const l = self->l;", "blw_real_t *const T = self->L;",
             "blw_real_t *const row = &T[(k * (k + 1U)) / 2U];",
             "blw_real_t *const below = &T[k];", *loads("col", x),
             f"blw_l1_survey_t found = {{{N}U, BLW_R(0.0), BLW_R(1.0)}};", ""]
    for i in range(N):
        lines.append(f"const blw_real_t a{i} = {x[i]} * share;")
        lines += [f"T[{at(i, j)}] = S[{at(i, j)}] - (a{i} * {x[j]});" for j in range(i)]
        lines += [f"const blw_real_t d{i} = S[{at(i, i)}] - (a{i} * {x[i]});",
                  f"T[{at(i, i)}] = d{i};",
                  f"const blw_real_t v{i} = l[{i}] - (t * {x[i]});", f"l[{i}] = v{i};",
                  f"blw_l1_look(&found, {i}U, v{i}, low[{i}], high[{i}], d{i});"]
    upper = [f"row[{j}] = factor * {x[j]};" for j in range(N)]
    lower = [f"below[{at(j, 0)}] = factor * {x[j]};" for j in range(1, N)]
    lines += ["", *descend(upper), "row[k] = -share;", *ascend(lower), "*seen = found;"]
    return Code("void", "const struct blw_l1 *self, size_t k, blw_real_t share,\n"
                "    blw_real_t t, blw_l1_survey_t *seen", tuple(lines),
                f"T swept on row k, l -= t col, surveyed: {N * (N + 3) // 2} multiply-adds")


def fuse(n: int, N: int) -> Code:
    """F v."""
    return product(np.arange(n * N).reshape(n, N), "=", "{};", "out = F v")


def spread(n: int, N: int) -> Code:
    """F' h."""
    return product(np.arange(n * N).reshape(n, N).T, "=", "{};", "out = F' v")


def predict(n: int, N: int) -> Code:
    """+ G x."""
    return product(np.arange(N * n).reshape(N, n), "+=", "{};", "out += G v")


def balance(n: int, N: int) -> Code:
    """-G' l."""
    return product(np.arange(N * n).reshape(N, n).T, "=", "-({});", "out = -G' v")


def product(places: NDArray[np.int_], assign: str, value: str, comment: str) -> Code:
    """blw_l1_product_kernel_t of a matrix whose entries are in these places of M."""
    lines = loads("v", names("v", places.shape[1]))
    for i, row in enumerate(places):
        terms = " + ".join(f"(M[{place}] * v{j})" for j, place in enumerate(row))
        lines += statement(f"out[{i}] {assign}", value.format(terms))
    return Code("void", "const blw_real_t *M, const blw_real_t *v, blw_real_t *out", tuple(lines),
                comment)


def at(i: int, j: int) -> int:
    """Where a packed lower triangle has element i, j of a symmetric matrix."""
    row, column = max(i, j), min(i, j)
    return row * (row + 1) // 2 + column


def descend(statements: list[str]) -> list[str]:
    """statements[k] to statements[0]."""
    return jump((f"case {k}U:", line) for k, line in reversed([*enumerate(statements)]))


def ascend(statements: list[str]) -> list[str]:
    """statements[k] to the last; none where k is their number."""
    return jump((f"case {k}U:", line) for k, line in enumerate(statements))


def jump(cases: Iterable[tuple[str, str]]) -> list[str]:
    """A switch over k that runs through all cases after the one it enters."""
    lines = ["switch (k) {"]
    for label, line in cases:
        lines += [label, f"    {line}", f"    {PASS_ON}"]
    return [*lines, "default:", "    break;", "}"]
