# SPDX-License-Identifier: MIT
"""The filters, left inverses and thresholds of method `bank`: [B] Algorithm 2.

One of the sets s of all sensors but p is free of attack.  Every subset i of s that leaves out 2 p
sensors is observable, and yields x from h steps of outputs alone, x_i = Z_i Y_i.  The set passes if
for each of its subsets

    average of |x_i - x_s|^2  <=  P_opt,s + tr(Z M Z') [- 2 tr(Z_0 (K R)')] + epsilon            (1)

with epsilon from the wanted probability of rejecting a set without attack (bank_moments).
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import combinations
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from blw import bank_moments as moments
from blw import gaps, margin
from blw.errors import DesignError
from blw.kalman import modes, unseen
from blw.model import Model

MAX_SENSORS = 8           # BLW_BANK_MAX_SENSORS
MAX_ATTACKED = 2          # BLW_BANK_MAX_ATTACKED
MAX_HORIZON = 255
GLS_HORIZON = 6           # longer blocks gain little ([B] does not say; measured)
INVERSE_ERROR = 1e-6      # of Z O = I

Array = NDArray[np.float64]
Sensors = tuple[int, ...]


@dataclass(frozen=True)
class Options:
    """[method.bank] of a model file.

    window           blocks per decision, or "ewma": an exponentially weighted average, every step
    memory           of the ewma, in steps: white q is averaged as well as by a window this long
    horizon          steps in a block; default 6, or the observability index where that is larger
                     or left_inverse is "pinv"
    theta            sensors (or groups) in a subset; default all but 2 p, the largest allowed
    false_rejection  probability that a set without attack fails at a decision, at most
    left_inverse     "gls": least variance; "pinv": as printed in [B]
    version          "filter": estimates from y(1..k); "prediction": from y(1..k-1)
    gate             an innovation larger than this many standard deviations rejects a set at once,
                     for one horizon
    grouped          with a window, as printed: one average for each of `horizon` groups of blocks
                     that do not overlap
    """

    window: int | Literal["ewma"] = field(default="ewma", metadata={"ge": 1, "le": 65535})
    memory: int = field(default=200, metadata={"ge": 1, "le": 65535})
    horizon: int | None = field(default=None, metadata={"ge": 1, "le": MAX_HORIZON})
    theta: int | None = field(default=None, metadata={"ge": 1})
    false_rejection: float = field(default=0.01, metadata={"gt": 0, "lt": 1})
    left_inverse: Literal["gls", "pinv"] = "gls"
    gate: float = field(default=5.0, metadata={"gt": 0, "le": 1e6})
    version: Literal["filter", "prediction"] = "filter"
    grouped: bool = False


@dataclass(frozen=True, eq=False)
class Member:
    """One filter of the bank: its sensors, gain K [n, m] and covariances P, Pp [n, n]."""

    sensors: Sensors
    K: Array
    P: Array
    Pp: Array

    def p_opt(self, filtered: bool) -> float:
        """Trace of the covariance of the estimate that the version returns."""
        return float(np.trace(self.P if filtered else self.Pp))


@dataclass(frozen=True, eq=False)
class Block:
    """One subset: its sensors, horizon h, Z [n, h theta] and N [h, n, n+m] of bank_moments (1)."""

    sensors: Sensors
    horizon: int
    Z: Array
    N: Array


@dataclass(frozen=True)
class Test:
    """One inequality (1): set, subset (as positions), mean of q and epsilon."""

    member: int
    block: int
    mean: float
    epsilon: float

    @property
    def limit(self) -> float:
        """Right side of (1)."""
        return self.mean + self.epsilon


@dataclass(frozen=True, eq=False)
class Bank:
    """Everything that is computed for one model: members in the order of their P_opt."""

    members: list[Member]
    blocks: list[Block]
    tests: list[Test]
    horizon: int
    groups: int
    gain: float

    @property
    def per_set(self) -> int:
        """Subsets of every set."""
        return len(self.tests) // len(self.members)


def build(model: Model, options: Options) -> Bank:
    """Filters, left inverses and thresholds.  Raises DesignError as design() does."""
    theta = _check(model, options)
    units = model.units
    noise = moments.Noise(model.A, model.C, model.W, model.R)
    filtered = options.version == "filter"
    members = [_member(model, sensors) for sensors in _unions(units, len(units) - model.p)]
    members.sort(key=lambda member: member.p_opt(filtered))
    blocks = _blocks(model, noise, options, _unions(units, theta))
    horizon = max(block.horizon for block in blocks)
    groups = horizon if options.grouped else 1
    if options.window != "ewma" and options.window % groups:
        raise DesignError(f"window = {options.window} is not a multiple of the {groups} groups of "
                          "blocks")
    gain = (2.0 / (options.memory + 1) if options.window == "ewma" else groups / options.window)
    tests = _tests(model, options, members, blocks, (groups, gain))
    return Bank(members, blocks, tests, horizon, groups, gain)


def _check(model: Model, options: Options) -> int:
    """The size of the subsets.  Refuses what the device or [B] (5) cannot serve."""
    units, p = len(model.units), model.p
    if model.m > MAX_SENSORS:
        raise DesignError(f"{model.m} sensors: the bank serves at most {MAX_SENSORS}, its work "
                          "grows with the number of sets")
    if p > MAX_ATTACKED:
        raise DesignError(f"p = {p}: the bank serves at most {MAX_ATTACKED}")
    what = "groups" if model.groups else "sensors"
    if units - 2 * p < 1:
        raise DesignError(f"{units} {what} with p = {p} attacked leave none to decide: m - 2 p "
                          "must be at least 1")
    theta = units - 2 * p if options.theta is None else options.theta
    if theta > units - 2 * p:
        raise DesignError(f"theta = {theta} is larger than m - 2 p = {units - 2 * p}: a subset "
                          "without attack need not exist")
    if options.grouped and options.window == "ewma":
        raise DesignError('grouped needs a window; window = "ewma" averages over all blocks')
    if options.memory != Options.memory and options.window != "ewma":
        raise DesignError('memory needs window = "ewma"; a window is its own memory')
    return theta


def _unions(units: Sequence[Sequence[int]], size: int) -> list[Sensors]:
    """All sets of `size` units, as sorted sensors."""
    return [tuple(sorted(i for unit in chosen for i in unit))
            for chosen in combinations(units, size)]


def _member(model: Model, sensors: Sensors) -> Member:
    rows = list(sensors)
    kalman, _ = gaps.steady(model.A, model.C[rows], model.W, model.sample_R[np.ix_(rows, rows)],
                            model.weight[rows])
    K = np.zeros((model.n, model.m))
    K[:, rows] = kalman.K
    return Member(sensors, K, kalman.P, kalman.Pp)


def _blocks(model: Model, noise: moments.Noise, options: Options,
            subsets: list[Sensors]) -> list[Block]:
    indices = [_observability_index(model, subset) for subset in subsets]
    longest = max(indices)
    if options.horizon is not None and options.horizon < longest:
        names = _names(model, subsets[indices.index(longest)])
        raise DesignError(f"horizon = {options.horizon} is shorter than the observability index "
                          f"{longest} of {names}")
    if options.left_inverse == "pinv":
        horizons = [options.horizon or mu for mu in indices]
    else:
        horizons = [options.horizon or max(GLS_HORIZON, longest)] * len(subsets)
    return [_block(model, noise, subset, (h, options.left_inverse))
            for subset, h in zip(subsets, horizons)]


def _block(model: Model, noise: moments.Noise, subset: Sensors, how: tuple[int, str]) -> Block:
    horizon, kind = how
    Z = moments.left_inverse(noise, subset, horizon, kind)
    O = moments.observability_matrix(model.A, model.C[list(subset)], horizon)
    size = _state_sizes(O)
    error = np.abs((Z @ O - np.eye(model.n)) * size[:, None] / size).max()
    if not error <= INVERSE_ERROR:
        raise DesignError(f"the left inverse of {_names(model, subset)} over {horizon} steps is "
                          f"wrong by {error:.3g}: choose another horizon")
    response = Z @ moments.block_response(noise, subset, horizon)
    N = response.reshape(model.n, horizon, -1).transpose(1, 0, 2)
    return Block(subset, horizon, Z, N)


def _observability_index(model: Model, subset: Sensors) -> int:
    """Fewest steps of outputs that determine the state; n where powers of A hide the rank."""
    C = model.C[list(subset)]
    for mode in modes(model.A):
        if unseen(model.A, C, mode):
            raise DesignError(f"{_names(model, subset)} alone cannot see the mode {mode:.6g}: the "
                              "bank needs every subset of its theta sensors to be observable")
    for steps in range(1, model.n):
        O = moments.observability_matrix(model.A, C, steps)
        if np.linalg.matrix_rank(O / _state_sizes(O), tol=1e-9) == model.n:
            return steps
    return model.n


def _state_sizes(O: Array) -> Array:
    """[n] size of each state in the outputs, so that the units of states do not matter."""
    size: Array = np.linalg.norm(O, axis=0)
    return np.where(size > 0.0, size, 1.0)


def _with_gaps(model: Model, member: Member) -> moments.Noise:
    """The noise of samples that count 1/q times in a share q of the steps, about one filter."""
    R = gaps.noise(model.C, member.Pp, model.sample_R, model.weight)
    return moments.Noise(model.A, model.C, model.W, R)


def _tests(model: Model, options: Options, members: list[Member], blocks: list[Block],
           averaging: tuple[int, float]) -> list[Test]:
    """All pairs of a set and a subset of it, set by set.

    A disturbance that moves the residue by at most delta raises the root of its mean square by no
    more than that.
    """
    groups, gain = averaging
    bounds = margin.sigma(model)
    filtered = options.version == "filter"
    found = []
    for number, member in enumerate(members):
        noise = _with_gaps(model, member)
        inside = [i for i, block in enumerate(blocks) if set(block.sensors) <= set(member.sensors)]
        risk = options.false_rejection / (len(inside) * groups)
        for i in inside:
            residue = moments.residue(noise, member.K, member.Pp, blocks[i].N, filtered)
            mean = residue.mean()
            if options.window == "ewma":
                variance = residue.ewma_variance(gain)
                skewness = residue.ewma_skewness(gain, variance)
            else:
                variance = residue.window_variance(round(1.0 / gain), groups)
                skewness = None
            epsilon = moments.upper_quantile(mean, variance, risk, skewness) - mean
            delta = margin.largest(_settled(noise, member, blocks[i], filtered), bounds)
            if delta > 0.0:
                epsilon = (np.sqrt(mean + epsilon) + delta) ** 2 - mean
            found.append(Test(number, i, mean, epsilon))
    return found


def _settled(noise: moments.Noise, member: Member, block: Block, filtered: bool) -> Array:
    """[n x m] answer of the residue to constants on the sensors: FIR less filter."""
    AK = noise.A @ member.K
    Phi = noise.A - (member.K @ noise.C @ noise.A if filtered else AK @ noise.C)
    K = member.K if filtered else AK
    M = -np.linalg.solve(np.eye(len(noise.A)) - Phi, K)
    M[:, list(block.sensors)] += block.Z.reshape(len(M), block.horizon, -1).sum(axis=1)
    return M


def _names(model: Model, sensors: Sensors) -> str:
    return "{" + ", ".join(model.sensors[i] for i in sensors) + "}"
