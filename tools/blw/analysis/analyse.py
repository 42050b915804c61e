# SPDX-License-Identifier: MIT
"""The whole analysis of one model, as data that json can write."""

from collections.abc import Callable, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from blw.analysis import advice, security
from blw.analysis.footprint import footprint, with_simulation
from blw.analysis.observability import Index, sparse_index
from blw.analysis.tuning import tuning
from blw.design import design_all
from blw.errors import DesignError
from blw.kalman import steady_state
from blw.methods import REGISTRY
from blw.model import Model
from blw.modes import Mode, Modes, modes_of

Progress = Callable[[str], None]


def analyse(model: Model, methods: Sequence[str] | None, progress: Progress) -> dict[str, Any]:
    """What `bulwark analyze --json` prints, docs/canonical.md.

    methods None means all.  Raises DesignError if no Kalman filter exists, ModelError for wrong
    options.
    """
    where = model.path or model.name
    try:
        kalman = steady_state(model.A, model.C, model.W, model.R)
        modes = modes_of(model.A, model.C)
    except DesignError as error:
        raise DesignError(f"{where}: {error}") from None
    over_units = sparse_index(modes.modes, model.units, progress=progress)
    figures = _designs(model, list(methods or REGISTRY), progress)
    refused = {name: entry["refused"] for name, entry in figures.items() if "refused" in entry}
    case = security.Case(model, kalman, modes, over_units, progress, refused)
    verdicts = security.verdicts(case, figures)
    result = {
        "name": model.name, "n": model.n, "m": model.m, "p": model.p,
        "sensors": model.sensors, "groups": model.groups,
        "modes": [_mode(mode, model) for mode in modes.modes],
        "derogatory": bool(modes.derogatory),
        **_indices(model, modes, over_units, progress),
        "cond_P": float(np.linalg.cond(kalman.P)),
        "methods": {
            name: (verdicts[name].to_json(model.m) if name in verdicts else {}) | entry
            for name, entry in figures.items()
        },
        "advice": _advice(model, modes, over_units, progress),
    }
    result["verdict"] = verdict_text(result)
    return result


def _indices(model: Model, modes: Modes, over_units: Index, progress: Progress) -> dict[str, Any]:
    """The sparse-observability index over sensors and groups, and for the modes that last."""
    index = sparse_index(modes.modes, [[i] for i in range(model.m)], progress=progress)
    lasting = [mode for mode in modes.modes if mode.persists]
    detectable = sparse_index(lasting, model.units, progress=progress)
    return {
        "sparse_observability_index": index.lower,
        "index_is_exact": index.exact,
        "index_upper_bound": index.upper,
        "index_over_groups": over_units.lower,
        "sparse_detectability_index": detectable.lower,
        "max_attacked": over_units.max_attacked,
        "weakest_mode": None if over_units.weakest is None else _complex(over_units.weakest),
    }


def _designs(model: Model, methods: Sequence[str], progress: Progress) -> dict[str, dict[str, Any]]:
    """Footprint and tuning of every method, or why it refuses the model."""
    found: dict[str, dict[str, Any]] = {}
    for name in dict.fromkeys(methods):
        try:
            whole = design_all(model, [name], progress)
        except DesignError as error:
            reason = str(error).removeprefix(f"{model.path or model.name}: {name}: ")
            found[name] = {"refused": reason}
            continue
        designed = whole.methods[name]
        progress(f"{name}: instructions")
        cost = with_simulation(footprint(name, designed, whole.plant), name, whole)
        found[name] = {"tuning": tuning(designed.info), "footprint": asdict(cost)}
    return found


def _mode(mode: Mode, model: Model) -> dict[str, Any]:
    return {
        **_complex(mode.eigenvalue),
        "multiplicity": mode.multiplicity,
        "eigenvectors": mode.dimension,
        "seen_by": [model.sensors[i] for i in np.flatnonzero(mode.seen)],
    }


def _complex(z: complex) -> dict[str, float]:
    return {"re": float(z.real), "im": abs(float(z.imag))}


def _advice(model: Model, modes: Modes, index: Index, progress: Progress) -> list[dict[str, Any]]:
    """Changes that help, if the model cannot survive p lying units as it is."""
    if index.lower >= 2 * model.p:
        return []
    changes = advice.advise(model, modes, progress)
    found = [{**asdict(change), "text": change.text()} for change in changes]
    if index.max_attacked < model.p:
        found.append({"kind": "assume_less", "count": index.max_attacked, "choices": [],
                      "text": f"accept p = {index.max_attacked}"})
    return found


def verdict_text(result: dict[str, Any]) -> str:
    """Plain words: what is safe, what is not, what to do."""
    p = result["p"]
    if p == 0:
        return "No sensor is assumed to lie (p = 0): every method returns what kalman does."
    unit = "group" if result["groups"] else "sensor"
    many = f"{p} lying {unit}" + ("s" if p > 1 else "")
    safe = [name for name, entry in result["methods"].items()
            if entry.get("secure") and "refused" not in entry]
    unsafe = [name for name, entry in result["methods"].items()
              if "secure" in entry and not entry["secure"]]
    text = f"Against {many}, safe: {', '.join(safe) or 'none'}; not safe: " \
           f"{', '.join(unsafe) or 'none'}."
    if result["max_attacked"] < p:
        text += ("  Unless some are trusted, the sensors determine the state with at most"
                 f" {result['max_attacked']} of them lying.")
        helps = [change["text"] for change in result["advice"]]
        text += "  To change that: " + "; or ".join(helps) + "." if helps else ""
    return text
