import jax.numpy as jnp
import numpy as np

from jblast.inference.many.lanes import LaneResults, better, beyond_array, doubtful
from tests.inference.many.five_sensors import PLACES, problem


def results(cost, converged, place=0.0):
    """Results of one unknown that differ by what is given."""
    cost = jnp.asarray(cost)
    lanes = cost.shape
    return LaneResults(
        y=jnp.full((1, *lanes), place),
        cost=cost,
        misfit=cost,
        covariance=jnp.ones((1, 1, *lanes)),
        converged=jnp.asarray(converged),
        tolerance=jnp.full(lanes, 1e-8),
        steps=jnp.ones(lanes, jnp.int32),
        done=jnp.ones(lanes, bool),
    )


def test_the_lower_end_counts_whatever_it_says_of_itself():
    a = results([5.0, 5.0], [True, True], place=1.0)
    b = results([4.0, 6.0], [False, True], place=2.0)
    np.testing.assert_array_equal(better(a, b).y[0], [2.0, 1.0])


def test_of_two_ends_as_low_the_one_that_converged_counts():
    # 1e-12 of a cost of 5 is rounding, at a tolerance of 1e-8
    a = results([5.0, 5.0 + 1e-12], [True, False], place=1.0)
    b = results([5.0 - 1e-12, 5.0 + 2e-12], [False, True], place=2.0)
    np.testing.assert_array_equal(better(a, b).y[0], [1.0, 2.0])


def test_an_end_that_is_not_a_number_never_counts_beside_one_that_is():
    a = results([np.nan, 5.0], [False, True], place=1.0)
    b = results([9.0, np.nan], [True, False], place=2.0)
    np.testing.assert_array_equal(better(a, b).y[0], [2.0, 1.0])


def test_an_end_is_doubtful_if_it_did_not_converge_or_readings_hardly_cost_so_much():
    # 12 normal errors cost 6 at the mean, and 6 standard deviations more are 20.7
    cost = [6.0, 6.0, 20.6, 20.8, 20.8]
    found = results(cost, [True, False, True, True, True])
    bad = jnp.array([False, False, False, False, True])
    found_doubtful = doubtful("gaussian", 12, found, bad)
    np.testing.assert_array_equal(found_doubtful, [False, True, False, True, False])


def test_places_beyond_the_array_are_marked():
    _, layout, *_ = problem(1)
    width = np.hypot(120 + 90, 100 + 60)  # of the two sensors farthest apart
    middle = np.mean(PLACES, axis=0)
    east = middle[0] + width * np.array([0.0, 0.99, 1.01, np.nan])
    numbers = {
        "charge_east_m": jnp.asarray(east),
        "charge_north_m": jnp.full(4, middle[1]),
    }
    bad = jnp.array([False, False, False, True])
    far = beyond_array(layout, numbers, bad)
    np.testing.assert_array_equal(far, [False, False, True, False])
    known = beyond_array(layout, {"charge_mass_kg": jnp.asarray(east)}, bad)
    np.testing.assert_array_equal(known, [False] * 4)
