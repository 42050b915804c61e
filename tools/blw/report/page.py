# SPDX-License-Identifier: MIT
"""The page: text, tables and figures put together, written all at once or not at all."""
from __future__ import annotations

import base64
import io
import os
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jinja2
import matplotlib as mpl
from PIL import Image

from blw import progress
from blw.report import style, text
from blw.report.data import Recording
from blw.report.figures import collect
from blw.report.panels import PANELS, Drawn, Panel

PAGE = "report.html"


@dataclass(frozen=True)
class Shown:
    """One panel in the page: PNG bytes as base64, for wide and for narrow screens."""

    key: str
    title: str
    caption: str
    alt: str
    wide: str
    narrow: str
    size: tuple[int, int]  # pixels of the wide one, so that the page does not jump while loading


def write(recording: Recording) -> list[Path]:
    """Write one PNG per panel and the page into the recording's folder; the page comes last.

    Everything is made in a temporary folder first, so that a failure leaves the folder as it was.
    PNGs of panels that do not apply any more are removed.
    """
    panels = [panel for panel in PANELS if panel.applies(recording)]
    target = recording.directory
    with tempfile.TemporaryDirectory(dir=target, prefix=".report-") as scratch:
        folder = Path(scratch)
        shown = []
        with progress.steps("report") as tell:
            for panel in panels:
                tell(panel.title)
                shown.append(_show(panel, recording, folder))
        (folder / PAGE).write_text(render(recording, shown), encoding="utf-8")
        names = [f"{panel.key}.png" for panel in panels] + [PAGE]
        for name in names:
            os.replace(folder / name, target / name)
    for stale in {f"{panel.key}.png" for panel in PANELS} - set(names):
        (target / stale).unlink(missing_ok=True)
    return [target / name for name in names]


def _show(panel: Panel, recording: Recording, folder: Path) -> Shown:
    with mpl.rc_context(style.RC):
        drawn = panel.draw(recording, style.WIDE)
        wide = _png(drawn)
        narrow = _png(panel.draw(recording, style.NARROW))
    (folder / f"{panel.key}.png").write_bytes(wide)
    pixels = tuple(int(v) for v in drawn.figure.get_size_inches() * drawn.figure.dpi)
    encoded = [base64.b64encode(data).decode("ascii") for data in (wide, narrow)]
    return Shown(panel.key, panel.title, drawn.caption, drawn.alt, *encoded, pixels)


def _png(drawn: Drawn) -> bytes:
    """Opaque PNG without date or version, so that equal input gives equal bytes."""
    buffer, packed = io.BytesIO(), io.BytesIO()
    drawn.figure.savefig(buffer, format="png")
    Image.open(buffer).convert("RGB").save(packed, "png", optimize=True)
    return packed.getvalue()


def render(recording: Recording, shown: list[Shown]) -> str:
    """The page as HTML that refers to nothing outside itself."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    return environment.get_template("page.html.j2").render(**_content(recording, shown))


def _content(recording: Recording, shown: list[Shown]) -> dict[str, Any]:
    figures = collect(recording)
    columns = text.columns(figures)
    return {
        "heading": text.heading(recording),
        "subtitle": text.subtitle(recording),
        "findings": text.findings(recording, figures),
        "caveats": text.caveats(recording),
        "columns": columns,
        "rows": {name: text.cells(row, columns) for name, row in figures.items()},
        "state_phase": "under attack" if recording.episodes else "all steps",
        "state_rows": text.state_rows(recording, figures),
        "colours": {name: style.colour(name) for name in recording.tracks},
        "facts": text.facts(recording),
        "panels": shown,
    }
