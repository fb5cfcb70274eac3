"""Rows of a flight that are further apart than a blast is long."""

import numpy as np

from jblast.study.thinning import largest_since


def test_a_push_between_two_rows_is_in_the_later_row():
    force = np.zeros(13)
    force[[0, 6, 8, 12]] = 1.0, 17.4, 3.0, 99.0
    np.testing.assert_array_equal(force[largest_since(force, 5)], [1.0, 0.0, 17.4])
    np.testing.assert_array_equal(largest_since(force, 1), np.arange(13))
