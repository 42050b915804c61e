# SPDX-License-Identifier: MIT
"""The one description of the tables: JSON, walk, checks."""

import numpy as np
import pytest

from blw.errors import DesignError
from blw.tables import Struct, index, real, table


def nested() -> Struct:
    leaf = Struct("leaf_t", "leaf", {"a": table([3.0, 4.0]), "k": 2})
    return Struct("top_t", "top", {
        "M": table([[1.0, 2.0]], "[1 x 2]"),
        "one": leaf,
        "rho": real(5.0),
        "many": [Struct("leaf_t", "x", {"a": table([6.0])}),
                 Struct("leaf_t", "x", {"a": table([7.0])})],
        "first": index([0, 2]),
        "none": None,
    })


def test_to_json_given_nested_struct_has_the_c_names():
    assert nested().to_json() == {
        "M": [1.0, 2.0], "one": {"a": [3.0, 4.0], "k": 2}, "rho": 5.0,
        "many": [{"a": [6.0]}, {"a": [7.0]}], "first": [0, 2], "none": None}


def test_reals_given_nested_struct_walks_depth_first_in_member_order():
    walked = np.concatenate(list(nested().reals()))
    np.testing.assert_array_equal(walked, [1, 2, 3, 4, 5, 6, 7])


def test_table_given_empty_array_is_null():
    assert table(np.zeros((3, 0))) is None
    assert index([]) is None


def test_table_given_what_float32_cannot_hold_normally_stores_zero():
    np.testing.assert_array_equal(table([1e-39, -0.0, 1e-37]).array, [0.0, 0.0, 1e-37])


def test_table_given_an_array_copies_it():
    source = np.ones(2)
    stored = table(source)
    source[0] = 5.0
    np.testing.assert_array_equal(stored.array, [1.0, 1.0])


@pytest.mark.parametrize("value", [1e39, -1e39, np.nan, np.inf])
def test_check_given_number_that_overflows_float32_names_the_entry(value):
    struct = Struct("t", "bank", {"filters": [Struct("f", "f", {"K": table([0.0, value])})]})
    with pytest.raises(DesignError, match=r"table bank\.filters\[0\]\.K\[1\] = .* float32"):
        struct.check()


@pytest.mark.parametrize("values", [[-1], [65536], [0.5]])
def test_index_given_value_out_of_its_type_refuses(values):
    with pytest.raises(ValueError, match="index table 'subsets'"):
        index(values, "subsets")
