# SPDX-License-Identifier: MIT
"""Panels about trust in the sensors: suspicion, exclusion."""
from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import FixedFormatter, FixedLocator

from blw.report import style
from blw.report.data import Recording, Track
from blw.report.panels import Drawn, any_defended, attack_words, defended, panel
from blw.report.series import Array, binned, runs
from blw.report.style import Layout

SUSPICION_MAP = LinearSegmentedColormap.from_list(
    "suspicion", ["#ffffff", "#e9e3ee", "#c79ac0", "#8c2f7a", "#3b0f3d"]
).with_extremes(bad="#c3d3c9")
RIGHT, WRONG, ATTACKED = "#0072b2", "#d55e00", "#d9d3cc"


@panel("suspicion", "Suspicion of every sensor", any_defended)
def suspicion(recording: Recording, layout: Layout) -> Drawn:
    """Heat maps, sensors by time, one per method; the truly attacked cells are framed."""
    tracks = defended(recording)
    levels = {"no suspicion": 0.0, "at the threshold": 0.5, "sure": 1.0, "no sample": np.nan}
    edge = {"edgecolor": style.MUTED, "linewidth": 0.5}
    keys = [Patch(facecolor=SUSPICION_MAP(v), label=k, **edge) for k, v in levels.items()]
    missing = np.isnan(recording.y)
    fig, axes = _sensor_maps(layout, recording, len(tracks), keys)
    for ax, track in zip(axes, tracks):
        known = np.where(missing, np.nan, track.suspicion)
        _draw_map(ax, recording, SUSPICION_MAP(binned(known, layout.bins, np.nanmax).T))
        style.title(ax, track.name)
    return Drawn(
        fig,
        "From 0 (none) over 0.5 (at the threshold) to 1 (sure); of the steps that share a pixel, "
        "the highest. Frames mark the sensors that really are attacked.",
        f"Heat maps of {len(recording.sensors)} sensors for {', '.join(t.name for t in tracks)}. "
        + attack_words(recording),
    )


def _excluding(recording: Recording) -> list[Track]:
    pairs = recording.tracks.items()
    return [track for name, track in pairs if name != "oracle" and track.excluded.any()]


@panel("excluded", "Excluded sensors", lambda recording: bool(_excluding(recording)))
def excluded(recording: Recording, layout: Layout) -> Drawn:
    """Sensors by time, one map per method that excludes: rightly, wrongly, missed."""
    tracks = _excluding(recording)
    kinds = {"attacked, excluded": RIGHT, "honest, excluded": WRONG, "attacked, in use": ATTACKED}
    shown = kinds if recording.a is not None else {"excluded": WRONG}
    keys = [Patch(color=tint, label=label) for label, tint in shown.items()]
    fig, axes = _sensor_maps(layout, recording, len(tracks), keys)
    for ax, track in zip(axes, tracks):
        _draw_map(ax, recording, _exclusions(recording, track, layout))
        style.title(ax, track.name)
    return Drawn(
        fig,
        "Sensors that the estimate does not use; the depth of a colour is the share of the steps. "
        "Frames mark the sensors that really are attacked.",
        f"Maps for {', '.join(t.name for t in tracks)}. " + attack_words(recording),
    )


def _exclusions(recording: Recording, track: Track, layout: Layout) -> Array:
    """[m, b, 3] colours: white blended towards each kind by its share of the steps."""
    attacked = recording.attacked
    kinds = {
        RIGHT: track.excluded & attacked,
        WRONG: track.excluded & ~attacked,
        ATTACKED: ~track.excluded & attacked,
    }
    shares = [binned(flags.astype(float), layout.bins, np.mean) for flags in kinds.values()]
    away = 1.0 - style.palette(list(kinds))
    blend = 1.0 - sum(s[..., np.newaxis] * tint for s, tint in zip(shares, away))
    return blend.transpose(1, 0, 2).clip(0.0, 1.0)


def _sensor_maps(
    layout: Layout, recording: Recording, count: int, keys: list[Patch]
) -> tuple[Figure, list[Axes]]:
    """Panels with a named row per sensor."""
    names = recording.sensors
    points = 7.5 if len(names) <= 12 else 6.5
    left_in = style.row_labels_in(names, points)
    fig, axes = style.grid(layout, count, 0.4 + 0.145 * len(names), keys, left_in=left_in)
    for ax in axes:
        ax.yaxis.set_major_locator(FixedLocator(range(len(names))))
        ax.yaxis.set_major_formatter(FixedFormatter(names))
        ax.tick_params(axis="y", length=0, labelsize=points)
    return fig, axes


def _draw_map(ax: Axes, recording: Recording, image: Array) -> None:
    """Draw colours [m, b, 3 or 4], sensor 0 on top, and frame what is attacked."""
    style.image(ax, recording, image[::-1], (len(image) - 0.5, -0.5))
    for i, flags in enumerate(recording.attacked.T):
        for start, stop in runs(flags):
            t0, t1 = style.span(recording, start, stop)
            x, y = [t0, t1, t1, t0, t0], i + np.array([-0.5, -0.5, 0.5, 0.5, -0.5])
            ax.plot(x, y, color=style.ALARM, lw=1.2, clip_on=False, zorder=5)
