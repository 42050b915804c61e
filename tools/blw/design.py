# SPDX-License-Identifier: MIT
"""From a model to the tables of every method, and the file NAME.json that holds them."""

import json
import platform
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, partial
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

import blw
from blw import options
from blw.errors import DesignError, ModelError
from blw.model import Model
from blw.tables import FLOAT32, Struct, table

if TYPE_CHECKING:
    from blw.kalman import Kalman

FORMAT = "bulwark-design-1"

# A sample further than this many standard deviations of its prediction from its offset is taken
# for missing where the model gives no range: squares of what is left stay within float32.
RANGE_SIGMAS = 1e9


@dataclass(frozen=True, eq=False)
class Designed:
    """What a method's design returns.

    tables  the method's model struct
    info    what a reader wants to know; goes to NAME.json as it is
    mem     arguments of the method's macro BLW_<METHOD>_MEM, in its order
    extras  models of other modules for the firmware's own use: C source only, no head, but
            members abi and crc of their own
    """

    tables: Struct
    info: dict[str, Any]
    mem: tuple[int, ...] = ()
    extras: tuple[Struct, ...] = ()


@dataclass(frozen=True, eq=False)
class Design:
    """A model with its plant tables, the methods that serve it, and why the others do not."""

    model: Model
    plant: Struct
    methods: dict[str, Designed]
    refused: dict[str, str] = field(default_factory=dict)


def design_all(model: Model, methods: Sequence[str] | None = None,
               progress: Callable[[str], None] = lambda name: None) -> Design:
    """Design the named methods; without names, every one that accepts the model.

    progress is called with the name of each method before its turn.
    Raises DesignError if a method that was named refuses, or if no Kalman filter exists;
    ModelError for wrong options, also those of methods that were not asked for.
    """
    from blw import gaps  # as kalman, a method that imports this module
    from blw.kalman import steady_state
    from blw.methods import REGISTRY

    where = model.path or model.name
    parsed = {name: options.parse(module.Options, model.methods.get(name, {}),
                                  f"{where}: method.{name}")
              for name, module in REGISTRY.items()}
    _check_named(methods or (), REGISTRY)
    try:
        kalman = steady_state(model.A, model.C, model.W, model.R)
    except DesignError as error:
        raise DesignError(f"{where}: {error}") from None
    served = {"weighted": cache(partial(gaps.averaged, model)),
              "counted once": cache(partial(gaps.cautious, model, kalman)),
              "ignored": lambda: (model, kalman)}
    plant = plant_tables(model, kalman)
    plant.check()
    designed: dict[str, Designed] = {}
    refused: dict[str, str] = {}
    for name in dict.fromkeys(methods or REGISTRY):
        progress(name)
        try:
            module = REGISTRY[name]
            result = module.design(*served[module.GAPS](), parsed[name])
            result.tables.check()
        except ModelError as error:
            raise ModelError(f"{where}: {error}") from None
        except DesignError as error:
            if methods:
                raise DesignError(f"{where}: {name}: {error}") from None
            refused[name] = str(error)
        else:
            designed[name] = result
    return Design(model, plant, designed, refused)


def plant_tables(model: Model, kalman: "Kalman") -> Struct:
    """blw_plant_t.  Where the model gives no range, RANGE_SIGMAS around the offset."""
    sigma = np.sqrt(np.diag(model.C @ kalman.Pp @ model.C.T + model.R))
    low = np.where(np.isfinite(model.range[:, 0]), model.range[:, 0],
                   model.offset - RANGE_SIGMAS * sigma)
    high = np.where(np.isfinite(model.range[:, 1]), model.range[:, 1],
                    model.offset + RANGE_SIGMAS * sigma)
    largest = float(FLOAT32.max)
    return Struct("blw_plant_t", "plant", {
        "n": model.n, "m": model.m, "l": model.l, "p": model.p,
        "A": table(model.A, "[n x n]"),
        "Bu": table(model.Bu, "[n x l]"),
        "C": table(model.C, "[m x n]"),
        "offset": table(model.offset, "[m] constant part of y"),
        "y_min": table(np.clip(low, -largest, largest), "[m] a sample below is missing"),
        "y_max": table(np.clip(high, -largest, largest), "[m] a sample above is missing"),
        "x0": table(model.x0, "[n] x_hat(0)"),
    })


def small(design: Design) -> Design:
    """The same without straight-line code: less flash, more instructions, the same bits."""
    return replace(design, methods={name: replace(designed, tables=designed.tables.bare())
                                    for name, designed in design.methods.items()})


def document(design: Design) -> dict[str, Any]:
    """The contents of NAME.json (docs/architecture.md)."""
    return {
        "format": FORMAT,
        "name": design.model.name,
        "model_sha256": design.model.sha256,
        "versions": {"bulwark": blw.__version__, "python": platform.python_version(),
                     "numpy": np.__version__, "scipy": scipy.__version__},
        "model": model_json(design.model, design.plant),
        "plant": design.plant.to_json(),
        "methods": {name: {"tables": designed.tables.to_json(), "info": designed.info}
                    for name, designed in design.methods.items()},
        "refused": design.refused,
    }


def json_text(document: dict[str, Any]) -> str:
    """Readable JSON: an object has a line per member, a list is on one line, infinity is null."""
    return _object_text(document, "") + "\n"


def _object_text(value: Any, indent: str) -> str:
    if not isinstance(value, dict) or not value:
        return json.dumps(_without_infinity(value), allow_nan=False)
    inner = indent + "  "
    rows = [f"{inner}{json.dumps(key)}: {_object_text(item, inner)}" for key, item in value.items()]
    return "{\n" + ",\n".join(rows) + f"\n{indent}}}"


def _without_infinity(value: Any) -> Any:
    if isinstance(value, list | tuple):
        return [_without_infinity(item) for item in value]
    if isinstance(value, dict):
        return {key: _without_infinity(item) for key, item in value.items()}
    return None if isinstance(value, float) and np.isinf(value) else value


def model_json(model: Model, plant: Struct) -> dict[str, Any]:
    """The model, resolved and discretised, with nested lists.

    A sensor without a range has null, and the plant's tables have range_default_sigmas standard
    deviations of its prediction on both sides of its offset; so has an end of a range that is open.
    """
    used = plant.to_json()
    rows = zip(model.range, used["y_min"], used["y_max"], strict=True)
    limits = [[low, high] if np.isfinite(given).any() else None for given, low, high in rows]
    return {
        "name": model.name, "dt_s": model.dt_s,
        "n": model.n, "m": model.m, "l": model.l, "p": model.p,
        "states": model.states, "sensors": model.sensors, "inputs": model.inputs,
        "A": model.A.tolist(), "Bu": model.Bu.tolist(), "B": model.B.tolist(),
        "C": model.C.tolist(), "Q": model.Q.tolist(), "R": model.R.tolist(),
        "x0": model.x0.tolist(), "P0": None if model.P0 is None else model.P0.tolist(),
        "offset": model.offset.tolist(), "range": limits, "range_default_sigmas": RANGE_SIGMAS,
        "strong": model.strong, "groups": model.groups,
    }


def _check_named(methods: Sequence[str], known: dict[str, Any]) -> None:
    for name in methods:
        if name not in known:
            raise ModelError(f"unknown method '{name}'; {options.suggestion(name, known)}")
