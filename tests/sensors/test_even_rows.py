import jax.numpy as jnp
import numpy as np
import pytest

from jblast.sensors.layout import joined, picked, stride_of

CASES = {
    "one behind the other": [[0, 1, 2], [3, 4, 5]],
    "in turn": [[0, 2, 4], [1, 3, 5]],
    "in no order": [[4, 0], [1, 5], [3, 2]],
    "of different sizes": [[0, 5, 1, 4], [2, 3]],
    "not every row": [[0, 3], [5]],
    "a row twice": [[0, 1, 2, 3, 4, 5], [1, 3]],
}


@pytest.mark.parametrize("name", CASES)
def test_parts_are_added_up_in_their_rows(name):
    parts = [
        (np.array(rows), jnp.asarray(1.5 + np.arange(len(rows))))
        for rows in CASES[name]
    ]
    whole = np.zeros(6)
    for rows, x in parts:
        np.add.at(whole, rows, np.asarray(x))
    np.testing.assert_array_equal(joined(parts, 6), whole)


@pytest.mark.parametrize("name", CASES)
def test_of_yes_and_no_a_row_is_false_where_any_part_says_so(name):
    parts = [(np.array(rows), jnp.arange(len(rows)) != 1) for rows in CASES[name]]
    whole = np.ones(6, bool)
    for rows, x in parts:
        np.logical_and.at(whole, rows, np.asarray(x))
    np.testing.assert_array_equal(joined(parts, 6), whole)


def test_rows_are_those_asked_for():
    x = jnp.arange(6.0) ** 2
    for rows in ([0, 1, 2], [1, 3, 5], [2], [4, 0, 5], [0, 3, 4]):
        np.testing.assert_array_equal(picked(x, np.array(rows)), np.array(x)[rows])
    assert [stride_of(np.array(r)) for r in ([0, 1], [1, 4, 7], [3], [2, 1])] == [
        *(1, 3, 1, 0)
    ]
