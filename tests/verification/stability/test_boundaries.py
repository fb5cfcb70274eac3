"""Boundaries of failures lie within the levels that were measured."""

import numpy as np
import pytest

from jblast.verification.stability.failure import boundary_at, first_failure

LEVELS = np.array([1.0, 2.0, 4.0])


def test_the_first_failure_is_the_first_level_that_fails():
    assert first_failure(np.array([False, True, False]), "a method") == 1


def test_a_method_that_fails_nowhere_has_no_boundary():
    with pytest.raises(RuntimeError, match=r"a method: expected a failure .* got none"):
        first_failure(np.zeros(3, bool), "a method")


def test_a_boundary_lies_between_two_levels():
    found = boundary_at(0.5, np.array([0.0, 0.25, 0.75]), LEVELS, "a method")
    assert found == pytest.approx(3.0)


@pytest.mark.parametrize("limit", [-0.1, 0.75, 2.0, np.nan])
def test_a_limit_that_is_not_passed_has_no_boundary(limit):
    measured = np.array([0.0, 0.25, 0.75])
    with pytest.raises(RuntimeError, match="measured at 1 and 4, to contain"):
        boundary_at(limit, measured, LEVELS, "a method")
