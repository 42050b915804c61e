# SPDX-License-Identifier: MIT
"""Method `bank`: a Kalman filter per set of sensors, judged by block residues; see blw_bank.h.

[B] Algorithm 2, corrected and made causal: docs/bank.md.  The design itself is in bank_build.
"""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blw import bank_moments as moments
from blw.bank_build import MAX_HORIZON, Bank, Block, Member, Options, Sensors, build
from blw.design import Designed
from blw.kalman import Kalman
from blw.model import Model
from blw.tables import Struct, index, real, table

NAME = "bank"
GAPS = "weighted"

CEILING = 1.5             # of an average over its threshold: it recovers in a third of the memory
SETTLED = 0.01            # part of P_opt that the initial error may still hold
UNKNOWN_START = 1e4       # times P: the initial error covariance that is provided for without P0
MAX_WARM_UP = 60000
MOST_GAP = 254            # steps that the device can tell from silence
WORTHWHILE = 0.8          # of epsilon: a longer horizon that leaves more is not proposed

Array = NDArray[np.float64]


def design(model: Model, kalman: Kalman, options: Options) -> Designed:
    """Tables and figures of `bank` for one model.

    Raises DesignError where [B]'s condition fails (naming the subset that is not observable), where
    the model is beyond the limits of the device, or where the options contradict each other.
    """
    bank = build(model, options)
    warm_up = _warm_up(model, kalman, bank)
    sizes = (model.n, model.m, len(bank.members), len(bank.blocks),
             len(bank.tests) * bank.groups, bank.horizon, int(_max_gap(model) > 0))
    return Designed(_tables(model, options, bank, warm_up), _info(model, options, bank, warm_up),
                    mem=sizes)


def _max_gap(model: Model) -> int:
    """Steps after which a sensor is silent; 0 if all send in every step."""
    return 0 if np.all(model.rate == 1.0) else min(MOST_GAP, model.silence)


def _warm_up(model: Model, kalman: Kalman, bank: Bank) -> int:
    """First step whose block starts when the initial error no longer counts."""
    P0 = UNKNOWN_START * kalman.P if model.P0 is None else model.P0
    slowest = 0
    for member in bank.members:
        Phi = model.A - model.A @ member.K @ model.C
        error = model.A @ P0 @ model.A.T
        steps = 0
        while np.trace(error) > SETTLED * np.trace(member.Pp) and steps < MAX_WARM_UP:
            error = Phi @ error @ Phi.T
            steps += 1
        slowest = max(slowest, steps)
    return slowest + bank.horizon


def _tables(model: Model, options: Options, bank: Bank, warm_up: int) -> Struct:
    K = np.concatenate([(member.K * model.weight)[:, list(member.sensors)].ravel()
                        for member in bank.members])
    Z = np.concatenate([_padded(model, block, bank.horizon) for block in bank.blocks])
    limits = np.array([test.limit for test in bank.tests])
    variances = np.concatenate([_innovation_variance(model, member) for member in bank.members])
    return Struct("blw_bank_model_t", NAME, {
        "sets": len(bank.members),
        "subsets": len(bank.blocks),
        "per_set": bank.per_set,
        "horizon": bank.horizon,
        "groups": bank.groups,
        "filtered": int(options.version == "filter"),
        "max_gap": _max_gap(model),
        "window": 0 if options.window == "ewma" else options.window,
        "warm_up": warm_up,
        "set_mask": index([_mask(member.sensors) for member in bank.members],
                          "[sets] sensors, in the order of P_opt"),
        "subset_mask": index([_mask(block.sensors) for block in bank.blocks],
                             "[subsets] sensors"),
        "pair": index([test.block for test in bank.tests],
                      "[sets x per_set] subsets of every set"),
        "gain": real(bank.gain),
        "ceiling": real(CEILING),
        "K": table(K, "[sets][n x size of the set] gains"),
        "Z": table(Z, "[subsets][n x horizon x size of the subset] left inverses"),
        "scale": table(1.0 / limits, "[sets x per_set] 1 / right side of the test"),
        "start": table(np.array([test.mean for test in bank.tests]) / limits,
                       "[sets x per_set] benign mean of q, scaled"),
        "gate": table(1.0 / (options.gate**2 * variances),
                      "[sets][size of the set] 1 / largest innovation^2"),
    }, method=NAME)


def _innovation_variance(model: Model, member: Member) -> Array:
    """[size of the set] of single samples of each of its sensors."""
    C = model.C[list(member.sensors)]
    R = np.diag(model.sample_R)[list(member.sensors)]
    return np.einsum("ij,jk,ik->i", C, member.Pp, C) + R


def _padded(model: Model, block: Block, horizon: int) -> Array:
    """Z with zeros for the steps beyond the block's own horizon, flat; for samples as they come."""
    Z = np.zeros((model.n, horizon * len(block.sensors)))
    Z[:, :block.Z.shape[1]] = block.Z
    return (Z * np.tile(model.weight[list(block.sensors)], horizon)).ravel()


def _mask(sensors: Sensors) -> int:
    return sum(1 << i for i in sensors)


def _info(model: Model, options: Options, bank: Bank, warm_up: int) -> dict[str, Any]:
    """What a reader wants to know; the guarantee is explained in docs/bank.md."""
    filtered = options.version == "filter"
    p_opt = [member.p_opt(filtered) for member in bank.members]
    epsilon = max(test.epsilon for test in bank.tests)
    return {
        "version": options.version,
        "left_inverse": options.left_inverse,
        "horizon": bank.horizon,
        "theta": len(model.units) - 2 * model.p if options.theta is None else options.theta,
        "decision": ({"window": "ewma", "memory": options.memory, "gain": bank.gain}
                     if options.window == "ewma"
                     else {"window": options.window, "groups": bank.groups}),
        "false_rejection": options.false_rejection,
        "false_rejection_per_test": options.false_rejection / (bank.per_set * bank.groups),
        "warm_up_steps": warm_up,
        "sets": [{"sensors": [model.sensors[i] for i in member.sensors], "P_opt": trace,
                  "slowest_pole": float(np.abs(np.linalg.eigvals(
                      model.A - model.A @ member.K @ model.C)).max())}
                 for member, trace in zip(bank.members, p_opt)],
        "subsets": [{"sensors": [model.sensors[i] for i in block.sensors],
                     "horizon": block.horizon,
                     "trace_M": _trace_of_noise(model, block)} for block in bank.blocks],
        "tests": [{"set": test.member, "subset": test.block, "mean": test.mean,
                   "epsilon": test.epsilon} for test in bank.tests],
        "P_opt_max": max(p_opt),
        "epsilon_max": epsilon,
        "guarantee": max(p_opt) + epsilon,
        "footprint": footprint(model, bank),
        "advice": _advice(model, options, bank, epsilon, max(p_opt)),
    }


def _advice(model: Model, options: Options, bank: Bank, epsilon: float,
            p_opt: float) -> str | None:
    """What twice the horizon would change, where epsilon is larger than P_opt and that helps."""
    longer = 2 * bank.horizon
    if not 0.0 < p_opt < epsilon or longer > MAX_HORIZON or options.grouped:
        return None
    ratio = epsilon / p_opt
    other = build(model, replace(options, horizon=longer))
    gain = max(test.epsilon for test in other.tests) / p_opt
    if gain > WORTHWHILE * ratio:
        return None
    work = footprint(model, other)["multiply_adds"] / footprint(model, bank)["multiply_adds"]
    return (f"epsilon is {ratio:.3g} P_opt; horizon = {longer} makes it {gain:.3g} P_opt for "
            f"{work:.2g} times the work")


def _trace_of_noise(model: Model, block: Block) -> float:
    """tr(Z M Z') of [B] (19)."""
    noise = moments.Noise(model.A, model.C, model.W, model.R)
    return float(sum(np.trace(N @ noise.joint @ N.T) for N in block.N))


def footprint(model: Model, bank: Bank) -> dict[str, int]:
    """Numbers of table and of memory, and multiply-adds of a step, the same whatever the data."""
    n, m, l = model.n, model.m, model.l
    sizes = [len(member.sensors) for member in bank.members]
    thetas = [len(block.sensors) for block in bank.blocks]
    h, tests = bank.horizon, len(bank.tests)
    seldom = int(_max_gap(model) > 0)
    return {
        "table_numbers": (n + 1) * sum(sizes) + n * h * sum(thetas) + 2 * tests + 2,
        "index_numbers": len(sizes) + len(thetas) + tests,
        "memory_numbers": memory_numbers(n, m, len(sizes), len(thetas), tests * bank.groups, h,
                                         seldom),
        "multiply_adds": (n * (n + l + m) + sum(n * n + 2 * (n + 1) * size for size in sizes)
                          + h * n * (n + m) + n * h * sum(thetas) + tests * (n + 2)
                          + seldom * (h * n * n * (n * len(thetas) + sum(thetas)) + tests * n * n)),
    }


def memory_numbers(n: int, m: int, sets: int, subsets: int, averages: int, horizon: int,
                   seldom: int) -> int:
    """BLW_BANK_MEM of blw_bank.h."""
    return (horizon * (sets * n + 2 * m + n) + (sets + subsets + 5) * n + averages + 2 * sets + m
            + seldom * subsets * n * n)
