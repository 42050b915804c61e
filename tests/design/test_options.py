# SPDX-License-Identifier: MIT
"""Option tables against a dataclass."""

import math
from dataclasses import dataclass, field
from typing import Literal

import pytest

from blw import options
from blw.errors import ModelError


@dataclass(frozen=True)
class Options:
    gamma: float | None = field(default=None, metadata={"gt": 0})
    window: int | Literal["ewma"] = "ewma"
    horizon: int = field(default=6, metadata={"ge": 1, "le": 100})
    reseed: bool = False
    weights: list[float] = field(default_factory=list, metadata={"gt": 0})
    pairs: list[tuple[str, list[str]]] = field(default_factory=list)


def test_parse_given_nothing_takes_the_defaults():
    assert options.parse(Options, {}, "m") == Options()


def test_parse_given_every_key_converts_it():
    raw = {"gamma": 2, "window": 200, "horizon": 3, "reseed": True, "weights": [1, 1.5],
           "pairs": [["y1", ["y3", "y4"]]]}
    parsed = options.parse(Options, raw, "m")
    assert parsed == Options(2.0, 200, 3, True, [1.0, 1.5], [("y1", ["y3", "y4"])])
    assert isinstance(parsed.gamma, float)


@pytest.mark.parametrize("raw, message", [
    ({"gama": 1}, "m: unknown key 'gama'; did you mean 'gamma'?"),
    ({"zzz": 1}, "m: unknown key 'zzz'; known: gamma, window"),
    ({"gamma": "1"}, "m.gamma must be a finite number, not '1'"),
    ({"gamma": True}, "m.gamma must be a finite number"),
    ({"gamma": math.nan}, "m.gamma must be a finite number, not nan"),
    ({"gamma": 0}, "m.gamma must be greater than 0, not 0"),
    ({"window": "boxcar"}, "m.window must be an integer or 'ewma', not 'boxcar'"),
    ({"window": 2.0}, "m.window must be an integer or 'ewma'"),
    ({"horizon": 0}, "m.horizon must be at least 1"),
    ({"horizon": 101}, "m.horizon must be at most 100"),
    ({"reseed": 1}, "m.reseed must be true or false, not 1"),
    ({"weights": [1, -1]}, "m.weights, entry 2, must be greater than 0"),
    ({"weights": 1}, "m.weights must be a list of (a finite number)"),
    ({"pairs": [["y1"]]}, "m.pairs must be a list"),
    ([], "m must be a table of options"),
])
def test_parse_given_bad_value_says_what_and_where(raw, message):
    with pytest.raises(ModelError) as caught:
        options.parse(Options, raw, "m")
    assert message in str(caught.value)
