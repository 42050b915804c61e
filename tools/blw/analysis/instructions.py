# SPDX-License-Identifier: MIT
"""Instructions of a step without alarm on a Cortex-M4F: float, gcc -O3, no contraction.

What a step does is counted in the tables: multiply-adds of the loops, operations of the
straight-line code, sensors and sets that are looked at.  What each of these takes is measured, and
the tests hold the formulas to 10 % of every row of docs/cost.md.  What `lasso` and `canonical` do
depends on the data: l1_instructions.py.
"""

import re
from collections.abc import Callable
from typing import Any

import numpy as np

from blw.design import Designed
from blw.tables import Code

#: kalman: around the straight-line code, and a multiply-add of the loops.
KALMAN_AROUND = 48
KALMAN_LOOP = 10.6

#: decentral: around all, a sensor or row of a product, a multiply-add.
DECENTRAL_AROUND = 1650
DECENTRAL_ROW = 33
DECENTRAL_LOOP = 5.9

#: bank: around all, a multiply-add, a sample of a block of a subset, a test of a set.
BANK_AROUND = 3720
BANK_LOOP = 7.35
BANK_SAMPLE = 16.8
BANK_TEST = 233

#: joint: around all, a sensor of the plant or of a local estimator, a local estimator, a
#: multiply-add; with the recursion, where the rest no longer counts: see _joint().
JOINT_AROUND = 624
JOINT_SENSOR = 41
JOINT_LOCAL = 594
JOINT_LOOP = 7.53
JOINT_FACTOR = 8.39
JOINT_SAMPLE = 27.9
JOINT_ROW = 49.4

#: guard: a sensor, an operation of the straight-line code (registers that run out included), and a
#: multiply-add of the loops.
GUARD_SENSOR = 62
GUARD_OPERATION = 1.22
GUARD_LOOP = 3.9

_NUMBER = re.compile(r"BLW_R\((-?)([0-9.e+-]+)\)")
_ELEMENT = re.compile(r"\w+\[\d+\]")
_SUM = re.compile(r" [+-]=? ")


def operations(code: Code) -> int:
    """Products, sums, and loads and stores of different numbers in straight-line code."""
    text = " ".join(code.body)
    constants = {found[2] for found in _NUMBER.finditer(text)}
    bare = _NUMBER.sub("K", text)
    return (bare.count(" * ") + len(_SUM.findall(bare)) + len(constants)
            + len(set(_ELEMENT.findall(bare))))


def typical(name: str, designed: Designed, plant: dict[str, Any]) -> int | None:
    """Of the method `name`; None if it is not modelled.  plant: its tables as JSON."""
    formula = FORMULAS.get(name)
    return None if formula is None else formula(designed, plant)


def _kalman(designed: Designed, plant: dict[str, Any]) -> int:
    step = designed.tables.members["step"]
    if isinstance(step, Code):
        return KALMAN_AROUND + operations(step)
    n, m = plant["n"], plant["m"]
    samples = m if designed.tables.members["Acl"] else 2 * m
    return KALMAN_AROUND + round(KALMAN_LOOP * n * (n + plant["l"] + samples))


def _decentral(designed: Designed, plant: dict[str, Any]) -> int | None:
    n, m, mu, _, recursive = designed.mem
    if recursive:
        return None
    local = np.diff(designed.tables.to_json()["first"])
    d = mu - n
    macs = (n * (n + plant["l"]) + m * n + int(local @ local) + d * mu - d * d // 2 + 2 * n * mu)
    return DECENTRAL_AROUND + round(DECENTRAL_ROW * (m + mu) + DECENTRAL_LOOP * macs)


def _bank(designed: Designed, plant: dict[str, Any]) -> int:
    """After the warm-up."""
    n, m = plant["n"], plant["m"]
    tables = designed.tables.to_json()
    h, sets = tables["horizon"], tables["sets"]
    pairs = sets * tables["per_set"]
    members = sum(mask.bit_count() for mask in tables["set_mask"])
    samples = h * sum(mask.bit_count() for mask in tables["subset_mask"])
    filters = n * (n + plant["l"] + m) + sets * n * n + 2 * members * n
    tests = samples * n + h * n * (n + m) + pairs * n
    return BANK_AROUND + round(BANK_LOOP * (filters + tests) + BANK_SAMPLE * samples
                               + BANK_TEST * pairs)


def joint_terms(designed: Designed, plant: dict[str, Any]) -> int:
    """Multiply-adds of the filters and the fusion by a schedule."""
    n, m, r, _ = designed.mem
    samples = len(designed.tables.to_json()["sensor"])
    return n * (n + plant["l"]) + m * n + (2 * r - 1) * n * n + samples * (2 * n + 2)


def _joint(designed: Designed, plant: dict[str, Any]) -> int:
    """The recursion factors its R rows of the length W, and every sample corrects the n + 2 rows of
    its local estimator."""
    n, m, r, recursive = designed.mem
    samples = len(designed.tables.to_json()["sensor"])
    if recursive:
        R = r * (n + 2)
        W = R + 2 * r + n + m
        return round(W * (JOINT_FACTOR * R * R + JOINT_SAMPLE * samples * (n + 2) + JOINT_ROW * R))
    return JOINT_AROUND + round(JOINT_SENSOR * (m + samples) + JOINT_LOCAL * r
                                + JOINT_LOOP * joint_terms(designed, plant))


def _guard(designed: Designed, plant: dict[str, Any]) -> int:
    n, m, r, _ = designed.mem
    tables, N = designed.tables.to_json(), m * r
    n_u, n_s = tables["n_u"], n - tables["n_u"]
    loops = {
        "advance": n * (n + plant["l"]) + m * n + len(tables["Lam"]) + len(tables["b"]),
        "multiply": N * (N - r),
        "squares": 2 * N,
        "average": 2 * N,
        "fuse": 2 * n_u * N + (n * n + n_s * N if n_s else 0),
    }
    straight = {part: designed.tables.members[part] for part in loops}
    done = {part: operations(code) for part, code in straight.items() if isinstance(code, Code)}
    done["squares"] = 2 * done.get("squares", 0)  # of e and of l
    rest = sum(macs for part, macs in loops.items() if not done.get(part))
    return round(GUARD_SENSOR * m + GUARD_OPERATION * sum(done.values()) + GUARD_LOOP * rest)


FORMULAS: dict[str, Callable[[Designed, dict[str, Any]], int | None]] = {
    "kalman": _kalman, "joint": _joint, "decentral": _decentral, "bank": _bank, "guard": _guard,
}
