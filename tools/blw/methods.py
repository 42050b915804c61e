# SPDX-License-Identifier: MIT
"""The methods that can be designed, by name, in the order in which they are tried and listed.

A module has NAME, a dataclass Options, design(model, kalman, options) -> Designed, and GAPS, what
it makes of sensors that send in a share of the steps only (plant.rate):

"weighted"      their samples count 1 / rate times: model and kalman are those of gaps.averaged(),
                and the gains on samples have to be multiplied by model.weight
"counted once"  model and kalman are those of gaps.cautious()
"ignored"       a missing sample is a rare event
"""

from types import ModuleType

from blw import bank, canonical, decentral, guard, joint, kalman, lasso

REGISTRY: dict[str, ModuleType] = {module.NAME: module for module in (
    kalman,
    lasso,
    canonical,
    decentral,
    bank,
    joint,
    guard,
)}
