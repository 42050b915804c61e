# SPDX-License-Identifier: MIT
"""Straight-line C for the products of `guard` (see straight.py): the same bits as the loops of
lib/src/blw_guard*.c, whose order of summation every function here follows."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from blw import straight
from blw.guard_fusion import Fusion
from blw.kalman import Kalman
from blw.model import Model
from blw.straight import loads, names, real, statement, tail, total
from blw.tables import Code

Array = NDArray

#: Rows that the loops take at a time, GUARD_STRIP.
STRIP = 3

#: Longest functions in multiply-adds; 16 bytes of flash for each.
MOST_TERMS = 360
MOST_FUSION_TERMS = 640

#: Share of different numbers in S from which on they are read from its table.
MOST_DIFFER = 0.9


def advance(model: Model, kalman: Kalman, fusion: Fusion) -> Code | None:
    """blw_guard_advance_kernel_t: prediction, innovations and local filters."""
    n, m, l = model.n, model.m, model.l
    A, Bu, C, offset = (straight.flushed(M) for M in (model.A, model.Bu, model.C, model.offset))
    Lam = straight.flushed(fusion.Lam)
    b = straight.flushed(fusion.b * model.weight[:, None])
    limit = straight.quick_limit(model, kalman)
    terms = sum(int(np.count_nonzero(M)) for M in (A, Bu, C, Lam, b))
    if terms > MOST_TERMS or limit is None:
        return None
    x, u, y, p = (names(*pair) for pair in (("x", n), ("u", l), ("y", m), ("p", n)))
    lines = [*loads("x_ref", x), *loads("u", u), *loads("y", y)]
    squares = " + ".join(f"({v} * {v})" for v in (*x, *u, *y))
    lines += statement("const blw_real_t size2 =", f"{squares};")
    lines += ["", f"if (!(size2 <= {real(limit**2)})) {{", "    return false;", "}"]
    for i in range(n):
        known = total(Bu[i], u) if l else ""
        lines += statement(f"const blw_real_t p{i} =",
                           f"(BLW_R(0.0){tail(A[i], x)}){f' + ({known})' if known else ''};")
    lines += [f"x_bar[{i}] = p{i};" for i in range(n)]
    for i in range(m):
        sample = f"(y{i} - {real(offset[i])})" if offset[i] else f"y{i}"
        expected = total(C[i], p)
        lines += statement(f"const blw_real_t v{i} =",
                           f"{sample} - ({expected});" if expected else f"{sample};")
    for i in range(m):
        lines += filter_lines(i, Lam[i], b[i], fusion.reach)
    return Code("bool",
                "const blw_real_t *u, const blw_real_t *y, const blw_real_t *x_ref,\n"
                "    const blw_real_t *eta, blw_real_t *x_bar, blw_real_t *e",
                (*([] if l else ["(void)u;"]), *lines, "return true;"),
                f"x_bar and e from u, y and eta: {terms} multiply-adds")


def filter_lines(i: int, Lam: Array, b: Array, reach: int) -> list[str]:
    """e_i from eta_i and the innovation v<i>."""
    r = len(b)
    state = [f"eta[{i * r + a}]" for a in range(r)]
    lines = []
    for a in range(r):
        factors = np.concatenate([b[a : a + 1] if a < reach else [0.0], Lam[a]])
        value = total(factors, [f"v{i}", *state])
        lines += statement(f"e[{i * r + a}] =", f"{value or 'BLW_R(0.0)'};")
    return lines


@dataclass(frozen=True)
class Blocks:
    """S below its diagonal blocks in the source: read from the table, which needs no second copy of
    its numbers; or, where many are equal, written in, so that their products are computed once."""

    S: Array  #: [N x N]
    r: int
    read: bool

    @classmethod
    def of(cls, fusion: Fusion) -> "Blocks":
        S = straight.flushed(fusion.S)
        rows, columns = np.indices(S.shape) // fusion.r
        used = np.abs(S[(rows > columns) & (S != 0.0)]).astype(np.float32)
        return cls(S, fusion.r, len(np.unique(used)) > MOST_DIFFER * used.size)

    def tail(self, terms: list[tuple[int, int, str]]) -> str:
        """" + (S_ac * x)" and so on, over terms (a, c, x): a sum that goes on."""
        if self.read:
            return "".join(f" + (S[{self.place(a, c)}] * {x})" for a, c, x in terms if self.S[a, c])
        return tail(*self._split(terms))

    def total(self, terms: list[tuple[int, int, str]]) -> str:
        """The same from its first term on; empty if all are zero."""
        return self.tail(terms)[len(" + "):] if self.read else total(*self._split(terms))

    def place(self, a: int, c: int) -> int:
        """Where blw_guard_model_t.S has S_ac among its strips."""
        i, row = divmod(a, self.r)
        first = row - row % STRIP
        width = min(STRIP, self.r - first)
        return self.r**2 * i * (i - 1) // 2 + first * i * self.r + c * width + row - first

    def _split(self, terms: list[tuple[int, int, str]]) -> tuple[Array, list[str]]:
        return np.array([self.S[a, c] for a, c, _ in terms]), [x for _, _, x in terms]

    @property
    def head(self) -> list[str]:
        """What the body of a function starts with."""
        return [] if self.read else ["(void)S;"]


def multiply(fusion: Fusion) -> Code | None:
    """blw_guard_multiply_kernel_t: l = S tau."""
    r, N = fusion.r, fusion.m * fusion.r
    if N * (N - r) > MOST_TERMS:
        return None
    S = Blocks.of(fusion)
    t = names("t", N)
    lines = [*S.head, *loads("tau", t)]
    for i in range(fusion.m):
        for a in range(i * r, (i + 1) * r):
            own = t[a] if a - i * r < fusion.rank[i] else "BLW_R(0.0)"
            lower = S.total([(a, c, t[c]) for c in range(i * r)])
            lines += statement(f"blw_real_t l{a} =", f"{own} + ({lower});" if lower else f"{own};")
        for start in range(i * r, (i + 1) * r, STRIP):
            rows = range(start, min(start + STRIP, (i + 1) * r))
            for c in range(i * r):
                added = S.tail([(a, c, t[a]) for a in rows])
                lines += statement(f"l{c} =", f"l{c}{added};") if added else []
    lines += [f"l[{a}] = l{a};" for a in range(N)]
    return Code("void", "const blw_real_t *S, const blw_real_t *tau, blw_real_t *l", tuple(lines),
                f"l = S tau: {N * (N - r)} multiply-adds")


def squares(m: int, r: int) -> Code | None:
    """blw_guard_squares_kernel_t."""
    if m * r > MOST_TERMS:
        return None
    lines = [line for i in range(m) for line in squared(i, [f"l[{i * r + a}]" for a in range(r)])]
    return Code("void", "const blw_real_t *l, blw_real_t *squares", tuple(lines), "|l_i|^2")


def average(m: int, r: int, gain: float) -> Code | None:
    """blw_guard_average_kernel_t."""
    if m * r > MOST_TERMS:
        return None
    lines = []
    for i in range(m):
        rows = range(i * r, (i + 1) * r)
        lines += [line for j in rows for line in statement(
            f"const blw_real_t a{j} =",
            f"average[{j}] + ({real(gain)} * (l[{j}] - average[{j}]));")]
        lines += [f"average[{j}] = a{j};" for j in rows]
        lines += squared(i, [f"a{j}" for j in rows])
    return Code("void", "const blw_real_t *l, blw_real_t *average, blw_real_t *squares",
                tuple(lines), "averages of l with their squares |average_i|^2")


def squared(i: int, of: list[str]) -> list[str]:
    """squares[i] = sum of squares."""
    return statement(f"squares[{i}] =", " + ".join(f"({v} * {v})" for v in of) + ";")


def move(fusion: Fusion) -> Code | None:
    """blw_guard_move_kernel_t: l_j += S_ji step for all j /= i."""
    r, m = fusion.r, fusion.m
    N = m * r
    if N * (N - r) > MOST_TERMS:
        return None
    S = Blocks.of(fusion)
    d = names("d", r)
    lines = [*S.head, *loads("step", d), "", "switch (i) {"]
    for i in range(m):
        lines.append(f"case {i}:" if i < m - 1 else "default:")
        for c in range(N):
            lines += [f"    {line}" for line in moved(S, c, i, d)]
        lines.append("    break;")
    lines.append("}")
    return Code("void", "const blw_real_t *S, size_t i, const blw_real_t *step, blw_real_t *l",
                tuple(lines),
                f"l_j += S_ji step for all sensors j but i: {r * (N - r)} multiply-adds")


def moved(S: Blocks, c: int, i: int, d: list[str]) -> list[str]:
    """Row c of the other sensors: to the strips of sensor i's rows, or the sum over its columns."""
    r = S.r
    if c // r == i:
        return []
    if c // r > i:
        parts = [S.total([(c, i * r + a, d[a]) for a in range(r)])]
    else:
        strips = [range(start, min(start + STRIP, r)) for start in range(0, r, STRIP)]
        parts = [S.total([(i * r + a, c, d[a]) for a in rows]) for rows in strips]
    added = "".join(f" + ({part})" for part in parts if part)
    return statement(f"l[{c}] =", f"l[{c}]{added};") if added else []


def fuse(fusion: Fusion, Xu: Array) -> Code | None:
    """blw_guard_fuse_kernel_t."""
    n, n_u = Xu.shape
    N = len(fusion.Gu)
    terms = 2 * n_u * N + (n * n_u if n_u < n else 0)
    if n_u == 0 or terms > MOST_FUSION_TERMS:
        return None
    Fu, Gu, Xu = (straight.flushed(M) for M in (fusion.Fu, fusion.Gu, Xu))
    t, d = names("t", N), names("d", n_u)
    lines = loads("tau", t)
    for a in range(n_u):
        lines += statement(f"const blw_real_t d{a} =", f"{total(Fu[a], t) or 'BLW_R(0.0)'};")
    for a in range(n):
        moved = f"d{a}" if n_u == n else f"({total(Xu[a], d)})"
        lines += statement(f"x_ref[{a}] =",
                           f"x_bar[{a}] + {moved};" if moved != "()" else f"x_bar[{a}];")
    for c in range(N):
        value = f"e[{c}]"
        for start in range(0, n_u, STRIP):
            part = total(-Gu[c, start : start + STRIP], d[start : start + STRIP])
            value += f" + ({part})" if part else ""
        lines += statement(f"eta[{c}] =", f"{value};")
    return Code("void",
                "const blw_real_t *tau, const blw_real_t *e, const blw_real_t *x_bar,\n"
                "    blw_real_t *x_ref, blw_real_t *eta", tuple(lines),
                f"x_ref = x_bar + Xu Fu tau, eta = e - Gu Fu tau: {terms} multiply-adds")
