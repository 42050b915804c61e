# SPDX-License-Identifier: MIT
"""What the estimators of `joint` achieve: steady state, errors under an attack of a given size, and
the Kalman filters they have to be compared with."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_discrete_lyapunov

from blw import kalman
from blw.errors import DesignError
from blw.joint_recursion import (
    Gains,
    Pair,
    Recursion,
    Stack,
    deviations,
    fused_covariance,
    fusion_weights,
)
from blw.model import Model

Array = NDArray[np.float64]

MAX_STEPS = 20000
CONVERGED = 1e-13    # relative change of a step that is taken for rounding
SETTLED = 1e-10      # the same for covariances under given gains
VANISHED = 1e-10     # of a variance's size: below, it is one that goes to 0
PULSE_STEPS = 20     # after a false sample, in which the largest error lies
EQUAL = 1.02         # variances whose ratio is below are called equal
CONDITION = 1e9      # growth of a covariance that is taken for divergence


@dataclass(frozen=True, eq=False)
class Step:
    """Gains, weights G [r n, n], and the variances that go with them.

    theta, gap  [r] error variances of theta, and where the weak sensor's sample is missing
    fused       [n] error variances of the fused state
    """

    gains: Gains
    G: Array
    theta: Array
    gap: Array
    fused: Array

    def flat(self, model: Model, pairs: Sequence[Pair], unit: Array) -> Array:
        """Everything that a schedule holds, as one vector without units.

        unit  [n] of the states; the sensors' are the deviations of their noise
        """
        noise = deviations(np.diag(model.R))
        parts = [self.G * np.tile(unit, len(pairs))[:, None] / unit]
        for pair, K, Gamma, theta in zip(pairs, self.gains.K, self.gains.Gamma, self.theta,
                                         strict=True):
            weak = noise[pair.weak]
            rows = np.vstack([K, Gamma]) / np.append(unit, [weak, weak])[:, None]
            parts += [rows * noise[list(pair.sensors)], np.sqrt(theta) / weak]
        return np.concatenate([np.ravel(part) for part in parts])


def transient(model: Model, pairs: Sequence[Pair], P0: Array, eta: Array,
              printed: bool = False) -> list[Step]:
    """Steps k = 1, 2, ... until nothing changes any more.  Raises DesignError."""
    stack = Stack(model, pairs, shared_noise=not printed)
    recursion = Recursion(stack, P0, eta, printed)
    size = sizes(model, pairs, P0, eta)
    steps: list[Step] = []
    for _ in range(MAX_STEPS):
        PX, V = recursion.PX, recursion.V
        gains = recursion.advance()
        if not (np.diag(recursion.PX) <= CONDITION * size).all():
            raise DesignError("the covariances of the local estimators grow without bound"
                              + (": the printed recursion is not stable here" if printed else ""))
        G = fusion_weights(recursion.Sigma, model.n)
        steps.append(Step(gains, G, recursion.theta_variance.copy(), recursion.gap_variance(gains),
                          np.diag(fused_covariance(recursion.Sigma, G))))
        change = max(relative_change(recursion.PX, PX, size),
                     relative_change(recursion.V, V, size[stack.attack_rows]))
        if change <= CONVERGED:
            return steps
    raise DesignError(f"the gains have not settled after {MAX_STEPS} steps: they still change by "
                      f"{change:.1e} per step")


def sizes(model: Model, pairs: Sequence[Pair], P0: Array, eta: Array) -> Array:
    """[r (n + 1)] variances to measure those of the local estimators by, each in its own unit."""
    best = kalman.steady_state(model.A, model.C, model.W, model.R).P
    state = np.diag(best) + np.diag(P0)
    return np.concatenate([np.append(state, eta[i] + model.R[pair.weak, pair.weak])
                           for i, pair in enumerate(pairs)])


def relative_change(now: Array, last: Array, size: Array) -> float:
    """Between two covariances, every entry in units of the deviations that it belongs to; what has
    all but vanished from its size counts as nothing."""
    unit = deviations(np.maximum(np.abs(np.diag(now)), VANISHED * size))
    return float((np.abs(now - last) / np.outer(unit, unit)).max())


@dataclass(frozen=True, eq=False)
class Performance:
    """Mean squared errors in steady state: of each local state, of the fused one, of theta [r]."""

    local: Array
    fused: float
    theta: Array


def performance(model: Model, pairs: Sequence[Pair], step: Step, variance: Array) -> Performance:
    """Errors of fixed gains when theta is white with these variances [r]; 0 is no attack."""
    P0 = np.zeros((model.n, model.n))
    recursion = Recursion(Stack(model, pairs), P0, variance)
    size = sizes(model, pairs, P0, variance)
    for _ in range(MAX_STEPS):
        PX = recursion.PX
        recursion.advance(step.gains)
        if not (np.diag(recursion.PX) <= CONDITION * size).all():
            raise DesignError("the local estimators are not stable under their gains")
        if relative_change(recursion.PX, PX, size) <= SETTLED:
            break
    local = np.diag(recursion.Sigma).reshape(len(pairs), model.n).sum(axis=1)
    fused = float(np.trace(fused_covariance(recursion.Sigma, step.G)))
    return Performance(local, fused, recursion.theta_variance.copy())


def pulse_errors(model: Model, pairs: Sequence[Pair], step: Step, size: float,
                 length: int) -> Array:
    """[length, r] mean squared errors of theta from one false sample of that size on, with fixed
    gains and no other attack."""
    stack = Stack(model, pairs)
    mean = np.zeros((length, len(pairs)))
    Aa = stack.Aa[stack.state(0), stack.state(0)]
    for i, (C, K, Gamma) in enumerate(zip(stack.C, step.gains.K, step.gains.Gamma, strict=True)):
        X, phi = np.zeros(model.n + 1), 0.0
        for k in range(length):
            attack = size if k == 0 else 0.0
            X = Aa @ X
            X[-1] += phi
            innovation = C[:, -1] * attack - C @ X
            X, phi = X + K @ innovation, phi + Gamma @ innovation
            mean[k, i] = attack - X[-1]
    return mean**2 + performance(model, pairs, step, np.zeros(len(pairs))).theta


def sweep(model: Model, pairs: Sequence[Pair], P0: Array, etas: Sequence[float], size: float,
          printed: bool = False) -> list[dict[str, Any]]:
    """State and attack-signal errors of every compensation factor, for an attack of that size.

    `white` is the attack with the variance size^2 on all weak sensors, `pulse` one false sample:
    the largest mean squared error at or after it.
    """
    rows = []
    for eta in etas:
        step = transient(model, pairs, P0, np.full(len(pairs), eta), printed)[-1]
        benign = performance(model, pairs, step, np.zeros(len(pairs)))
        white = performance(model, pairs, step, np.full(len(pairs), size**2))
        rows.append({
            "eta": eta,
            "state_benign": benign.fused,
            "state_white": white.fused,
            "theta_benign": benign.theta.tolist(),
            "theta_white": white.theta.tolist(),
            "theta_pulse": pulse_errors(model, pairs, step, size, PULSE_STEPS).max(axis=0).tolist(),
        })
    return rows


def default_size(model: Model, pairs: Sequence[Pair]) -> float:
    """Ten standard deviations of the noisiest weak sensor."""
    return 10 * float(np.sqrt(max(model.R[pair.weak, pair.weak] for pair in pairs)))


def decades(model: Model, pairs: Sequence[Pair], size: float) -> list[float]:
    """Powers of ten from a tenth of the quietest weak sensor's variance to ten times size^2."""
    low = min(model.R[pair.weak, pair.weak] for pair in pairs) / 10
    first = int(np.floor(np.log10(low) + 1e-9))
    last = int(np.ceil(np.log10(10 * size**2) - 1e-9))
    return [float(f"1e{exponent}") for exponent in range(first, max(first, last) + 1)]


def strong_filter(model: Model, strong: Sequence[int]) -> float | None:
    """tr P of a Kalman filter on these sensors alone; None if they do not see every mode."""
    rows = list(strong)
    if not rows:
        return None
    try:
        found = kalman.steady_state(model.A, model.C[rows], model.W, model.R[np.ix_(rows, rows)])
    except DesignError:
        return None
    return float(np.trace(found.P))


def central_filter(model: Model, pairs: Sequence[Pair], eta: Array,
                   actual: Array | None = None) -> float:
    """tr P of one Kalman filter on all their sensors, eta [r] added to the noise of the weak ones.

    actual  [r] variances of white attacks that it meets; default: eta
    """
    rows = sorted({sensor for pair in pairs for sensor in pair.sensors})

    def noise(variance: Array) -> Array:
        extra = np.zeros(model.m)
        extra[[pair.weak for pair in pairs]] = variance
        return (model.R + np.diag(extra))[np.ix_(rows, rows)]

    K = kalman.steady_state(model.A, model.C[rows], model.W, noise(eta)).K
    R = noise(eta if actual is None else actual)
    keep = np.eye(model.n) - K @ model.C[rows]
    added = keep @ model.W @ keep.T + K @ R @ K.T
    unit = deviations(np.diag(added))
    P = solve_discrete_lyapunov(keep @ model.A * unit / unit[:, None],
                                added / np.outer(unit, unit))
    return float(np.diag(P) @ unit**2)


def verdict(names: Sequence[str], fused: float, strong: float | None, central: float) -> str:
    """What a reader should know before choosing the method, in a sentence or two."""
    listed = ", ".join(names)
    if not names:
        return "no partner is strong at the start: until one is, no attack can be told from motion"
    if strong is None:
        return (f"the strong sensors alone ({listed}) do not see every mode, so no Kalman filter "
                "can run on them; an attack that imitates an unseen mode stays unseen")
    if strong <= EQUAL * fused:
        text = (f"a Kalman filter on the strong sensors alone ({listed}) does as well: tr P "
                f"{strong:.4g} against {fused:.4g} of the fusion; what the method adds is the "
                "estimate of the attack signal")
    else:
        text = (f"the fusion has tr P {fused:.4g}, a Kalman filter on the strong sensors alone "
                f"({listed}) {strong:.4g}")
    if central * EQUAL < fused:
        text += (f"; one Kalman filter on all sensors with eta added to the noise of the weak ones "
                 f"would have {central:.4g}, without estimating the attack")
    return text
