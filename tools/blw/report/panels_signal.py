# SPDX-License-Identifier: MIT
"""Panels about what went in: known inputs, injected attacks, samples."""
from __future__ import annotations

import numpy as np
from matplotlib.lines import Line2D

from blw.report import style, units
from blw.report.data import Recording
from blw.report.panels import Drawn, attack_words, panel
from blw.report.series import Array
from blw.report.style import Layout

GAPPY = 0.05
"""Share of missing samples from which single ones are drawn as dots: a line would show nothing."""


@panel("signals", "Inputs and injected attacks", lambda r: bool(r.inputs) or bool(r.episodes))
def signals(recording: Recording, layout: Layout) -> Drawn:
    """Known inputs, and the attack signal of every attacked sensor."""
    hit = np.flatnonzero(recording.attacked.any(axis=0)).tolist()
    names = [recording.sensors[i] for i in hit]
    titles = [f"input {units.label(name)}" for name in recording.inputs]
    titles += [f"attack on {units.label(name)}" for name in names]
    columns = [*recording.u.T, *(_attack(recording, i) for i in hit)]
    keys = style.attack_keys(recording)
    fig, axes = style.grid(layout, len(titles), 1.45, keys)
    for number, (ax, title, values) in enumerate(zip(axes, titles, columns)):
        tint = style.INK if number < len(recording.inputs) else style.ALARM
        style.shade(ax, recording)
        style.line(ax, recording, values, layout, color=tint, lw=0.9)
        ax.set_title(title)
        if number >= len(recording.inputs) and not values.any():
            ax.set_title("samples withheld", loc="right", color=style.MUTED, fontsize=8.0)
    return Drawn(
        fig,
        "Known inputs u and what the attacker adds to the samples of a sensor.",
        f"Inputs: {', '.join(recording.inputs) or 'none'}; attacked sensors: "
        f"{', '.join(names) or 'none'}. " + attack_words(recording),
    )


def _attack(recording: Recording, i: int) -> Array:
    """[T] attack on sensor i; where there was no sample, between those on the samples beside it."""
    there = np.isfinite(recording.y[:, i])
    if recording.a is None or not there.any():
        return np.zeros(len(recording.k))
    return np.interp(recording.t_s, recording.t_s[there], recording.a[there, i])


@panel("sensors", "Samples of every sensor")
def sensors(recording: Recording, layout: Layout) -> Drawn:
    """One panel per sensor: samples as the estimators got them, attacked ones in red."""
    keys: list = [Line2D([], [], color=style.INK, label="honest")]
    if recording.episodes:
        keys.append(Line2D([], [], color=style.ALARM, label="attacked"))
    keys += style.attack_keys(recording)
    fig, axes = style.grid(layout, len(recording.sensors), 1.2, keys)
    for i, ax in enumerate(axes):
        style.shade(ax, recording)
        bad, y = recording.attacked[:, i], recording.y[:, i]
        gaps = float(np.mean(np.isnan(y[recording.k > 0])))
        dots = {"marker": ".", "markersize": 1.5} if gaps > GAPPY else {}
        for part, tint in ((~bad, style.INK), (bad, style.ALARM)):
            values = np.where(part, y, np.nan)
            style.line(ax, recording, values, layout, color=tint, lw=0.7, **dots)
        ax.set_title(units.label(recording.sensors[i]))
        note = f"{100 * gaps:.2g} % missing" if gaps > 0 else ""
        ax.set_title(note, loc="right", color=style.MUTED, fontsize=8.0)
    return Drawn(
        fig,
        "What the sensors said, with the injected attack; gaps are missing samples.",
        f"Time series of {', '.join(recording.sensors)}. " + attack_words(recording),
    )
