# SPDX-License-Identifier: MIT
"""Panels about the estimates: how far off, the states themselves, the errors."""
from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from blw.report import style, units
from blw.report.data import Recording
from blw.report.figures import PHASES, collect
from blw.report.panels import Drawn, attack_words, panel
from blw.report.series import Array, running_rms
from blw.report.style import Layout

PHASE_MARKS = {"before": ("o", "none"), "during": ("D", "full"), "after": ("s", "none")}


def error_name(recording: Recording) -> str:
    """What an error is in this recording."""
    base = "oracle's estimate" if recording.yardstick == "oracle" else "truth"
    return f"estimate minus {base}"


def comparable(recording: Recording) -> bool:
    """Errors can be computed."""
    return bool(recording.compared())


def error_norms(recording: Recording) -> dict[str, Array]:
    """{method: [T] Euclidean norm of the error over all states}."""
    names = recording.compared()
    return {name: known_norm(recording.error(name)) for name in names}


def known_norm(error: Array) -> Array:
    """[T, n] -> [T] norm over the states that are known; NaN where none is."""
    norms = np.sqrt(np.nansum(error**2, axis=1))
    return np.where(np.isfinite(error).any(axis=1), norms, np.nan)


def rms_window(recording: Recording) -> int:
    """Steps of the running RMS: long enough to be smooth, short beside an attack."""
    return int(np.clip(len(recording.k) // 100, 10, 400))


@panel("overview", "Error by phase", comparable)
def overview(recording: Recording, layout: Layout) -> Drawn:
    """Root mean square error of every method and phase on one logarithmic scale."""
    figures = collect(recording)
    names = recording.compared()
    rmse = {name: figures[name]["rmse"] for name in names}
    present = [p for p in PHASES[:3] if any(rmse[n][p] for n in names)]
    fig, ax = style.rows_figure(layout, names, 0.27, [_phase_mark(p) for p in present])
    for row, name in enumerate(names):
        _overview_row(ax, row, name, [(p, rmse[name][p]) for p in present])
    ax.set_xscale("log")
    style.plain_log(ax.xaxis)
    ax.set_xlabel(f"RMSE ({units.common(recording.states)})")
    listed = "; ".join(f"{n} {rmse[n]['all']:.3g}" for n in names if rmse[n]["all"])
    return Drawn(
        fig,
        f"Root mean square of the norm of {error_name(recording)} over all states, per phase. "
        "Left is better; a method that resists the attack keeps its marks together.",
        f"One row per method. RMSE over all steps: {listed}.",
    )


def _phase_mark(phase: str) -> Line2D:
    marker, fill = PHASE_MARKS[phase]
    kwargs = {"marker": marker, "fillstyle": fill, "color": style.INK, "linestyle": "none"}
    return Line2D([], [], label=phase, markersize=6, **kwargs)


def _overview_row(ax: Axes, row: int, name: str, values: list[tuple[str, float | None]]) -> None:
    shown = [(phase, value) for phase, value in values if value]
    tint = style.colour(name)
    ax.plot([v for _, v in shown], [row] * len(shown), color=tint, linewidth=1.0, alpha=0.5)
    for phase, value in shown:
        marker, fill = PHASE_MARKS[phase]
        ax.plot(value, row, marker, color=tint, fillstyle=fill, markersize=6.5, markeredgewidth=1.4)


@panel("states", "States")
def states(recording: Recording, layout: Layout) -> Drawn:
    """One panel per state: truth, or the oracle where none is known, and every estimate."""
    label, base = recording.yardstick, recording.base
    names = [name for name in recording.tracks if name != label]
    broad = [Line2D([], [], color=style.TRUTH, lw=4, label=label)] if label else []
    keys = [*broad, *style.method_keys(names), *style.attack_keys(recording)]
    fig, axes = style.grid(layout, len(recording.states), 1.75, keys)
    for j, ax in enumerate(axes):
        style.shade(ax, recording)
        ax.set_title(units.label(recording.states[j]))
        for name in names:
            values = recording.tracks[name].x_hat[:, j]
            style.method_line(ax, recording, name, values, layout)
        if base is not None:
            style.line(ax, recording, base[:, j], layout, color=style.TRUTH, lw=4.0, zorder=2)
            _limit(ax, base[:, j])
    scale = f"; the scale follows the {label} (broad grey)" if label else ""
    return Drawn(
        fig,
        f"Every state and its estimates{scale}.",
        f"Time series of {', '.join(recording.states)} for {', '.join(recording.tracks)}. "
        + attack_words(recording),
    )


def _limit(ax: Axes, base: Array) -> None:
    """Keep the scale within two and a half times the range of what is to be followed."""
    low, high = np.nanmin(base), np.nanmax(base)
    room = 0.75 * max(high - low, 1e-12 + 1e-6 * abs(high))
    bottom, top = ax.get_ylim()
    ax.set_ylim(max(bottom, low - room), min(top, high + room))


@panel("errors", "Error of every method", comparable)
def errors(recording: Recording, layout: Layout) -> Drawn:
    """Small multiples: norm of one method's error, its running RMS, and the oracle's."""
    norms = error_norms(recording)
    window = rms_window(recording)
    smooth = {name: running_rms(values, window) for name, values in norms.items()}
    names = [n for n in norms if n != "oracle"] or list(norms)
    behind = style.method_keys(["oracle"] if "oracle" in smooth else [])
    fig, axes = style.grid(layout, len(names), 1.6, [*behind, *style.attack_keys(recording)])
    log = _needs_log(list(smooth.values()))
    for ax, name in zip(axes, names):
        style.shade(ax, recording)
        values = style.positive(norms[name]) if log else norms[name]
        style.line(ax, recording, values, layout, color=style.colour(name), lw=0.6, alpha=0.35)
        style.line(ax, recording, smooth[name], layout, color=style.colour(name), lw=1.5)
        if "oracle" in smooth and name != "oracle":
            dotted = {"color": style.colour("oracle"), "linestyle": style.dashes("oracle")}
            style.line(ax, recording, smooth["oracle"], layout, lw=1.2, **dotted)
        style.title(ax, name)
    _share_scale(axes, log)
    return Drawn(
        fig,
        f"Norm of {error_name(recording)} over all states "
        f"({units.common(recording.states)}), pale, and its running root mean square over "
        f"{window} steps; {'logarithmic, ' if log else ''}one scale for all panels. "
        f"{_oracle_words(recording)}",
        f"One panel each for {', '.join(names)}. " + attack_words(recording),
    )


def _oracle_words(recording: Recording) -> str:
    if recording.yardstick == "oracle":
        return "No truth is known here: the yardstick is the oracle itself."
    if "oracle" not in recording.tracks:
        return ""
    return "The oracle is the Kalman filter that knows which sensors are attacked."


def _needs_log(series: list[Array]) -> bool:
    return style.spans_decades(np.concatenate(series))


def _share_scale(axes: list[Axes], log: bool) -> None:
    for ax in axes[1:]:
        ax.sharey(axes[0])
    if log:
        axes[0].set_yscale("log")
        bottom, top = axes[0].get_ylim()
        axes[0].set_ylim(max(bottom, top * 1e-7), top)
        style.plain_log(axes[0].yaxis)
    else:
        axes[0].set_ylim(bottom=0.0)


@panel("state_errors", "Error of every state", comparable)
def state_errors(recording: Recording, layout: Layout) -> Drawn:
    """One panel per state: running RMS of every method's error."""
    window = rms_window(recording)
    names = recording.compared()
    keys = [*style.method_keys(names), *style.attack_keys(recording)]
    fig, axes = style.grid(layout, len(recording.states), 1.75, keys)
    for j, ax in enumerate(axes):
        style.shade(ax, recording)
        curves = {n: running_rms(recording.error(n)[:, j], window) for n in names}
        log = _needs_log(list(curves.values()))
        for name, curve in curves.items():
            values = style.positive(curve) if log else curve
            style.method_line(ax, recording, name, values, layout)
        _share_scale([ax], log)
        ax.set_title(units.label(recording.states[j]))
    return Drawn(
        fig,
        f"Running root mean square (last {window} steps) of {error_name(recording)}, "
        "one panel per state, in the state's unit.",
        f"Error curves of {', '.join(names)} for {', '.join(recording.states)}. "
        + attack_words(recording),
    )
