# SPDX-License-Identifier: MIT
"""The analysis as a report for the terminal."""

import textwrap
from typing import Any

from blw.analysis.l1_work import BIAS
from blw.analysis.tuning import tuning_text

WIDTH = 96


def report(result: dict[str, Any]) -> str:
    """Lines of at most WIDTH characters."""
    n, m, p = result["n"], result["m"], result["p"]
    lines = [f"{result['name']}: {n} states, {m} sensors, p = {p}", ""]
    lines += _modes(result) + [""] + _index(result) + [""]
    lines += _methods(result) + [""] + _costs(result) + [""] + _tuning(result)
    lines += ["Verdict"] + _wrapped(result["verdict"])
    return "\n".join(lines)


def _modes(result: dict[str, Any]) -> list[str]:
    lines = [f"{'Mode':<24} {'|z|':>8}  seen by"]
    for mode in result["modes"]:
        z = f"{mode['re']:.5g}" + (f" +- {mode['im']:.5g}i" if mode["im"] else "")
        if mode["eigenvectors"] > 1:
            z += f"  ({mode['eigenvectors']} eigenvectors)"
        elif mode["multiplicity"] > 1:
            z += f"  (chain of {mode['multiplicity']})"
        size = abs(complex(mode["re"], mode["im"]))
        seen = ", ".join(mode["seen_by"]) or "no sensor"
        if len(mode["seen_by"]) == result["m"]:
            seen = "all"
        first, *rest = textwrap.wrap(seen, WIDTH - 35)
        lines.append(f"{z:<24} {size:>8.4f}  {first}")
        lines += [" " * 35 + line for line in rest]
    return lines


def _index(result: dict[str, Any]) -> list[str]:
    index = result["sparse_observability_index"]
    line = f"Sparse observability: index {index}"
    if not result["index_is_exact"]:
        line += f" or more, at most {result['index_upper_bound']} (the search met its limit)"
    if result["groups"]:
        line += f", {result['index_over_groups']} over groups"
    lasting = result["sparse_detectability_index"]
    lines = [line + f"; {lasting} for the modes that do not die out"]
    return lines + [f"The state is determined with up to {result['max_attacked']} lying at once"]


def _methods(result: dict[str, Any]) -> list[str]:
    lines = ["Method      safe  why"]
    for name, entry in result["methods"].items():
        if "secure" not in entry:
            continue
        safe = "yes" if entry["secure"] else "NO"
        first, *rest = textwrap.wrap(entry["reason"], WIDTH - 18)
        lines.append(f"{name:<11} {safe:<4}  {first}")
        lines += [" " * 18 + line for line in rest]
        if any(value is not None for value in entry["ratio"]):
            lines += _ratios(result["sensors"], entry)
    return lines


def _ratios(sensors: list[str], entry: dict[str, Any]) -> list[str]:
    upper = entry.get("ratio_upper", entry["ratio"])
    parts = []
    for name, low, high in zip(sensors, entry["ratio"], upper):
        shown = "unbounded" if low is None else f"{low:.4g}"
        if low is not None and high != low:
            shown += ".." + ("?" if high is None else f"{high:.4g}")
        parts.append(f"{name} {shown}")
    return [" " * 18 + line for line in textwrap.wrap("ratio: " + ", ".join(parts), WIDTH - 18)]


def _costs(result: dict[str, Any]) -> list[str]:
    lines = [f"{'Footprint':<11} {'flash B':>9} {'RAM B':>8}   multiply-adds: usual, at most"
             "   M4F instructions: usual, attacked"]
    for name, entry in result["methods"].items():
        if "footprint" in entry:
            cost = entry["footprint"]
            work = [f"{value:>{width},}" if value is not None else f"{'-':>{width}}"
                    for value, width in ((cost["macs_typical"], 10), (cost["macs_worst"], 14),
                                         (cost["instructions_typical"], 21),
                                         (cost["instructions_mean_attacked"], 12))]
            lines.append(f"{name:<11} {cost['flash_bytes']:>9,} {cost['ram_bytes']:>8,}   "
                         + "".join(work))
        elif "refused" in entry:
            lines.append(f"{name:<11} refused, see above" if "secure" in entry
                         else f"{name:<11} refused: {entry['refused']}")
    if any(entry.get("footprint", {}).get("instructions_mean_attacked")
           for entry in result["methods"].values()):
        lines.append(f"Attacked: mean, {BIAS:.0f} standard deviations on one sensor after another")
    return lines


def _tuning(result: dict[str, Any]) -> list[str]:
    lines = []
    for name, entry in result["methods"].items():
        text = tuning_text(entry.get("tuning", {}))
        if text:
            lines += textwrap.wrap(f"{name}: {text}", WIDTH, subsequent_indent="  ")
    return ["Tuning", *lines, ""] if lines else []


def _wrapped(text: str) -> list[str]:
    return textwrap.wrap(text, WIDTH)
