# SPDX-License-Identifier: MIT
"""Chi-square thresholds and comparisons for the device, and the tables of blw_chi2.h.

A statistic far out has a survival probability below the smallest number of any format, so all that
is compared here are logarithms; on the device not even those are needed:

    g1 at dof1 is more plausible than g2 at dof2  iff  g1 + c1(g1) < g2 + c2(g2),              (1)

where g + c(g) is the value that has the same survival probability at a common number of degrees of
freedom.  c is smooth and slow, so a short piecewise linear table holds it.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike, NDArray
from scipy.special import gammainc, gammaincc, gammainccinv, gammaincinv, gammaln

from blw.errors import DesignError
from blw.tables import Struct, table

Array = NDArray[np.float64]

#: False-alarm rates of the generated detector, the default first.
COMMON_RATES = (1e-3, 0.05, 0.01, 1e-4, 1e-5)

#: Samples in the sum of the generated detector.
WINDOW = 10

#: Largest error of a table of c, as twice the logarithm of a survival probability; its last knot.
TOLERANCE = 0.02
LAST_KNOT = 1e4
MAX_KNOTS = 64

_FAR = 400.0           # g/2 - dof/2 beyond which the continued fraction replaces gammaincc
_FRACTION_TERMS = 400
_NEWTON_STEPS = 60


def threshold(false_alarm: float, dof: float) -> float:
    """The value that chi2(dof) exceeds with the probability false_alarm."""
    return float(2.0 * gammainccinv(dof / 2.0, false_alarm))


def log_sf(g: ArrayLike, dof: float) -> Array:
    """log P(chi2(dof) > g), finite for every finite g."""
    x, a = np.asarray(g, dtype=float) / 2.0, dof / 2.0
    far = x > a + _FAR
    near_value = np.log(gammaincc(a, np.where(far, a, x)))
    far_value = _log_tail(a, np.where(far, x, a + _FAR))
    return np.where(far, far_value, near_value)


def log_pdf(g: ArrayLike, dof: float) -> Array:
    """Logarithm of the density of chi2(dof) at g > 0."""
    x, a = np.asarray(g, dtype=float) / 2.0, dof / 2.0
    return (a - 1.0) * np.log(x) - x - gammaln(a) - np.log(2.0)


def equivalent(g: ArrayLike, dof: float, reference: float) -> Array:
    """h with P(chi2(reference) > h) = P(chi2(dof) > g), for g >= 0; reference >= dof."""
    g = np.asarray(g, dtype=float)
    lower = gammainc(dof / 2.0, g / 2.0)
    h = 2.0 * gammaincinv(reference / 2.0, np.minimum(lower, 0.5))
    upper = lower > 0.5
    return np.where(upper, _upper_equivalent(np.where(upper, g, dof), dof, reference), h)


def survival_offset(dof: float, reference: float) -> Callable[[Array], Array]:
    """c of (1): the larger the survival probability, the smaller g + c(g)."""
    return lambda g: equivalent(g, dof, reference) - g


def density_offset(dof: float) -> Callable[[Array], Array]:
    """The same for the density p, which [D] maximises: g + c(g) = -2 log p(g), for g >= dof / 8."""
    return lambda g: -2.0 * log_pdf(np.maximum(g, dof / 8.0), dof) - g


@dataclass(frozen=True, eq=False)
class Offsets:
    """Piecewise linear c of several degrees of freedom: knots [K], c [len(dofs), K].

    Left of the first knot and right of the last c is constant."""

    knots: Array
    c: Array

    def score(self, row: int, g: ArrayLike) -> Array:
        """g + c(g), what the device compares."""
        return np.asarray(g, dtype=float) + np.interp(g, self.knots, self.c[row])


def offsets(functions: Sequence[Callable[[Array], Array]], dof: float) -> Offsets:
    """Tables of the given c on common knots; dof is the largest that occurs.

    An interval is halved until c is right in its middle.  Where every survival probability is
    close to 1, c need not be: its error counts by the slope of -2 log P(chi2(dof) > g + c).  Nor
    far out, where g itself is large.
    """
    knots = np.array([0.0, 0.25 * dof, 0.5 * dof, dof, 2.0 * dof, LAST_KNOT])
    while len(knots) < MAX_KNOTS:
        middle = (knots[1:] + knots[:-1]) / 2.0
        error = np.max([_missed(f, knots, middle, dof) for f in functions], axis=0)
        error /= 1.0 + middle / (4.0 * dof)
        if error.max() <= TOLERANCE:
            break
        knots = np.sort(np.append(knots, middle[error.argmax()]))
    return Offsets(knots, np.array([f(knots) for f in functions]))


def detector(S: Array, window: int = WINDOW, rates: Sequence[float] = COMMON_RATES) -> Struct:
    """Tables of blw_chi2_model_t for white residuals with the covariance S [p, p].

    window  samples in the sum, 1..255
    rates   false-alarm rates per step, the default first; the device can switch between them
    Raises DesignError if S is not positive definite.
    """
    try:
        L = np.linalg.cholesky(S)
    except np.linalg.LinAlgError:
        raise DesignError("the covariance of the residual is not positive definite") from None
    p = len(S)
    Linv = scipy.linalg.solve_triangular(L, np.eye(p), lower=True)
    thresholds = [[threshold(rate, p * w) for w in range(1, window + 1)] for rate in rates]
    return Struct("blw_chi2_model_t", "chi2", {
        "p": p, "W": window, "n_rates": len(rates),
        "Linv": table(Linv[np.tril_indices(p)], "[p (p + 1) / 2] L^-1, L L' = S, packed lower"),
        "rate": table(rates, "[n_rates] false-alarm rates"),
        "thr": table(thresholds, "[n_rates x W] thresholds"),
    })


def _missed(f: Callable[[Array], Array], knots: Array, middle: Array, dof: float) -> Array:
    """How far a line between neighbouring knots misses f in the middle, as a probability."""
    exact = f(middle)
    score = np.maximum(middle + exact, 1e-3)
    slope = 2.0 * np.exp(log_pdf(score, dof) - log_sf(score, dof))
    return slope * np.abs(exact - (f(knots[1:]) + f(knots[:-1])) / 2.0)


def _log_tail(a: float, x: Array) -> Array:
    """log Q(a, x) for x well above a, by the continued fraction of Lentz."""
    tiny = 1e-300
    b = x + 1.0 - a
    c = np.full_like(x, 1.0 / tiny)
    d = 1.0 / b
    h = d
    for i in range(1, _FRACTION_TERMS):
        term = -i * (i - a)
        b = b + 2.0
        d = 1.0 / (term * d + b)
        c = b + term / c
        h = h * (d * c)
        if np.all(np.abs(d * c - 1.0) < 1e-15):
            break
    return -x + a * np.log(x) - gammaln(a) + np.log(h)


def _upper_equivalent(g: Array, dof: float, reference: float) -> Array:
    """equivalent() above the median: Newton on the convex -log_sf, from the right."""
    target = log_sf(g, dof)
    h = g + 4.0 * (reference - dof) + 10.0
    for _ in range(_NEWTON_STEPS):
        value = log_sf(h, reference)
        step = (value - target) * np.exp(value - log_pdf(h, reference))
        h = np.maximum(h + step, 1e-3)
        if np.all(np.abs(step) <= 1e-12 * h):
            break
    return h
