# SPDX-License-Identifier: MIT
"""`bulwark import`: an identified model in JSON, its attacks and its log columns, as TOML.

The JSON model has A, C, Q, R, sensors and dt; offset, P0, states and groups are optional.  Q, R and
P0 are matrices or diagonals, groups maps the name of a frame or device to the sensors in it.
"""

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from blw.atomic import write_files
from blw.errors import ModelError
from blw.identify import LEAST_MARGIN, identify, with_plant
from blw.model import Model, parse
from blw.reader import is_finite, is_number
from blw.report.csv_file import CsvFile

# Kind of attack in attacks.json -> kind in an attack file.
KINDS = {"bias": "bias", "ramp": "ramp", "scale": "scale", "freeze": "stuck", "noise": "white",
         "replay": "replay", "sine": "sine", "drop": "drop"}
# Key in attacks.json -> key in an attack file.
PARAMETERS = {"t0": "t0_s", "t1": "t1_s", "value": "value", "period": "period_s", "seed": "seed"}
WITHOUT_VALUE = ("stuck", "drop")


@click.command("import", short_help="An identified model in JSON to a model file.")
@click.argument("source", metavar="MODEL.json", type=click.Path(path_type=Path))
@click.option("--out", required=True, type=click.Path(path_type=Path, dir_okay=False),
              help="Model file to write.")
@click.option("--name", help="Name of the model; default: from the path of MODEL.json.")
@click.option("--p", "p", type=int, help="Sensors, or groups, that may be attacked.  "
              "Default: what MODEL.json says it tolerates.")
@click.option("--no-groups", is_flag=True, help="Count single sensors, not frames or devices.")
@click.option("--attacks", type=click.Path(path_type=Path), metavar="ATTACKS.json",
              help="Attacks to translate; those on sensors the model lacks are left out.")
@click.option("--out-attacks", type=click.Path(path_type=Path, file_okay=False), metavar="DIR",
              help="Folder for one attack file per id.")
@click.option("--out-map", type=click.Path(path_type=Path, dir_okay=False), metavar="MAP.toml",
              help="Column map for `replay --map` to write.")
@click.option("--time-column", default="t", show_default=True, help="Column of time in seconds.")
@click.option("--log", type=click.Path(path_type=Path, exists=True, dir_okay=False),
              metavar="LOG.csv", help="A log without attacks, one row per step, to identify rate, "
              "noise_margin and x0 from.")
def import_(source: Path, out: Path, name: str | None, p: int | None, no_groups: bool,
            attacks: Path | None, out_attacks: Path | None, out_map: Path | None,
            time_column: str, log: Path | None) -> None:
    """Translate an identified model, its attacks and its log columns to Bulwark's files."""
    if (attacks is None) != (out_attacks is None):
        raise click.UsageError("--attacks and --out-attacks go together")
    raw = read_object(source)
    mapping = model_mapping(raw, str(source), name or default_name(source), p, not no_groups)
    model = parse(mapping, str(source))
    if log is not None:
        samples = CsvFile.read(log).numbers(model.sensors)
        mapping = with_plant(mapping, identify(model, samples, str(log)))
        model = parse(mapping, str(source))
    jobs = [(out.parent, {out.name: model_toml(mapping)})]
    if attacks is not None and out_attacks is not None:
        jobs.append((out_attacks, attack_files(_read(attacks), str(attacks), model)))
    if out_map is not None:
        jobs.append((out_map.parent, {out_map.name: map_toml(model, time_column)}))
    for folder, contents in jobs:
        for path in write_files(folder, contents):
            click.echo(f"wrote {path}")


def default_name(source: Path) -> str:
    """The folder's name, and what follows "model_" in the file's: quad/model_roll -> quad_roll."""
    stem = source.stem.removeprefix("model").strip("_")
    parts = [source.resolve().parent.name] if source.stem.startswith("model") else []
    return re.sub(r"\W", "_", "_".join(parts + [stem] if stem else parts))[:31]


def model_mapping(raw: Mapping[str, Any], where: str, name: str, p: int | None,
                  groups: bool) -> dict[str, Any]:
    """The tables of a model file, unchecked but complete; ModelError for what is missing."""
    for key in ("A", "C", "Q", "R", "sensors", "dt"):
        if key not in raw:
            raise ModelError(f"{where}: {key} is missing")
    plant: dict[str, Any] = {"noise_margin": LEAST_MARGIN}
    if "states" in raw:
        plant["states"] = _state_names(raw["states"], where)
    plant |= {key: raw[key] for key in ("sensors", "A", "C", "Q", "R", "offset", "P0")
              if key in raw}
    claim = raw.get("p_max_groups" if groups else "p_max_sensors", 1)
    attack = {"p": claim if p is None else p}
    shared = _shared_groups(raw, where) if groups else []
    if shared:
        attack["groups"] = shared
    return {"name": name, "dt_s": raw["dt"], "plant": plant, "attack": attack,
            "method": {"canonical": {"coordinates": "steady"}}}


def model_toml(mapping: Mapping[str, Any]) -> str:
    """The text of a model file from its tables."""
    lines = [f"{key} = {_toml(mapping[key])}" for key in ("name", "dt_s")]
    tables = {name: mapping[name] for name in ("plant", "attack")}
    tables |= {f"method.{name}": options for name, options in mapping["method"].items()}
    for name, table in tables.items():
        lines += ["", f"[{name}]"]
        lines += [f"{key} = {_toml(value, len(key) + 4)}" for key, value in table.items()]
    return "\n".join(lines) + "\n"


def attack_files(raw: Any, where: str, model: Model) -> dict[str, str]:
    """File name -> attack file, for the attacks whose sensors the model has."""
    _check_list(raw, where)
    found = {}
    for number, attack in enumerate(raw, start=1):
        text = _attack_toml(attack, f"{where}: attack {number}", model)
        if text:
            found[f"{re.sub(r'[^A-Za-z0-9_.-]', '_', str(attack['id']))}.toml"] = text
    if not found:
        raise ModelError(f"{where}: no attack is on a sensor of the model '{model.name}'")
    return found


def map_toml(model: Model, time_column: str) -> str:
    """A column map for logs whose columns have the names of the sensors, every row a sample."""
    lines = [f"time = {_toml(time_column)}", 'first_row = "sample"', "", "[columns]"]
    lines += [f"{_toml(sensor)} = {_toml(sensor)}" for sensor in model.sensors]
    return "\n".join(lines) + "\n"


def _attack_toml(attack: Any, where: str, model: Model) -> str | None:
    """One attack; None if the model lacks one of its sensors."""
    if not isinstance(attack, Mapping):
        raise ModelError(f"{where}: must be an object")
    for key in ("id", "t0", "t1", "sensors", "type"):
        if key not in attack:
            raise ModelError(f"{where}: {key} is missing")
    kind = KINDS.get(str(attack["type"]))
    if kind is None:
        raise ModelError(f"{where}: unknown type {attack['type']!r}; known: {', '.join(KINDS)}")
    names = attack["sensors"]
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise ModelError(f"{where}: sensors must be a list of names, not {names!r}")
    if not set(names) <= set(model.sensors):
        return None
    lines = ["[[attack]]", f"id = {_toml(str(attack['id']))}", f"kind = {_toml(kind)}",
             f"sensors = {_toml(names)}"]
    if kind not in WITHOUT_VALUE and "value" not in attack:
        raise ModelError(f"{where}: value is missing")
    for key, target in PARAMETERS.items():
        if key in attack and not (key == "value" and kind in WITHOUT_VALUE):
            lines.append(f"{target} = {_toml(_numbers(attack[key], f'{where}: {key}'))}")
    return "\n".join(lines) + "\n"


def _numbers(value: Any, where: str) -> Any:
    for item in value if isinstance(value, list) else [value]:
        if not is_number(item) or not is_finite(item):
            raise ModelError(f"{where} must be a finite number, or one per sensor, not {value!r}")
    return value


def _shared_groups(raw: Mapping[str, Any], where: str) -> list[list[str]]:
    """The groups of two sensors or more; every other sensor is its own group anyway."""
    groups = raw.get("groups", {})
    if not isinstance(groups, Mapping) or not all(isinstance(g, list) for g in groups.values()):
        raise ModelError(f"{where}: groups must map names to lists of sensors")
    return [group for group in groups.values() if len(group) > 1]


def _state_names(states: Any, where: str) -> list[str]:
    """Names with their units, "a [m/s^2]" -> "a_m_s2"."""
    if not isinstance(states, list):
        raise ModelError(f"{where}: states must be a list")
    return [re.sub(r"[^A-Za-z0-9]+", "_", str(state).replace("^", "")).strip("_")
            for state in states]


def _toml(value: Any, indent: int = 0) -> str:
    """A number, a string or a list of them as TOML; lists of lists one row per line."""
    if isinstance(value, list):
        rows = any(isinstance(item, list) for item in value)
        return "[" + (",\n" + " " * indent if rows else ", ").join(map(_toml, value)) + "]"
    return json.dumps(value, ensure_ascii=False) if isinstance(value, str) else repr(value)


def _read(path: Path) -> Any:
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        raise ModelError(f"{path}: not JSON: {error}") from None


def read_list(path: Path) -> list[dict[str, Any]]:
    """An attacks.json of attacks on sensors of models that may lack some.  Raises ModelError."""
    raw = _read(path)
    _check_list(raw, str(path))
    for number, attack in enumerate(raw, start=1):
        if not isinstance(attack, Mapping) or not isinstance(attack.get("sensors"), list):
            raise ModelError(f"{path}: attack {number}: must be an object with a list of sensors")
        if not isinstance(attack.get("id"), str):
            raise ModelError(f"{path}: attack {number}: id must be a string")
    return raw


def _check_list(raw: Any, where: str) -> None:
    if not isinstance(raw, list):
        raise ModelError(f"{where}: must be a list of attacks")


def read_object(path: Path) -> Mapping[str, Any]:
    raw = _read(path)
    if not isinstance(raw, Mapping):
        raise ModelError(f"{path}: must be an object with A, C, Q, R, sensors and dt")
    return raw
