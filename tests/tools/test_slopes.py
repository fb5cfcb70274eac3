"""A check of derivatives that could not fail would be none."""

import jax
import jax.numpy as jnp
import pytest

from tests.tools.slopes import check_slopes

AT = (jnp.array([0.3, 1.2]), 0.7)


def right(x, y):
    return jnp.sin(x) * jnp.exp(y)


@jax.custom_jvp
def wrong(x, y):
    return right(x, y)


@wrong.defjvp
def _wrong_jvp(primals, tangents):
    value, slope = jax.jvp(right, primals, tangents)
    return value, 1.01 * slope


@jax.custom_jvp
def slope_of_sine(x):
    return jnp.cos(x)


slope_of_sine.defjvp(lambda x, v: (jnp.cos(*x), 1.01 * -jnp.sin(*x) * v[0]))


@jax.custom_jvp
def wrong_later(x):
    return jnp.sin(x)


wrong_later.defjvp(lambda x, v: (jnp.sin(*x), slope_of_sine(*x) * v[0]))


def test_a_slope_that_is_off_by_a_hundredth_is_found():
    with pytest.raises(AssertionError, match="forward"):
        check_slopes(wrong, AT)


def test_so_is_one_of_second_order_only():
    check_slopes(wrong_later, (0.4,))
    with pytest.raises(AssertionError, match="second order"):
        check_slopes(wrong_later, (0.4,), 2)
