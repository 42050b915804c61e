# SPDX-License-Identifier: MIT
"""Numbers as C literals that are exact as double and round once as float."""

from decimal import Decimal

import numpy as np


def literal(x: float) -> str:
    """A C decimal that is x as double and the float next to x as float, in 17 digits or fewer.

    A compiler rounds the decimal to float at once, whereas the checksum rounds the double.  The two
    differ only if x lies half-way between two floats and its decimal does not; then all digits.
    """
    text = f"{Decimal(x):e}" if _half_way(x) else repr(float(x))
    return text if any(mark in text for mark in ".e") else text + ".0"


def _half_way(x: float) -> bool:
    near = np.float32(x)
    if float(near) == x:
        return False
    other = np.nextafter(near, np.float32(np.inf if x > float(near) else -np.inf))
    return abs(x - float(near)) == abs(x - float(other))
