# SPDX-License-Identifier: MIT
"""The figures of docs/recorded.md on gains for sensors that send in a share of the steps.

PYTHONPATH=tools build/venv/bin/python docs/gap_figures.py
"""

import numpy as np

from blw import gaps
from blw.errors import DesignError
from blw.kalman import steady_state

PLANTS = 48
STEPS = 2000
SETTLING = 100
PATTERNS = ("independent", "common", "periodic")
GAINS = ("plain", "R / q", "0", "0.5", "1")
LIMIT = 1e6  # error in units of the time-varying filter's: it has no bound


def plant(generator):
    """A, C, W, R, rate of a random plant: turning, integrating or decaying modes."""
    n, m = int(generator.integers(2, 6)), int(generator.integers(5, 10))
    kind = generator.integers(3)
    if kind == 0:
        A = generator.standard_normal((n, n))
        A *= generator.choice([0.9, 0.99, 1.0]) / np.abs(np.linalg.eigvals(A)).max()
    elif kind == 1:
        A = np.eye(n) + np.diag(np.full(n - 1, 0.05), 1)
    else:
        A = np.diag(np.linspace(0.7, 0.999, n))
    lost = generator.uniform(0.3, 0.85)
    rate = np.where(generator.random(m) < 0.5, 1.0, 1.0 - lost)
    return (A, generator.standard_normal((m, n)), np.diag(10.0 ** generator.uniform(-3, 0, n)),
            np.diag(10.0 ** generator.uniform(-1, 1, m)), rate)


def gain(kind, A, C, W, R, rate):
    """K [n, m] on samples, None if there is none."""
    if kind == "plain":
        return steady_state(A, C, W, R).K
    if kind == "R / q":
        return steady_state(A, C, W, R / np.sqrt(np.outer(rate, rate))).K / rate
    gaps.TOGETHER = float(kind)
    try:
        return gaps.steady(A, C, W, R, 1.0 / rate)[0].K / rate
    except DesignError:
        return None


def sent(pattern, rate, generator):
    """[STEPS, m] which samples come."""
    if pattern == "independent":
        return generator.random((STEPS, rate.size)) < rate
    if pattern == "common":
        return generator.random((STEPS, 1)) < rate
    k = np.arange(STEPS)[:, None] + generator.integers(0, 100, rate.size)
    return np.floor((k + 1) * rate) > np.floor(k * rate)


def simulate(A, C, W, R, gains, come, generator):
    """Root mean square error of every gain over that of the filter that knows which come."""
    n, m = len(A), len(C)
    w = generator.standard_normal((STEPS, n)) @ np.sqrt(W)
    v = generator.standard_normal((STEPS, m)) @ np.sqrt(R)
    K = np.array([np.full((n, m), np.nan) if K is None else K for K in gains])
    e, best, P = np.zeros((len(K), n)), np.zeros(n), np.zeros((n, n))
    squares = []
    with np.errstate(over="ignore", invalid="ignore"):
        for k in range(STEPS):
            e = e @ A.T + w[k]
            e = e - np.einsum("gim,gm->gi", K, come[k] * (e @ C.T + v[k]))
            best, P = A @ best + w[k], A @ P @ A.T + W
            there = np.flatnonzero(come[k])
            L = np.linalg.solve(C[there] @ P @ C[there].T + R[np.ix_(there, there)], C[there] @ P).T
            best, P = best - L @ (C[there] @ best + v[k][there]), P - L @ C[there] @ P
            squares.append(np.vstack([e, best]) ** 2)
        mean = np.mean(squares[SETTLING:], axis=0)
        ratio = np.sqrt(np.mean(mean[:-1] / mean[-1], axis=1))
    return np.where(ratio < LIMIT, ratio, np.inf)


def main():
    """Median and largest error of the plants for which a gain is stable, and for how many not."""
    found = {pattern: [] for pattern in PATTERNS}
    for seed in range(PLANTS):
        generator = np.random.default_rng(seed)
        A, C, W, R, rate = plant(generator)
        gains = [gain(kind, A, C, W, R, rate) for kind in GAINS]
        for pattern in PATTERNS:
            come = sent(pattern, rate, generator)
            found[pattern].append(simulate(A, C, W, R, gains, come, generator))
    print(f"{PLANTS} plants; error over that of the filter that knows which samples come:")
    print("gaps         " + "".join(f"{kind:>24}" for kind in GAINS))
    for pattern, ratios in found.items():
        cells = []
        for column in np.array(ratios).T:
            finite = column[np.isfinite(column)]
            unstable = len(column) - len(finite)
            cells.append(f"{np.median(finite):.2f} ({finite.max():.2f}), {unstable} unstable")
        print(f"{pattern:13}" + "".join(f"{cell:>24}" for cell in cells))


if __name__ == "__main__":
    main()
