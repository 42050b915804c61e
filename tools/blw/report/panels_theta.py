# SPDX-License-Identifier: MIT
"""The panel about what was added to the sensors, as methods that estimate it say."""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from blw.report import style, units
from blw.report.data import Recording, Track
from blw.report.panels import Drawn, attack_words, panel
from blw.report.series import Array, binned, envelope
from blw.report.style import Layout

THETA, DEVIATION = "theta:", "theta_sd:"
BAND = 2.0
"""Standard deviations on either side of an estimate that are shown."""


@dataclass(frozen=True)
class Estimate:
    """The signal on one sensor as one method estimates it: [T] each, NaN where it says nothing."""

    track: Track
    sensor: str
    theta: Array
    sd: Array


def estimates(recording: Recording) -> list[Estimate]:
    """All of a recording, by method, then sensor."""
    found = []
    for track in recording.tracks.values():
        for sensor in recording.sensors:
            theta, sd = (track.extra.get(prefix + sensor) for prefix in (THETA, DEVIATION))
            if theta is not None and sd is not None:
                found.append(Estimate(track, sensor, theta, sd))
    return found


@panel("attack_estimates", "Estimated attack signals", lambda r: bool(estimates(r)))
def attack_estimates(recording: Recording, layout: Layout) -> Drawn:
    """One panel per method and sensor: injected signal, estimate, and its standard deviation."""
    shown = estimates(recording)
    names = list(dict.fromkeys(one.track.name for one in shown))
    injected = [Line2D([], [], color=style.TRUTH, lw=4, label="injected")]
    keys = [*(injected if recording.a is not None else []), *style.method_keys(names),
            Patch(color=style.MUTED, alpha=0.3, lw=0, label=f"±{BAND:g} standard deviations"),
            *style.attack_keys(recording)]
    fig, axes = style.grid(layout, len(shown), 1.9, keys, most=2)
    for ax, one in zip(axes, shown):
        style.shade(ax, recording)
        _draw(ax, recording, one, layout)
        ax.set_title(f"{units.label(one.sensor)}, {one.track.name}")
        ax.set_title(_note(recording, one), loc="right", color=style.MUTED, fontsize=8.0)
    return Drawn(
        fig,
        "What a method says was added to a sensor, in the sensor's unit. Beside the names: root "
        "mean square of estimate minus injected signal, and of the standard deviation that the "
        "method states.",
        f"One panel each for {', '.join(f'{e.sensor} by {e.track.name}' for e in shown)}. "
        + attack_words(recording),
    )


def _draw(ax: Axes, recording: Recording, one: Estimate, layout: Layout) -> None:
    tint = style.colour(one.track.name)
    if recording.a is not None:
        signal = recording.a[:, recording.sensors.index(one.sensor)]
        style.line(ax, recording, signal, layout, color=style.TRUTH, lw=4.0, zorder=2)
    t, _ = envelope(recording.t_s, one.theta, layout.bins)
    low, high = one.theta - BAND * one.sd, one.theta + BAND * one.sd
    if len(t) < len(recording.t_s):
        low, high = (np.repeat(binned(edge, layout.bins, reduce), 2)
                     for edge, reduce in ((low, np.nanmin), (high, np.nanmax)))
    ax.fill_between(t, low, high, color=tint, alpha=0.25, linewidth=0, zorder=1.5)
    style.method_line(ax, recording, one.track.name, one.theta, layout)


def _note(recording: Recording, one: Estimate) -> str:
    """Error made and error stated, of the steps in which the sensor had a sample."""
    i = recording.sensors.index(one.sensor)
    there = (recording.k > 0) & np.isfinite(recording.y[:, i]) & np.isfinite(one.theta)
    if recording.a is None or not there.any():
        return ""
    error = one.theta[there] - recording.a[there, i]
    made, stated = (float(np.sqrt(np.mean(v**2))) for v in (error, one.sd[there]))
    return f"error {made:.3g}, stated {stated:.3g}"
