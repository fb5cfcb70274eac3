"""Rows of a flight that are further apart than a blast is long."""

import numpy as np

from jblast.study.flight_tables import largest


def test_a_push_between_two_rows_is_in_the_later_row():
    loads = np.zeros((11, 3))
    loads[0], loads[6], loads[8] = (0, 0, 1), (0, -17.4, 0), (3, 0, 0)
    rows = largest(loads, 5)[::5]
    np.testing.assert_array_equal(rows, [[0, 0, 1], [0, 0, 0], [0, -17.4, 0]])
    np.testing.assert_array_equal(largest(loads, 1), loads)
