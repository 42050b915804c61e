# SPDX-License-Identifier: MIT
"""Units out of names: `angle_rad_s` is the quantity `angle` in rad/s."""
from __future__ import annotations

from blw import names

_SUPERSCRIPT = str.maketrans("234", "²³⁴")


def split(name: str) -> tuple[str, str]:
    """(quantity, unit) of a name; the unit is "" if the name ends in none that is known."""
    unit = names.unit(name)
    if not unit or len(name) <= len(unit) + 1:
        return name, ""
    return name[: -len(unit) - 1], unit.translate(_SUPERSCRIPT)


def label(name: str) -> str:
    """A name as the label of a panel: "angle (rad/s)"."""
    quantity, unit = split(name)
    return f"{quantity} ({unit})" if unit else quantity


def common(names: list[str]) -> str:
    """The unit that all names share, else "mixed units" or, if none has any, "model units"."""
    found = {split(name)[1] for name in names}
    if found == {""}:
        return "model units"
    return found.pop() if len(found) == 1 else "mixed units"
