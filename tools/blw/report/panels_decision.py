# SPDX-License-Identifier: MIT
"""Panels about the decisions of every step: statistic, outcome, work."""
from __future__ import annotations

import re

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from blw.report import style
from blw.report.data import Recording, Track
from blw.report.figures import phases
from blw.report.panels import Drawn, any_defended, attack_words, defended, panel
from blw.report.series import Array, bin_edges
from blw.report.style import Layout

OUTCOMES = {
    "no output": "#ffffff",
    "kalman": "#d6dde4",
    "converged": "#56b4e9",
    "bound": "#e69f00",
    "held": "#a3172e",
    "other": "#332288",
}
OUTCOME = re.compile("|".join(name for name in OUTCOMES if name not in ("no output", "other")))
STRIP_ROWS = 40
MANY_THRESHOLDS = 50.0
LOWEST = 1e-2
"""Of a threshold: where a logarithmic axis begins."""


@panel("statistic", "Statistic against threshold", any_defended)
def statistic(recording: Recording, layout: Layout) -> Drawn:
    """Small multiples: the statistic of one method and what it is held against."""
    tracks = defended(recording)
    threshold = {"color": style.INK, "linewidth": 1.2, "linestyle": (0, (4, 2))}
    keys = [Line2D([], [], label="threshold", **threshold), *style.attack_keys(recording)]
    fig, axes = style.grid(layout, len(tracks), 1.5, keys, most=3)
    for ax, track in zip(axes, tracks):
        style.shade(ax, recording)
        level = np.where(track.tested, track.threshold, np.nan)
        log = _needs_log(track.statistic / level)
        values = style.positive(track.statistic) if log else track.statistic
        style.line(ax, recording, values, layout, color=style.colour(track.name), lw=0.8)
        style.line(ax, recording, level, layout, **threshold)
        if log:
            ax.set_yscale("log")
            ax.set_ylim(bottom=max(ax.get_ylim()[0], LOWEST * np.nanmin(level)))
            style.plain_log(ax.yaxis)
        style.title(ax, track.name, _alarm_note(recording, track))
    return Drawn(
        fig,
        "What each method holds against its threshold (dimensionless); above it the method stops "
        "trusting all sensors. Beside the names: share of the steps above it, without attack and "
        "in attack.",
        f"One panel each for {', '.join(t.name for t in tracks)}. " + attack_words(recording),
    )


def _needs_log(ratio: Array) -> bool:
    """Of statistic over threshold [T]: most of it would lie flat on a linear axis."""
    return style.spans_decades(ratio) or bool(np.any(ratio > MANY_THRESHOLDS))


def _alarm_note(recording: Recording, track: Track) -> str:
    masks = phases(recording)
    during = masks["during"] & track.present
    quiet = masks["all"] & ~masks["during"] & track.present
    words = [f"above {100 * np.mean(track.alarm[quiet]):.2g} %"] if quiet.any() else []
    if during.any():
        words.append(f"in attack {100 * np.mean(track.alarm[during]):.3g} %")
    return ", ".join(words)


@panel("outcome", "Outcome of every step", any_defended)
def outcome(recording: Recording, layout: Layout) -> Drawn:
    """Small multiples: share of the steps that ended with each outcome."""
    tracks = defended(recording)
    codes = {track.name: _codes(track) for track in tracks}
    seen = sorted({code for row in codes.values() for code in row[recording.k > 0].tolist()})
    names = list(OUTCOMES)
    edge = {"edgecolor": style.MUTED, "linewidth": 0.5}
    keys: list = [Patch(facecolor=OUTCOMES[names[c]], label=names[c], **edge) for c in seen]
    if recording.episodes:
        keys.append(Line2D([], [], color=style.ALARM, lw=2.5, label="attack"))
    fig, axes = style.grid(layout, len(tracks), 0.8, keys, left_in=style.RIGHT_IN)
    for ax, track in zip(axes, tracks):
        _strip(ax, recording, codes[track.name], layout)
        style.title(ax, track.name)
    return Drawn(
        fig,
        "kalman: nothing suspicious, exactly the Kalman estimate; converged: a secure estimate, "
        "computed to the end; bound: the bound on work was reached; held: no hypothesis passed. "
        "The height of a colour is its share of the steps.",
        f"One strip each for {', '.join(t.name for t in tracks)}. " + attack_words(recording),
    )


def _codes(track: Track) -> NDArray[np.int64]:
    """[T] index into OUTCOMES from the text of the status, which may carry flags too."""
    codes = {"": 0}
    for text in set(track.status.tolist()) - {""}:
        match = OUTCOME.search(text)
        codes[text] = list(OUTCOMES).index(match.group() if match else "other")
    return np.array([codes[text] for text in track.status.tolist()])


def _strip(ax: Axes, recording: Recording, codes: NDArray[np.int64], layout: Layout) -> None:
    edges = bin_edges(len(codes), layout.bins)
    image = np.empty((STRIP_ROWS, len(edges) - 1), dtype=np.int64)
    for b, (i, j) in enumerate(zip(edges[:-1], edges[1:])):
        image[:, b] = np.sort(codes[i:j])[np.arange(STRIP_ROWS) * (j - i) // STRIP_ROWS]
    style.image(ax, recording, style.palette(list(OUTCOMES.values()))[image], (0.0, 1.0))
    ax.set_yticks([])
    ax.set_ylim(-0.25, 1.0)
    ax.spines["left"].set_visible(False)
    for start, stop in recording.episodes:
        span = style.span(recording, start, stop)
        ax.plot(span, [-0.12, -0.12], color=style.ALARM, lw=2.5, solid_capstyle="butt")


def _iterating(recording: Recording) -> list[Track]:
    return [track for track in recording.tracks.values() if np.nansum(track.iterations) > 0]


@panel("iterations", "Iterations", lambda recording: bool(_iterating(recording)))
def iterations(recording: Recording, layout: Layout) -> Drawn:
    """Small multiples: iterations of every method's solver that ever iterates."""
    tracks = _iterating(recording)
    keys = style.attack_keys(recording)
    fig, axes = style.grid(layout, len(tracks), 1.4, keys, most=3)
    for ax, track in zip(axes, tracks):
        style.shade(ax, recording)
        style.line(ax, recording, track.iterations, layout, color=style.colour(track.name), lw=0.8)
        ax.set_ylim(bottom=0.0)
        ax.yaxis.set_major_locator(MaxNLocator(4, integer=True, steps=style.STEPS))
        mean, most = np.nanmean(track.iterations), np.nanmax(track.iterations)
        style.title(ax, track.name, f"mean {mean:.3g}, most {most:.0f}")
    return Drawn(
        fig,
        "Iterations (pivots or passes) per step; 0 where the certificate held.",
        f"One panel each for {', '.join(t.name for t in tracks)}. " + attack_words(recording),
    )
