# SPDX-License-Identifier: MIT
"""Long series made small enough to draw, without losing what matters in them.

A plot is some hundred pixels wide; a recording may have 40,000 steps.  A line keeps the smallest
and the largest value of every bin, so that a spike of one step stays visible; an image keeps a
statistic of every bin.
"""
from __future__ import annotations

import warnings
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def bin_edges(length: int, bins: int) -> NDArray[np.intp]:
    """Edges of at most `bins` bins of nearly equal size, each of one step or more: [b + 1]."""
    return np.linspace(0, length, min(length, bins) + 1).round().astype(np.intp)


def binned(values: NDArray, bins: int, reduce: Callable[..., Array]) -> NDArray:
    """Reduce `values` [T, ...] over time to [b, ...] by a NaN-aware function such as np.nanmax.

    A bin without any finite value gives NaN.
    """
    edges = bin_edges(len(values), bins)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        return np.stack([reduce(values[i:j], axis=0) for i, j in zip(edges[:-1], edges[1:])])


def envelope(t: Array, values: Array, bins: int) -> tuple[Array, Array]:
    """A line of at most 2 `bins` points through the lowest and highest value of every bin.

    `t`, `values` are [T]; gaps (NaN) longer than a bin stay gaps.  Short series stay as they are.
    """
    if len(t) <= 2 * bins:
        return t, values
    low, high = binned(values, bins, np.nanmin), binned(values, bins, np.nanmax)
    edges = bin_edges(len(t), bins)
    middle = (t[edges[:-1]] + t[edges[1:] - 1]) / 2.0
    return np.repeat(middle, 2), np.stack([low, high], axis=1).ravel()


def running_rms(values: Array, window: int) -> Array:
    """Root of the mean square of the last `window` finite values: [T] -> [T].

    NaN until half a window has been seen, and wherever a window holds less than that.
    """
    finite = np.isfinite(values)
    squares = np.where(finite, values, 0.0) ** 2
    kernel = np.ones(window)
    total = np.convolve(squares, kernel)[: len(values)]
    count = np.convolve(finite.astype(float), kernel)[: len(values)]
    enough = count >= window / 2.0
    return np.sqrt(np.divide(total, count, out=np.full(len(values), np.nan), where=enough))


def runs(flags: NDArray[np.bool_], bridge: int = 0) -> list[tuple[int, int]]:
    """Maximal runs [start, stop) of true `flags`; gaps of at most `bridge` steps are closed."""
    padded = np.concatenate([[False], flags, [False]]).astype(np.int8)
    changes = np.diff(padded)
    starts, stops = np.flatnonzero(changes == 1), np.flatnonzero(changes == -1)
    merged: list[tuple[int, int]] = []
    for start, stop in zip(starts.tolist(), stops.tolist()):
        if merged and start - merged[-1][1] <= bridge:
            merged[-1] = (merged[-1][0], stop)
        else:
            merged.append((start, stop))
    return merged
