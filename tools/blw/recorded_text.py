# SPDX-License-Identifier: MIT
"""The figures of `bulwark recorded` as Markdown tables."""

from typing import Any

YARDSTICK = "oracle"


def markdown(cases: list[dict[str, Any]]) -> str:
    """Medians and worst cases of all, then a section per case."""
    return "\n".join([_overview(cases), *(_case(case) for case in cases)])


def _overview(cases: list[dict[str, Any]]) -> str:
    names = list(dict.fromkeys(name for case in cases for name in case["methods"]))
    rows = [[case["name"], *(_median_and_worst(case["methods"].get(name)) for name in names)]
            for case in cases]
    return "\n".join(["Median (worst) RMSE over the attacks:", "",
                      *_table(["log", *names], rows)]) + "\n"


def _median_and_worst(figures: dict[str, Any] | None) -> str:
    return "" if figures is None else f"{_number(figures['median'])} ({_number(figures['worst'])})"


def _case(case: dict[str, Any]) -> str:
    names = list(case["methods"])
    lines = [f"### {case['name']}", "",
             f"p = {case['p']['sensors']} sensors or {case['p']['groups']} groups, noise_margin "
             f"{case['noise_margin']:g}.  RMSE of {case['state']} in the attack windows:", ""]
    lines += _table(["attack", *names], [
        [replay["id"], *(_number(replay["methods"][name]["rmse"]) for name in names)]
        for replay in case["attacks"]])
    lines += [""] + _table(["", *names], list(_rows(case, names)))
    lines += [""] + [f"- {name}: {reason}" for name, reason in case["refused"].items()
                     if not name.startswith("joint")]
    if max(case["p"].values()) == 0:
        lines.append("- p = 0: no sensor is redundant enough to correct an attack; it can only be "
                     "detected.")
    return "\n".join(lines).rstrip() + "\n"


def _rows(case: dict[str, Any], names: list[str]):
    of = case["methods"]
    yield ["median", *(_number(of[name]["median"]) for name in names)]
    yield ["median / oracle", *(f"{of[name]['median_to_oracle']:.2f}" for name in names)]
    yield ["worst", *(_number(of[name]["worst"]) for name in names)]
    yield ["attacks detected", *(_detected(of[name], name) for name in names)]
    yield ["median delay, s", *("" if name == YARDSTICK else _number(of[name]["median_delay_s"])
                                for name in names)]
    for replay in case["clean"]:
        count = replay["count"]
        told = [replay["methods"].get(name) for name in names]
        yield [f"clean: alarms ({count})", *(_rate(each, "false_alarm_rate") for each in told)]
        yield [f"clean: excluded ({count})", *(_rate(each, "wrong_exclusions") for each in told)]
    yield ["excluded at the end", *(", ".join(of[name]["stuck"]) or "-" for name in names)]


def _detected(figures: dict[str, Any], name: str) -> str:
    return "" if name == YARDSTICK else f"{figures['detected']} of {figures['attacks']}"


def _rate(figures: dict[str, Any] | None, key: str) -> str:
    return "" if figures is None or figures[key] is None else f"{100 * figures[key]:.2f} %"


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.3g}"


def _table(head: list[str], rows: list[list[str]]) -> list[str]:
    cells = [head, ["---"] * len(head), *rows]
    return ["| " + " | ".join(row) + " |" for row in cells]
