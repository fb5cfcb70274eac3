"""Least squares: exact solutions, another program's, and what is no end."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import least_squares as scipys

from jblast.inference.tuning.search import least_squares


def rosenbrock(y):
    return [10.0 * (y[1] - y[0] ** 2), 1.0 - y[0]]


def test_a_line_is_what_the_normal_equations_say():
    draw = np.random.default_rng(0)
    rows, right = draw.normal(size=(40, 3)), draw.normal(size=40)
    place, ended = least_squares(
        lambda y: jnp.asarray(rows) @ y - right, jnp.zeros(3), most_steps=20
    )
    exact, *_ = np.linalg.lstsq(rows, right, rcond=None)
    # a thousandth of a standard deviation, which is some 1/sqrt(40)
    np.testing.assert_allclose(place, exact, atol=2e-4)
    assert bool(ended)


def test_a_curved_valley_ends_where_scipys_search_does():
    start = jnp.array([-1.2, 1.0])
    place, ended = jax.jit(lambda y: least_squares(rosenbrock, y, most_steps=100))(
        start
    )
    theirs = scipys(lambda y: np.asarray(rosenbrock(y)), np.asarray(start)).x
    # a standard deviation is 1 along the valley, of which it stops a 1e-3 part off
    np.testing.assert_allclose(place, theirs, atol=3e-3)
    assert bool(ended)


@pytest.mark.parametrize("most", [0, 3])
def test_a_search_that_was_stopped_says_so(most):
    start = jnp.array([-1.2, 1.0])
    _, ended = least_squares(rosenbrock, start, most_steps=most)
    assert not bool(ended)


def test_what_is_no_number_is_no_end():
    place, ended = least_squares(lambda y: jnp.sqrt(y), -jnp.ones(2), most_steps=10)
    np.testing.assert_array_equal(place, -np.ones(2))
    assert not bool(ended)
