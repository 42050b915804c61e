# SPDX-License-Identifier: MIT
"""The methods that can be designed, by name, in the order in which they are tried and listed.

A module has NAME, a dataclass Options, and design(model, kalman, options) -> Designed.  Where
AVERAGES is true, a sensor's samples count 1 / rate times: model and kalman are those of
Model.averaged(), and the gains on samples have to be multiplied by model.weight.
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
