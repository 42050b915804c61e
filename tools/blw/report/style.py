# SPDX-License-Identifier: MIT
"""How every plot looks: one colour per method, grids of panels, shaded attacks.

The colours are those of Okabe and Ito, which people with any common colour blindness can tell
apart, with two dark ones of Tol's added; line patterns differ too, so that a grey print can be
read.
"""
from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter, MaxNLocator, NullFormatter

from blw.report.data import Recording
from blw.report.series import Array, envelope

INK, MUTED, RULE = "#1b1f24", "#5c6670", "#d5dae0"
TRUTH, ATTACK, ALARM = "#b4bcc6", "#f9e0d2", "#a3172e"
METHOD_STYLES = {
    "oracle": ("#000000", (0, (1, 1))),
    "kalman": ("#767676", (0, (5, 1.5))),
    "lasso": ("#0072b2", "-"),
    "canonical": ("#56b4e9", (0, (4, 1, 1, 1))),
    "joint": ("#cc79a7", "-"),
    "decentral": ("#009e73", "-"),
    "bank": ("#e69f00", "-"),
    "guard": ("#d55e00", "-"),
    "augmented": ("#882255", (0, (3, 1))),
    "augmented_blind": ("#c8659a", (0, (1, 1.5))),
    "adaptive": ("#661100", (0, (5, 1, 1, 1))),
    "strong_kalman": ("#117733", (0, (2, 1))),
    "central_kalman": ("#44aa99", (0, (4, 2))),
}
LEGEND_ROW_IN, TITLE_IN, TIME_IN, LABELS_IN, RIGHT_IN = 0.2, 0.3, 0.44, 0.56, 0.22
STEPS = [1, 2, 2.5, 5, 10]
SPARE_COLOURS = ("#999933", "#1f5f5b", "#7a4f9a", "#8a6d3b")

RC = {
    "font.family": "DejaVu Sans",
    "font.size": 9.0,
    "axes.titlesize": 9.0,
    "axes.titlelocation": "left",
    "axes.labelsize": 8.5,
    "axes.labelcolor": INK,
    "axes.edgecolor": MUTED,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": RULE,
    "grid.linewidth": 0.5,
    "axes.axisbelow": True,
    "xtick.color": MUTED,
    "ytick.color": MUTED,
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "lines.linewidth": 1.1,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "text.parse_math": False,
}


@dataclass(frozen=True)
class Layout:
    """A medium: a plot `width_in` inches wide with at most `columns` panels side by side."""

    width_in: float
    columns: int
    dpi: int
    bins: int  # time bins of one panel


WIDE = Layout(width_in=9.4, columns=4, dpi=150, bins=420)
NARROW = Layout(width_in=4.3, columns=1, dpi=150, bins=420)


def colour(name: str) -> str:
    """The colour of a method, the same in every plot and in the page."""
    if name in METHOD_STYLES:
        return METHOD_STYLES[name][0]
    return SPARE_COLOURS[sum(name.encode()) % len(SPARE_COLOURS)]


def dashes(name: str) -> str | tuple:
    """The line pattern of a method."""
    return METHOD_STYLES[name][1] if name in METHOD_STYLES else "-"


def columns_for(count: int, most: int) -> int:
    """Panels side by side, at most `most`: up to three are one row, four are two by two, of more
    there are three or four, whichever leaves less empty."""
    if count <= 4:
        return min(most, {4: 2}.get(count, count))
    return min(range(min(most, 3), most + 1), key=lambda c: (-count % c, c))


def grid(
    layout: Layout,
    count: int,
    height_in: float,
    keys: Sequence[Artist] = (),
    most: int = 4,
    left_in: float = LABELS_IN,
) -> tuple[Figure, list[Axes]]:
    """A figure of `count` panels over time, at most `most` side by side, under a legend of `keys`.

    `height_in` is that of a panel with its title, `left_in` the room for the labels of its rows.
    """
    columns = columns_for(count, min(most, layout.columns))
    rows = -(-count // columns)
    legend_in = _legend_rows(layout, keys) * LEGEND_ROW_IN
    size = (layout.width_in, legend_in + rows * height_in + TIME_IN)
    fig = Figure(figsize=size, dpi=layout.dpi)
    _legend(fig, layout, keys)
    axes = []
    for i in range(count):
        left = (i % columns) * size[0] / columns + left_in
        bottom = TIME_IN + (rows - 1 - i // columns) * height_in
        wide, high = size[0] / columns - left_in - RIGHT_IN, height_in - TITLE_IN
        box = (left / size[0], bottom / size[1], wide / size[0], high / size[1])
        axes.append(_panel(fig, box, i + columns >= count))
        if i >= (rows - 1) * columns:
            axes[-1].set_xlabel("time (s)")
    return fig, axes


def _panel(fig: Figure, box: tuple[float, float, float, float], last: bool) -> Axes:
    """An empty panel; the last one of a column carries the numbers of the time axis."""
    ax = fig.add_axes(box)
    ax.xaxis.set_major_locator(MaxNLocator(5, steps=STEPS))
    ax.tick_params(labelbottom=last)
    ax.yaxis.set_major_locator(MaxNLocator(4, steps=STEPS))
    ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: number(value)))
    return ax


def number(value: float) -> str:
    """A tick's value without an offset or a multiplier, with a true minus sign."""
    return f"{value:.7g}".replace("-", "\N{MINUS SIGN}")


def row_labels_in(names: Sequence[str], points: float) -> float:
    """Inches that names need to the left of a panel."""
    return 0.12 + max(len(name) for name in names) * points * 0.62 / 72.0


def _legend_columns(layout: Layout, keys: Sequence[Artist]) -> int:
    widest_in = 0.62 + 0.075 * max(len(key.get_label()) for key in keys)
    return min(len(keys), max(1, int(layout.width_in / widest_in)))


def _legend_rows(layout: Layout, keys: Sequence[Artist]) -> int:
    return -(-len(keys) // _legend_columns(layout, keys)) if keys else 0


def _legend(fig: Figure, layout: Layout, keys: Sequence[Artist]) -> None:
    if keys:
        place = {"loc": "upper left", "borderaxespad": 0.1, "handlelength": 2.2}
        fig.legend(handles=keys, ncols=_legend_columns(layout, keys), **place)


def rows_figure(
    layout: Layout, names: Sequence[str], row_in: float, keys: Sequence[Artist]
) -> tuple[Figure, Axes]:
    """A figure of one panel with a named row, `row_in` high, for every name."""
    legend_in = _legend_rows(layout, keys) * LEGEND_ROW_IN
    size = (layout.width_in, legend_in + row_in * len(names) + TIME_IN + 0.1)
    fig = Figure(figsize=size, dpi=layout.dpi)
    _legend(fig, layout, keys)
    left = row_labels_in(names, 8.0)
    wide, high = size[0] - left - RIGHT_IN, row_in * len(names)
    box = (left / size[0], TIME_IN / size[1], wide / size[0], high / size[1])
    ax = fig.add_axes(box)
    ax.set_yticks(range(len(names)), names)
    ax.tick_params(axis="y", length=0)
    ax.set_ylim(len(names) - 0.5, -0.5)
    ax.grid(axis="y", visible=False)
    return fig, ax


def shade(ax: Axes, recording: Recording) -> None:
    """Shade the attack intervals and fix the time axis."""
    t = recording.t_s
    for start, stop in recording.episodes:
        ax.axvspan(*span(recording, start, stop), color=ATTACK, linewidth=0, zorder=0)
    ax.set_xlim(t[0], t[-1] if t[-1] > t[0] else t[0] + 1.0)


def span(recording: Recording, start: int, stop: int) -> tuple[float, float]:
    """Times between which rows [start, stop) lie."""
    t = recording.t_s
    return float(t[start]), float(t[min(stop, len(t) - 1)])


def image(ax: Axes, recording: Recording, colours: Array, vertical: tuple[float, float]) -> None:
    """Draw colours [rows, bins, 3 or 4] over time, first row at vertical[0]."""
    t = recording.t_s
    end = t[-1] if t[-1] > t[0] else t[0] + 1.0
    box = (t[0], end, *vertical)
    ax.imshow(colours, aspect="auto", extent=box, origin="lower", interpolation="nearest")
    ax.grid(visible=False)


def palette(colours: list[str]) -> Array:
    """[len(colours), 3] red, green and blue, 0 .. 1."""
    return np.array([to_rgb(c) for c in colours])


def line(ax: Axes, recording: Recording, values: Array, layout: Layout, **kwargs: object) -> None:
    """Draw a series [T] as its envelope."""
    ax.plot(*envelope(recording.t_s, values, layout.bins), **kwargs)


def method_line(ax: Axes, recording: Recording, name: str, values: Array, layout: Layout) -> None:
    """Draw a series of one method in its colour and pattern; the yardsticks lie below the rest."""
    z = {"oracle": 2.2, "kalman": 2.5}.get(name, 3)
    pattern = {"color": colour(name), "linestyle": dashes(name), "zorder": z}
    line(ax, recording, values, layout, linewidth=1.2, **pattern)


def method_keys(names: list[str]) -> list[Line2D]:
    """Entries of a legend, one per method."""
    return [Line2D([], [], color=colour(n), linestyle=dashes(n), lw=1.8, label=n) for n in names]


def attack_keys(recording: Recording) -> list[Patch]:
    """The entry of a legend that explains the shading; none without attacks."""
    return [Patch(color=ATTACK, label="attack")] if recording.episodes else []


def title(ax: Axes, name: str, note: str = "") -> None:
    """Name a panel after its method, in its colour, with a note behind it."""
    ax.set_title(name, color=colour(name), fontweight="bold")
    ax.set_title(note, loc="right", color=MUTED, fontsize=8.0)


def plain_log(axis: Axis) -> None:
    """Numbers such as 0.1, 2 and 50 on a logarithmic axis instead of powers of ten."""
    low, high = axis.get_view_interval()
    decades = np.log10(high / low)
    shown = {1.0, 2.0, 5.0} if decades > 0.7 else set(range(1, 10))

    def text(value: float, _: int) -> str:
        mantissa = round(value / 10.0 ** np.floor(np.log10(value) + 1e-9), 6)
        return number(value) if mantissa in shown else ""

    axis.set_major_formatter(FuncFormatter(lambda value, _: number(value)))
    axis.set_minor_formatter(FuncFormatter(text) if decades < 2.5 else NullFormatter())


def positive(values: Array) -> Array:
    """Values for a logarithmic axis: exact zeros become gaps."""
    return np.where(values > 0.0, values, np.nan)


def spans_decades(values: Array, decades: float = 1.7) -> bool:
    """A logarithmic axis serves these values better: the bulk of them spreads over decades."""
    found = values[np.isfinite(values) & (values > 0.0)]
    if len(found) < 2:
        return False
    return bool(np.log10(found.max() / np.median(found)) > decades)
