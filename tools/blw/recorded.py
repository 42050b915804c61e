# SPDX-License-Identifier: MIT
"""`bulwark recorded`: every method on recorded logs with injected attacks (docs/recorded.md).

A folder holds model*.json (an identified model), and in it or in `public`: logs as CSV, one row per
step, with the model's sensors as columns and the time in `t`; and attacks.json.  Every attack is
injected alone.  Attacks on whole groups meet the design that counts groups, all others the one that
counts sensors.
"""

import csv
import json
import subprocess
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import click
import numpy as np
from tqdm import tqdm

from blw import identify, importer
from blw.atomic import write_files
from blw.build import PRECISIONS, simulator
from blw.design import design_all, document, json_text
from blw.errors import BulwarkError
from blw.logs.steps import Names, Steps
from blw.model import Model, parse
from blw.recorded_text import markdown
from blw.report.csv_file import CsvFile

TIME = "t"

#: A sensor that is excluded in all of the last part of a replay is excluded for good.
END = 0.05


@dataclass(frozen=True, eq=False)
class Case:
    """One model and one log: designs by counting, "sensors" and "groups"."""

    name: str
    models: dict[str, Model]
    toml: dict[str, str]
    log: Path
    csv: str
    attacks: list[dict[str, Any]]
    noise_margin: float
    rate: list[float]
    refused: dict[str, str] = field(default_factory=dict)


@click.command("recorded", short_help="All methods on recorded logs with injected attacks.")
@click.argument("folders", metavar="DIR...", nargs=-1, required=True,
                type=click.Path(path_type=Path, exists=True, file_okay=False))
@click.option("--out", required=True, type=click.Path(path_type=Path, file_okay=False),
              help="Folder for models, designs, logs and recorded.json; made if missing.")
@click.option("--attacks", type=click.Path(path_type=Path, exists=True, dir_okay=False),
              metavar="ATTACKS.json", help="Other attacks than those in the folders.")
@click.option("--method", "methods", multiple=True, metavar="METHOD",
              help="Method to run beside kalman; may be repeated.  Default: all.")
@click.option("--precision", type=click.Choice(PRECISIONS), default="f32", show_default=True)
@click.option("--json", "as_json", is_flag=True, help="Print the figures as JSON.")
def recorded(folders: tuple[Path, ...], out: Path, attacks: Path | None,
             methods: tuple[str, ...], precision: str, as_json: bool) -> None:
    """Replay the logs in each DIR, clean and under every attack, and say how all methods did."""
    cases = [case for folder in folders for case in find_cases(folder, attacks)]
    program = simulator(precision)
    wanted = list(dict.fromkeys(("kalman", *methods))) if methods else None
    figures = [run_case(case, out / case.name, program, wanted) for case in cases]
    text = json.dumps({"format": "bulwark-recorded-1", "cases": figures}, indent=1,
                      allow_nan=False) + "\n"
    write_files(out, {"recorded.json": text})
    click.echo(text if as_json else markdown(figures), nl=False)


def find_cases(folder: Path, attacks: Path | None) -> Iterator[Case]:
    """Every model of a folder with every log that has its sensors.  Raises BulwarkError."""
    places = [place for place in (folder, folder / "public") if place.is_dir()]
    attacks = attacks or next((place / "attacks.json" for place in places
                               if (place / "attacks.json").is_file()), None)
    if attacks is None:
        raise BulwarkError(f"{folder}: no attacks.json in it or in its folder public")
    logs = sorted(path for place in places for path in place.glob("*.csv"))
    found = 0
    for source in sorted(folder.glob("model*.json")):
        raw = importer.read_object(source)
        names = raw.get("sensors", [])
        for log in (log for log in logs if {TIME, *names} <= set(_header(log))):
            case = make_case(raw, source, log, attacks)
            if case.attacks:
                found += 1
                yield case
    if found == 0:
        raise BulwarkError(f"{folder}: no model*.json with a log that has column '{TIME}' and all "
                           "its sensors, and an attack on them")


def _header(log: Path) -> list[str]:
    with log.open(encoding="utf-8", errors="replace", newline="") as file:
        return next(csv.reader(file), [])


def make_case(raw: dict[str, Any], source: Path, log: Path, attacks: Path) -> Case:
    """Import a model and its log, and identify what the log tells.  Raises BulwarkError."""
    name = importer.default_name(source)
    counts = {"sensors": False, "groups": True}
    mappings = {count: importer.model_mapping(raw, str(source), name, None, groups)
                for count, groups in counts.items()}
    model = parse(mappings["sensors"], str(source))
    table = CsvFile.read(log)
    y = table.numbers(model.sensors)
    known = identify.identify(model, y, str(log))
    mappings = {count: identify.with_plant(mapping, known) for count, mapping in mappings.items()}
    t_s = table.times(TIME)
    start = np.full((1, model.m), np.nan)
    names = Names(model.sensors, [], model.states, model.dt_s)
    steps = Steps(names, 0, np.concatenate([[t_s[0] - model.dt_s], t_s]), np.vstack([start, y]),
                  np.vstack([np.full((1, model.n), np.nan), known.states]))
    listed = importer.read_list(attacks)
    mine = [attack for attack in listed if set(attack.get("sensors", ())) <= set(model.sensors)]
    return Case(f"{name}_{log.stem}",
                {count: parse(mapping, str(source)) for count, mapping in mappings.items()},
                {count: importer.model_toml(mapping) for count, mapping in mappings.items()},
                log, steps.text(), mine, known.noise_margin, known.rate.tolist())


def run_case(case: Case, out: Path, program: Path, methods: list[str] | None) -> dict[str, Any]:
    """Design, replay the clean log and every attack; the figures of docs/recorded.md."""
    designs, refused = {}, {}
    for count, model in case.models.items():
        made = design_all(model, methods)
        refused |= {f"{name} ({count})": reason for name, reason in made.refused.items()}
        designs[count] = json_text(document(made))
    files = {f"{count}.json": text for count, text in designs.items()}
    files |= {f"{count}.toml": text for count, text in case.toml.items()}
    write_files(out, files | {"log.csv": case.csv, "attacks.json": json.dumps(case.attacks)})
    jobs = [(None, count) for count in designs]
    jobs += [(attack, "groups" if attack.get("group") else "sensors") for attack in case.attacks]
    replays = [_replay(program, out, attack, count)
               for attack, count in tqdm(jobs, desc=case.name, leave=False, disable=None)]
    clean, attacked = replays[:len(designs)], replays[len(designs):]
    return {"name": case.name, "log": case.log.name, "noise_margin": case.noise_margin,
            "rate": case.rate, "dt_s": case.models["sensors"].dt_s,
            "state": case.models["sensors"].states[0],
            "p": {count: model.p for count, model in case.models.items()},
            "refused": refused, "clean": clean, "attacks": attacked,
            "methods": _overall(attacked)}


def _replay(program: Path, out: Path, attack: dict[str, Any] | None,
            count: str) -> dict[str, Any]:
    """One replay; figures per method."""
    with tempfile.TemporaryDirectory(prefix="bulwark.") as scratch:
        command = [program, "replay", out / "log.csv", "--design", out / f"{count}.json",
                   "--out", scratch, "--format", "csv"]
        if attack is not None:
            command += ["--attack", out / "attacks.json", "--attack-id", attack["id"]]
        done = subprocess.run([str(word) for word in command], capture_output=True, text=True,
                              check=False)
        if done.returncode != 0:
            raise BulwarkError(done.stderr.strip())
        summary = json.loads((Path(scratch) / "summary.json").read_text(encoding="utf-8"))
        phase = "all" if attack is None else "during"
        found = {name: _figures(told, phase) | {"stuck": _stuck(Path(scratch) / f"{name}.csv")}
                 for name, told in summary["methods"].items()}
    return {"id": "clean" if attack is None else attack["id"], "count": count, "methods": found}


def _figures(told: dict[str, Any], phase: str) -> dict[str, Any]:
    wrong = told["wrong_exclusions"]
    return {"rmse": told["rmse_state"][phase][0], "rmse_clean": told["rmse_state"]["before"][0],
            "detection_delay_s": told["detection_delay_s"],
            "false_alarm_rate": told["false_alarm_rate"],
            "wrong_exclusions": wrong["rate"], "wrong_exclusion_count": wrong["count"]}


def _stuck(path: Path) -> list[str]:
    """Sensors that are excluded in every step of the END of a replay."""
    cells = CsvFile.read(path).column("excluded")
    last = cells[-max(1, round(END * len(cells))):]
    return sorted(set.intersection(*(set(cell.split(";")) for cell in last)) - {""})


def _overall(attacked: list[dict[str, Any]]) -> dict[str, Any]:
    """Median and worst error of every method over the attacks, and its part of the oracle's."""
    names = [name for name in attacked[0]["methods"]
             if all(name in replay["methods"] for replay in attacked)]
    found = {}
    for name in names:
        errors = np.array([replay["methods"][name]["rmse"] for replay in attacked])
        delays = [replay["methods"][name]["detection_delay_s"] for replay in attacked]
        seen = [delay for delay in delays if delay is not None]
        found[name] = {"median": float(np.median(errors)), "worst": float(errors.max()),
                       "worst_attack": attacked[int(errors.argmax())]["id"],
                       "detected": len(seen), "attacks": len(delays),
                       "median_delay_s": float(np.median(seen)) if seen else None,
                       "stuck": sorted({sensor for replay in attacked
                                        for sensor in replay["methods"][name]["stuck"]})}
    for figures in found.values():
        figures["median_to_oracle"] = figures["median"] / found["oracle"]["median"]
    return found
