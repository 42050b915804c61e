# SPDX-License-Identifier: MIT
"""What the thresholds of a designed method cost: one line each, for the report."""

from typing import Any

import scipy.special

#: False-alarm rates for which thresholds are told.
RATES = (1e-2, 1e-3, 1e-4, 1e-6)


def tuning(info: dict[str, Any]) -> dict[str, Any]:
    """From the figures of a design: gamma against the probability of returning exactly the Kalman
    estimate, chi-square thresholds against the false-alarm rate, and condition numbers."""
    found: dict[str, Any] = {}
    for key in ("gamma", "benign_loss", "recovery_probability", "recovery_union_bound",
                "gamma_for_recovery", "cond_W", "cond_P", "cond_X", "k", "false_alarm",
                "false_rejection", "trace_P"):
        if key in info:
            found[key] = info[key]
    full = next((s for s in info.get("sets", []) if s.get("excluded") == [] and "dof" in s), None)
    if full is not None:
        found["threshold_for_false_alarm"] = {
            f"{rate:g}": float(scipy.special.chdtri(full["dof"], rate)) for rate in RATES
        }
    return found


def tuning_text(found: dict[str, Any]) -> str:
    """The same in words; empty if there is nothing to tell."""
    parts = []
    if "gamma" in found:
        parts.append(f"gamma {found['gamma']:.4g}: exactly the Kalman estimate in"
                     f" {100 * found['recovery_probability']:.3g} % of benign steps")
        if found["benign_loss"] is not None:
            parts.append(f"{100 * found['benign_loss']:.2g} % more mean square error then")
    if "gamma_for_recovery" in found:
        parts.append("gamma for " + ", ".join(
            f"{100 * float(p):g} %: {g:.4g}" for p, g in found["gamma_for_recovery"].items()))
    if "threshold_for_false_alarm" in found:
        parts.append("threshold for a false-alarm rate of " + ", ".join(
            f"{rate}: {value:.4g}" for rate, value in found["threshold_for_false_alarm"].items()))
    parts += [f"cond({key[5:]}) {found[key]:.2g}"
              for key in ("cond_W", "cond_P", "cond_X") if key in found]
    return "; ".join(parts)
