# SPDX-License-Identifier: MIT
"""The status column of an estimate as the numbers of blw_estimator.h."""

OUTCOMES = ("kalman", "converged", "bound", "held")
FLAGS = {"missing": 0x01, "degraded": 0x02, "blind": 0x04, "warming_up": 0x08, "ambiguous": 0x10}


def outcome_and_flags(status: str) -> tuple[int, int]:
    """Of "kalman+missing" and the like; an unknown word is a bug of ours."""
    outcome, *flags = status.split("+")
    return OUTCOMES.index(outcome), sum(FLAGS[flag] for flag in flags)
