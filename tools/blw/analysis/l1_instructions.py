# SPDX-License-Identifier: MIT
"""Instructions of a step of `lasso` and `canonical` on a Cortex-M4F: float, gcc -O3.

How many sweeps, pivots or Newton steps a step needs, and how large they are, only a run of the
engine tells: l1_work.py counts what the C library does on simulated samples of the plant, and here
stands what each of the things counted takes.  A price includes what goes with it, such as the loop
over the groups around a norm.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blw.analysis.l1_work import WINDOW, Work, affordable, count, one_by_one
from blw.design import Design

Array = NDArray[np.float64]

METHODS = ("lasso", "canonical")

#: Per step, row of zeta, row in every iteration, element of the triangle that a sweep of the
#: tableau goes through, per call and element of what l1_work.py counts, and per row where something
#: is moved: on the tableau mostly a column, for a sweep or to see which row leaves.
Prices = Mapping[str, float]

#: Least squares over estimators of plants drawn at random, 1 to 7 states, 3 to 9 sensors, each with
#: and without attack: 34 for the Newton engine, 25 for the others.  The models that the tests hold
#: them against are not among them.
PRICES: dict[str, Prices] = {
    "tableau, straight-line": {
        "row": 189.0, "sweep element": 2.52, "move row": 39.6, "symv": 320.0, "symv element": 4.43,
        "factor": 3080.0, "factor element": 13.8,
    },
    "tableau": {
        "row": 226.0, "sweep element": 6.33, "move": 111.0, "move row": 39.0, "symv": 962.0,
        "symv element": 1.29, "gemv element": 11.5, "factor": 13500.0, "factor element": 6.62,
    },
    "active_set": {
        "step": 3435.0, "dot": 18.9, "dot element": 6.23, "axpy": 172.0, "axpy element": 8.99,
        "gemv element": 3.32, "trapv element": 7.13, "trapv_t element": 12.5, "solve": 303.0,
        "solve element": 7.46, "norm": 67.3,
    },
    "newton": {
        "iteration row": 169.0, "dot": 257.0, "symv": 373.0, "symv element": 3.67,
        "axpy element": 65.0, "move element": 133.0, "gemv element": 17.7, "factor element": 4.28,
        "matrix element": 25.0,
    },
}


def expected(design: Design, method: str) -> tuple[int, int] | None:
    """Instructions without attack (the median of WINDOW steps, on average) and under the attack of
    l1_work.one_by_one() (the mean); None where the engine is not modelled, there is no C compiler,
    or so many rows that a step takes too long."""
    prices = prices_of(design, method)
    N = design.methods[method].tables.to_json()["l1"]["N"]
    steps = affordable(N)
    if prices is None or steps == 0:
        return None
    counted = count(design, method, one_by_one(design, steps), steps)
    if counted is None:
        return None
    benign, attacked = (instructions(work, N, prices) for work in counted)
    return round(typical(benign)), round(float(np.mean(attacked)))


def typical(benign: Array) -> float:
    """What `bench` calls typical, as it is on average: it depends little on whether the median is,
    say, 3 or 4 pivots."""
    return float(np.mean(np.median(benign.reshape(-1, WINDOW), axis=1)))


def prices_of(design: Design, method: str) -> Prices | None:
    l1: Any = design.methods[method].tables.members["l1"]
    engine = l1.to_json()["engine"]
    if engine == "tableau" and l1.members["fast"] is not None:
        engine = "tableau, straight-line"
    return PRICES.get(engine)


def instructions(work: Work, N: int, prices: Prices) -> Array:
    """[steps] of steps with this work, N rows of zeta."""
    counts: dict[str, Array | float] = {
        "step": 1.0,
        "row": float(N),
        "sweep element": work.iterations * (N * (N + 1) // 2),
        "iteration row": work.iterations * N,
        "move row": work.calls["move"] * N,
        **work.calls,
        **{f"{kernel} element": values for kernel, values in work.elements.items()},
    }
    total = np.zeros_like(work.iterations)
    for what, price in prices.items():
        total = total + price * counts[what]
    return total
