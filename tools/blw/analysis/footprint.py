# SPDX-License-Identifier: MIT
"""Flash, RAM and work per step of a designed method on a 32-bit target with float numbers.

Flash is that of the constant tables, the plant's included; the code of the library comes on top,
once for all models, and the straight-line code of a small plant, four bytes an operation.  RAM is
the state structure and its memory.  Stack is measured, not computed.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import comb
from typing import Any

import numpy as np

from blw.analysis import instructions, l1_instructions
from blw.analysis.headers import macro, size_of
from blw.design import Design, Designed
from blw.tables import Index, Struct, Table

REAL = 4
INDEX = {"uint8_t": 1, "uint16_t": 2, "uint32_t": 4}

#: Methods whose C module has another name.
MODULE = {"canonical": "lasso"}


@dataclass(frozen=True)
class Footprint:
    """Bytes; multiply-adds per step without alarm and at most; instructions on a Cortex-M4F without
    alarm, and the mean while one sensor after another is attacked (None: not modelled)."""

    flash_bytes: int
    ram_bytes: int
    macs_typical: int | None
    macs_worst: int | None
    instructions_typical: int | None
    instructions_mean_attacked: int | None = None


def footprint(name: str, designed: Designed, plant: Struct) -> Footprint:
    """Footprint of one designed method."""
    module = MODULE.get(name, name)
    numbers = macro(f"BLW_{module.upper()}_MEM")(*designed.mem)
    tables = plant.to_json()
    typical, worst = COSTS[name](designed, tables) if name in COSTS else (None, None)
    return Footprint(
        flash_bytes=table_bytes(designed.tables) + table_bytes(plant),
        ram_bytes=size_of(f"blw_{module}_t") + REAL * numbers,
        macs_typical=typical,
        macs_worst=worst,
        instructions_typical=instructions.typical(name, designed, tables),
    )


def with_simulation(cost: Footprint, name: str, design: Design) -> Footprint:
    """The same with the instructions of a method whose work depends on the data."""
    found = l1_instructions.expected(design, name) if name in l1_instructions.METHODS else None
    if found is None:
        return cost
    return replace(cost, instructions_typical=found[0], instructions_mean_attacked=found[1])


def table_bytes(struct: Struct) -> int:
    """Bytes of the object, and of all tables and objects it points to."""
    total = size_of(struct.ctype)
    for member in struct.members.values():
        for item in member if isinstance(member, list) else [member]:
            if isinstance(item, Struct):
                total += table_bytes(item)
            elif isinstance(item, Table):
                total += REAL * item.array.size
            elif isinstance(item, Index):
                total += INDEX[item.ctype] * item.array.size
    return total


def _predict(plant: dict[str, Any]) -> int:
    return plant["n"] * (plant["n"] + plant["l"])


def _kalman(designed: Designed, plant: dict[str, Any]) -> tuple[int, int]:
    """At most: with a gap, where (3) of blw_kalman.h does not serve."""
    gain = plant["n"] * plant["m"]
    worst = _predict(plant) + 2 * gain
    return worst - gain if designed.tables.members["Acl"] else worst, worst


def _lasso(designed: Designed, plant: dict[str, Any]) -> tuple[int, int]:
    """The filters, P and the certificate; then max_iterations of the engine.  A pivot on the
    tableau updates half of it; one on Z is a product in both directions and a solve with the
    largest support; a Newton step factors the conditions of all rows anew; a pass of ADMM is a
    product."""
    n, _, N, d, groups, has_P = designed.mem
    tables = designed.tables.to_json()
    r = tables["jordan"]["r"]
    z_length = macro("BLW_L1_Z_LEN")(N, d)
    rows = macro("BLW_L1_ROWS")(N, d, groups)
    bands = sum(bool(np.any(tables["jordan"][band])) for band in ("J0", "J1", "J2", "Jm"))
    filters = N * (bands + 1 + plant["l"]) + (N * r if has_P else 0)
    engine = tables["l1"]["engine"]
    S = N * N if tables["l1"]["Z"] is None else 2 * z_length
    typical = _predict(plant) + plant["m"] * plant["n"] + filters + S + 2 * N * n
    pivot = {"tableau": N * (N + 1) // 2, "active_set": 2 * z_length + rows * (rows + d),
             "newton": N**3 // 6 + 2 * N * N, "admm": N * N}[engine]
    return typical, typical + tables["l1"]["max_iterations"] * pivot


def _joint(designed: Designed, plant: dict[str, Any]) -> tuple[int, int]:
    """Filters and fusion; the recursion adds the factors of its rows."""
    n, m, r, recursive = designed.mem
    cost = instructions.joint_terms(designed, plant)
    rows = r * (n + 2)
    cost += rows * rows * (rows + 2 * r + n + m) if recursive else 0
    return cost, cost


def _decentral(designed: Designed, plant: dict[str, Any]) -> tuple[int | None, int | None]:
    n, m, mu, rows, recursive = designed.mem
    if recursive:
        return None, None
    first = np.array(designed.tables.to_json()["first"])
    d = mu - n
    triangle = d * mu - d * d // 2
    typical = (_predict(plant) + m * n + int(np.sum(np.diff(first) ** 2)) + triangle + 2 * n * mu)
    sets = designed.tables.to_json()["sets"]["n_candidates"]
    return typical, typical + sets * (triangle + d * rows)


def _bank(designed: Designed, plant: dict[str, Any]) -> tuple[int, int]:
    n, m = plant["n"], plant["m"]
    tables = designed.tables.to_json()
    h, sets, per_set = tables["horizon"], tables["sets"], tables["per_set"]
    cost = (n * (n + plant["l"] + m) + h * n * (n + m) + sets * per_set * (n + 2)
            + sum(n * n + 2 * mask.bit_count() * (n + 1) for mask in tables["set_mask"])
            + sum(h * n * mask.bit_count() for mask in tables["subset_mask"]))
    return cost, cost


def _guard(designed: Designed, plant: dict[str, Any]) -> tuple[int, int]:
    """Filters, l = S e, fusion and averages; every update adds a block column of S and a look at
    all sensors, a gross attack may need l = S tau once more, a search takes the factors of all
    sets."""
    n, m, r, most = designed.mem
    tables = designed.tables.to_json()
    N, n_u, n_s = m * r, tables["n_u"], n - tables["n_u"]
    product = N * (N - r)
    split = n * n + n_s * N if n_s else 0
    typical = (_predict(plant) + m * n + len(tables["Lam"]) + len(tables["b"]) + product
               + 2 * n_u * N + split + 4 * N)
    rows = most * r
    sets = comb(tables["n_units"], plant["p"]) if tables["search"] else 0
    updates = tables["max_updates"] * (N * r + 6 * N)
    return typical, typical + updates + product + sets * (rows**3 // 6 + rows**2)


#: Multiply-adds as the headers of the modules state them.
COSTS: dict[str, Callable[[Designed, dict[str, Any]], tuple[int | None, int | None]]] = {
    "kalman": _kalman, "lasso": _lasso, "canonical": _lasso, "joint": _joint,
    "decentral": _decentral, "bank": _bank, "guard": _guard,
}
