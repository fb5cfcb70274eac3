import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

from jblast.waves.hermite_curve import hermite_curve

NODES = np.array([-1.0, 0.2, 0.5, 3.0])
VALUES, SLOPES = np.exp(NODES), np.array([0.3, 1.2, 1.6, 20.0])


def test_it_is_the_cubic_that_scipy_draws():
    x = np.linspace(-1.0, 3.0, 400)
    # rounding of values up to 20
    np.testing.assert_allclose(
        hermite_curve(NODES, VALUES, SLOPES).value(jnp.asarray(x)),
        CubicHermiteSpline(NODES, VALUES, SLOPES)(x),
        rtol=0,
        atol=1e-13,
    )


def test_a_cubic_polynomial_is_reproduced():
    def cubic(x):
        return 1.0 - x + 0.5 * x**2 + 0.25 * x**3

    x = np.linspace(-1.0, 3.0, 50)
    slopes = -1.0 + NODES + 0.75 * NODES**2
    got = hermite_curve(NODES, cubic(NODES), slopes).value(jnp.asarray(x))
    np.testing.assert_allclose(got, cubic(x), rtol=0, atol=1e-13)


def test_outside_it_is_a_straight_line_with_the_given_slope():
    curve = hermite_curve(NODES, VALUES, SLOPES, slope_before=0.0)
    x = jnp.array([-5.0, 4.0])
    np.testing.assert_allclose(
        curve.value(x), [VALUES[0], VALUES[-1] + 20.0], rtol=1e-14
    )
    np.testing.assert_allclose(jax.vmap(jax.grad(curve.value))(x), [0.0, 20.0])


def test_value_and_slope_at_a_node_are_the_given_ones():
    curve = hermite_curve(NODES, VALUES, SLOPES)
    x = jnp.asarray(NODES)
    np.testing.assert_allclose(curve.value(x), VALUES, rtol=1e-14)
    np.testing.assert_allclose(jax.vmap(jax.grad(curve.value))(x), SLOPES, rtol=1e-13)


def test_a_piece_is_the_curve_on_its_stretch():
    curve = hermite_curve(NODES, VALUES, SLOPES)
    fraction = np.array([0.0, 0.3, 1.0])
    x = NODES[1] + fraction * (NODES[2] - NODES[1])
    np.testing.assert_allclose(
        curve.piece(1, fraction), curve.value(jnp.asarray(x)), rtol=1e-14
    )


def test_nodes_that_do_not_ascend_are_refused():
    with pytest.raises(ValueError, match="nodes must ascend"):
        hermite_curve(NODES[::-1].copy(), VALUES, SLOPES)
