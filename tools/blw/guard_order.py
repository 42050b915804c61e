# SPDX-License-Identifier: MIT
"""Fewer local states than n: clustered poles, and what they cost (SPEC 4.1, point 6)."""

from typing import Any

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from blw.guard_filters import Filters, filters
from blw.model import Model

Array = NDArray

#: An order is suggested if tr P grows by no more than this.
TOLERABLE = 0.01

#: Largest size of the tables for one or two excluded sensors.
PAIR_NUMBERS = 16_000

#: Largest number of rows for which all orders are computed.
CURVE_ROWS = 400


def reduced(poles: Array, order: int) -> Array:
    """At most `order` poles, closed under conjugation: the two nearest ones become their mean
    until they are few enough.  Distances are |a - b| / |1 - a b*|, invariant for all-pass sections.
    A pair turns into a real pole only with its own conjugate.
    """
    if order >= poles.size:
        return poles
    upper = [(complex(z.real, 0.0 if abs(z.imag) < 1e-12 else z.imag), 1)
             for z in poles if z.imag >= -1e-12]
    while sum(size_of(z) for z, _ in upper) > order:
        upper = _merged(upper)
    return np.array([w for z, _ in upper for w in ([z] if z.imag == 0 else [z, z.conjugate()])])


def size_of(z: complex) -> int:
    """Local states of a real pole or of a pair."""
    return 1 if z.imag == 0 else 2


def distance(a: complex, b: complex) -> float:
    """Pseudo-hyperbolic distance in the unit disc."""
    return float(abs(a - b) / abs(1.0 - a * b.conjugate()))


def _merged(upper: list[tuple[complex, int]]) -> list[tuple[complex, int]]:
    """One merge: the cheapest of two of a kind, or of a pair with itself."""
    options = []
    for i, (z, weight) in enumerate(upper):
        if z.imag != 0:
            options.append((distance(z, z.conjugate()), i, i, (complex(z.real), 2 * weight)))
        for j, (other, count) in enumerate(upper[:i]):
            if size_of(other) == size_of(z):
                mean = (weight * z + count * other) / (weight + count)
                options.append((distance(z, other), i, j, (mean, weight + count)))
    _, i, j, made = min(options, key=lambda option: option[0])
    return [item for at, item in enumerate(upper) if at not in (i, j)] + [made]


def trace_P(bank: Filters) -> float:
    """tr of the covariance of the fused estimate; that of the Kalman filter for all n poles."""
    L = np.linalg.cholesky(bank.W)
    H = scipy.linalg.solve_triangular(L, bank.Gu, lower=True)
    Q, R = np.linalg.qr(H)
    whitened = scipy.linalg.solve_triangular(L, bank.Sig.T, lower=True)
    split, n_u = bank.split, bank.split.n_u
    Pu = np.linalg.inv(R.T @ R) if n_u else np.zeros((0, 0))
    inside = Q.T @ whitened
    Ps = bank.V[bank.N :, bank.N :] - whitened.T @ whitened + inside.T @ inside
    Pus = -np.linalg.solve(R, inside) if n_u else np.zeros((0, len(Ps)))
    X = np.hstack([split.Xu, split.Xs])
    return float(np.trace(X @ np.block([[Pu, Pus], [Pus.T, Ps]]) @ X.T))


def sees_all(bank: Filters) -> bool:
    """Whether the local states determine xu: with few of them there may be too few rows."""
    size = np.linalg.norm(bank.Gu, axis=0)
    scaled = bank.Gu / np.where(size > 0, size, 1.0)
    return bool(np.linalg.matrix_rank(scaled, tol=1e-9) == bank.split.n_u)


def pair_reals(model: Model, r: int) -> int:
    """Numbers in the tables for one or two excluded sensors, V and s.  None if units of several
    sensors, or more than two, may be excluded, nor if they would be larger than PAIR_NUMBERS."""
    numbers = model.m * (model.m - 1) * r * (r + 1)
    wanted = model.p in (1, 2) and len(model.units) == model.m and numbers <= PAIR_NUMBERS
    return numbers if wanted else 0


def flash_reals(model: Model, bank: Filters) -> int:
    """Numbers in the tables of blw_guard_model_t, all directions being checked by other sensors."""
    N, r, m, n_u = bank.N, bank.r, bank.m, bank.split.n_u
    n, n_s = len(bank.split.Xu), len(bank.split.As)
    split = (n * n_u + n * n_s + n_s * N) if n_s else 0
    own = m * (r * r - (r - 1) * (r - 2) // 2 + 1)
    coupling = r * r * m * (m - 1) // 2 + pair_reals(model, r)
    return own + coupling + 2 * n_u * N + split + 2 * m + 6


def curve(model: Model, poles: Array, bank: Filters) -> dict[str, Any]:
    """tr P and flash bytes (float) against the order, and the smallest order that costs little."""
    rows = []
    for order in range(1, model.n + 1):
        if order * model.m > CURVE_ROWS and order != bank.r:
            continue
        chosen = reduced(poles, order)
        tried = bank if order == bank.r else filters(model, chosen)
        if chosen.size != order or not sees_all(tried):
            continue
        rows.append({"order": order, "trace_P": trace_P(tried),
                     "flash_bytes": 4 * flash_reals(model, tried)})
    if not rows:
        return {}
    least = min(row["trace_P"] for row in rows)
    good = [row["order"] for row in rows if row["trace_P"] <= (1.0 + TOLERABLE) * least]
    return {"orders": rows, "suggested_order": min(good)}
