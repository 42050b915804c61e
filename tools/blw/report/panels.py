# SPDX-License-Identifier: MIT
"""The registry of panels.  A panel is one figure of the report and one PNG file beside it.

A method that has more to show adds a module with its own panels and imports it in __init__.py:

    @panel("attack_estimate", "Estimated attack signals", applies=lambda r: ...)
    def attack_estimate(recording, layout) -> Drawn: ...
"""
from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from matplotlib.figure import Figure

from blw.report.data import Recording, Track
from blw.report.style import Layout


@dataclass(frozen=True)
class Drawn:
    """A figure, what it shows (caption) and what one sees in it (alternative text)."""

    figure: Figure
    caption: str
    alt: str


Draw = Callable[[Recording, Layout], Drawn]


@dataclass(frozen=True)
class Panel:
    """key names the PNG file; the panel is left out of recordings it does not apply to."""

    key: str
    title: str
    applies: Callable[[Recording], bool]
    draw: Draw


PANELS: list[Panel] = []
"""In the order of the report."""


def panel(
    key: str, title: str, applies: Callable[[Recording], bool] = lambda recording: True
) -> Callable[[Draw], Draw]:
    """Register a drawing function as a panel."""

    def register(draw: Draw) -> Draw:
        PANELS.append(Panel(key, title, applies, draw))
        return draw

    return register


def defended(recording: Recording) -> list[Track]:
    """Methods that decide anything: all but the oracle and methods without a test."""
    pairs = recording.tracks.items()
    return [track for name, track in pairs if name != "oracle" and track.tested.any()]


def any_defended(recording: Recording) -> bool:
    """Some method tests its samples."""
    return bool(defended(recording))


def attack_words(recording: Recording) -> str:
    """The shading explained, for alternative texts."""
    if not recording.episodes:
        return "No attack is known in this recording."
    spans = [
        f"{recording.t_s[i]:.4g} to {recording.t_s[j - 1]:.4g} s" for i, j in recording.episodes[:3]
    ]
    more = "" if len(recording.episodes) <= 3 else " and later"
    return f"Attacks are shaded: {', '.join(spans)}{more}."
