# SPDX-License-Identifier: MIT
"""Words and table cells of the page."""
from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from blw.report import units
from blw.report.data import Recording
from blw.report.figures import Figures

NONE = "–"
TOLD_ELSEWHERE = frozenset("format name methods steps states sensors inputs attack_windows".split())
TOLD = 6
"""Attacks that are told one by one."""


@dataclass(frozen=True)
class Column:
    """A column of the table of numbers: where its figure is, how it is shown, what it means."""

    path: str  # keys into the figures of a method, joined by dots
    head: str
    meaning: str
    show: Callable[[Any], str]

    def value(self, figures: Figures) -> Any:
        """The figure of one method, None if it has none."""
        value: Any = figures
        for key in self.path.split("."):
            value = value.get(key) if isinstance(value, dict) else None
        return value


def short(value: float) -> str:
    """Three significant digits, as a person writes them."""
    if value == 0.0:
        return "0"
    if not 1e-3 <= abs(value) < 1e5:
        mantissa, exponent = f"{value:.2e}".split("e")
        return f"{mantissa}·10{str(int(exponent)).translate(_SUPERSCRIPT)}"
    text = f"{value:.3g}" if abs(value) < 1000.0 else f"{value:.0f}"
    return text.replace("-", "−")


_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def percent(value: float) -> str:
    """A share as a percentage with three significant digits."""
    return short(100.0 * value) + " %"


def whole(value: float) -> str:
    """A count."""
    return f"{value:.0f}"


def ratio(value: Figures) -> str:
    """A count out of a number of tries."""
    return f"{value['count']}/{value['of']}" if value["of"] else NONE


COLUMNS = (
    Column("mse.all", "MSE", "mean over all steps of the squared norm of the error", short),
    Column("mse_se.all", "± s.e.", "standard error of the MSE over the runs", short),
    Column("rmse.before", "RMSE before", "root mean square error before the first attack", short),
    Column("rmse.during", "RMSE during", "the same while any sensor is attacked", short),
    Column("rmse.after", "RMSE after", "the same in all other steps", short),
    Column("ratio_to_oracle.all", "MSE / oracle", "multiple of the oracle's MSE, all steps", short),
    Column("ratio_to_oracle.during", "in attack", "the same while any sensor is attacked", short),
    Column("attacks_detected", "Found", "attacks that raised an alarm, of all", ratio),
    Column("detection_delay_steps", "Delay (steps)", "from an attack's start to its alarm", short),
    Column("false_alarm_rate", "False alarms", "share of the steps without attack", percent),
    Column("wrong_exclusions.rate", "Honest excluded", "share of the honest samples", percent),
    Column("missed_exclusions.rate", "Attacked used", "share of the attacked samples", percent),
    Column("iterations.mean", "Iterations", "of the method's solver, mean over the steps", short),
    Column("iterations.max", "max", "largest number of iterations in one step", whole),
    Column("kalman_rate.all", "Passed", "steps that gave exactly the Kalman estimate", percent),
)
RATIO = next(column for column in COLUMNS if column.path == "ratio_to_oracle.during")


def columns(figures: dict[str, Figures]) -> list[Column]:
    """The columns in which at least one method has a figure."""
    return [c for c in COLUMNS if any(c.value(row) is not None for row in figures.values())]


def cells(figures: Figures, shown: list[Column]) -> list[str]:
    """One row of the table of numbers."""
    values = [(column, column.value(figures)) for column in shown]
    return [NONE if value is None else column.show(value) for column, value in values]


def state_rows(recording: Recording, figures: dict[str, Figures]) -> list[dict[str, Any]]:
    """RMSE of every state (rows) and method (columns), under attack if there is one; empty if no
    errors are known."""
    if not recording.compared():
        return []
    phase = "during" if recording.episodes else "all"
    rows = []
    for j, state in enumerate(recording.states):
        values = [(row["rmse_state"] or {}).get(phase) for row in figures.values()]
        shown = [NONE if v is None or v[j] is None else short(v[j]) for v in values]
        rows.append({"state": state, "unit": units.split(state)[1] or NONE, "cells": shown})
    return rows


def heading(recording: Recording) -> str:
    """Title of the page: the model's name where it is known."""
    name = recording.summary.get("name")
    return name if isinstance(name, str) and name else recording.directory.resolve().name


def subtitle(recording: Recording) -> str:
    """What is compared, in one line."""
    steps, span = int((recording.k > 0).sum()), recording.t_s[-1] - recording.t_s[0]
    kind = "simulated" if recording.yardstick == "truth" else "recorded log, replayed"
    n, m = len(recording.states), len(recording.sensors)
    runs = f" · {recording.runs} runs" if recording.runs > 1 else ""
    return f"{kind} · {n} states, {m} sensors · {steps} steps, {short(span)} s{runs}"


def findings(recording: Recording, figures: dict[str, Figures]) -> list[str]:
    """What happened, in plain sentences made from the figures."""
    told = [*_attack_sentences(recording), *_ratio_sentence(figures), *_alarm_sentence(figures),
            *_verdict_sentences(figures)]
    divergence = recording.summary.get("divergence")
    if divergence:
        where = f"run {divergence['run'] + 1} at step {divergence['k']}"
        state = divergence["state"]
        told.append(f"The plant diverged in {where} (state {state}): the run ends there.")
    return told


def _attack_sentences(recording: Recording) -> list[str]:
    if recording.a is None and not recording.episodes:
        return ["Nothing is known about attacks in this recording."]
    if not recording.episodes:
        return ["No sensor is attacked."]
    t, k = recording.t_s, recording.k
    told = [
        f"{listed(names)} from {short(t[start])} s to {short(t[stop - 1])} s"
        f" (steps {k[start]} to {k[stop - 1]})"
        for (start, stop), names in zip(recording.episodes, recording.targets)
    ]
    rest = f"; and {len(told) - TOLD} later" if len(told) > TOLD else ""
    head = "Under attack: " if len(told) == 1 else f"{len(told)} attacks: "
    return [head + "; ".join(told[:TOLD]) + rest + "."]


def _ratio_sentence(figures: dict[str, Figures]) -> list[str]:
    pairs = [(RATIO.value(row), name) for name, row in figures.items() if name != "oracle"]
    known = sorted(pair for pair in pairs if pair[0] is not None)
    told = [f"{name} {short(value)}" for value, name in known]
    if not told:
        return []
    return [f"Under attack, mean square error as a multiple of the oracle's: {', '.join(told)}."]


def _alarm_sentence(figures: dict[str, Figures]) -> list[str]:
    found = {name: row["attacks_detected"] for name, row in figures.items()}
    missed = [name for name, share in found.items() if share and share["count"] < share["of"]]
    return [f"Not every attack raised an alarm in {listed(missed)}."] if missed else []


def _verdict_sentences(figures: dict[str, Figures]) -> list[str]:
    """What the design found out about a method and wants its user to know."""
    return [f"The design of {name} says: {row['verdict']}." for name, row in figures.items()
            if row.get("verdict")]


def caveats(recording: Recording) -> list[str]:
    """What a reader must know before trusting the figures."""
    out = []
    if recording.yardstick == "oracle":
        out.append(
            "A recorded log holds no true states: every error here is the distance from the "
            "oracle's estimate, not from the truth, and the oracle itself has none."
        )
    elif recording.yardstick is None:
        out.append("Neither true states nor an oracle are known: no errors can be given.")
    if recording.runs > 1:
        out.append(f"The numbers cover {recording.runs} runs; the plots show the first of them.")
    if units.common(recording.states) == "mixed units" and recording.compared():
        out.append(
            "The states have different units: norms over all states add them up as they are. "
            "Errors state by state are given in their own units."
        )
    late = [n for n, t in recording.tracks.items() if not t.present[recording.k > 0].all()]
    if late:
        out.append(f"Steps without an estimate are left out of the figures of {listed(late)}.")
    return out


def listed(names: list[str]) -> str:
    """"a", "a and b", "a, b and c"."""
    if len(names) < 2:
        return "".join(names)
    return f"{', '.join(names[:-1])} and {names[-1]}"


def facts(recording: Recording) -> list[tuple[str, str]]:
    """What was run: every plain value of summary.json outside the figures, by its path."""
    out = [
        ("model", heading(recording)),
        ("steps", str(int((recording.k > 0).sum()))),
        ("states", ", ".join(recording.states)),
        ("sensors", ", ".join(recording.sensors)),
        ("inputs", ", ".join(recording.inputs) or "none"),
    ]
    for key, value in recording.summary.items():
        if key not in TOLD_ELSEWHERE and value is not None:
            out += _fact(key.replace("_", " "), value)
    return out


def _fact(name: str, value: Any) -> list[tuple[str, str]]:
    """A list of objects gives a line for each, anything else one line."""
    if isinstance(value, list) and any(isinstance(item, dict) for item in value):
        return [(f"{name} {i}", _flat(item)) for i, item in enumerate(value, start=1)]
    return [(name, _flat(value))]


def _flat(value: Any) -> str:
    if isinstance(value, dict):
        parts = [f"{key.replace('_', ' ')} {_flat(item)}" for key, item in value.items()]
        return ", ".join(part for part in parts if not part.endswith(" "))
    if isinstance(value, list):
        return " ".join(_flat(item) for item in value)
    return "" if value is None else str(value)
