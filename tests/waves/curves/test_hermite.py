import jax
import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

from jblast.waves.curves import hermite_curve
from tests.tools.slopes import with_slopes

NODES = np.array([-1.0, 0.2, 0.5, 3.0])
VALUES, SLOPES = np.exp(NODES), np.array([0.3, 1.2, 1.6, 20.0])
CURVE = hermite_curve(NODES, VALUES, SLOPES)
AT = with_slopes(CURVE.value)


def test_it_is_the_cubic_that_scipy_draws():
    x = np.linspace(-1.0, 3.0, 400)
    curve = CubicHermiteSpline(NODES, VALUES, SLOPES)
    for order, found in enumerate(AT(x)[:2]):
        # rounding of values and slopes up to 20
        np.testing.assert_allclose(found, curve(x, order), rtol=0, atol=1e-13)


def test_outside_it_is_a_straight_line_with_the_given_slope():
    curve = hermite_curve(NODES, VALUES, SLOPES, slope_before=0.0)
    value, slope, _ = with_slopes(curve.value)([-5.0, 4.0])
    np.testing.assert_allclose(value, [VALUES[0], VALUES[-1] + 20.0], rtol=1e-14)
    np.testing.assert_allclose(slope, [0.0, 20.0])


def test_inside_it_is_the_same_in_numpy():
    x = np.linspace(-1.0, 3.0, 61).reshape(1, 61)
    np.testing.assert_allclose(CURVE.inside(x), AT(x)[0], rtol=0, atol=1e-13)


@pytest.mark.parametrize("dtype", ["float32", "float64"])
def test_evenly_spaced_nodes_are_found_as_uneven_ones_are(dtype):
    nodes = np.linspace(-1.0, 2.0, 8)
    curve = hermite_curve(nodes, np.exp(nodes), np.exp(nodes))
    # the nodes themselves, both sides of each, and beyond the ends
    x = np.array(
        [*nodes, *(nodes + 1e-6), *(nodes - 1e-6), *np.linspace(-2, 3, 50)], dtype
    )
    uneven = np.append(nodes, 2.5)
    searched = hermite_curve(uneven, np.exp(uneven), np.exp(uneven))
    between = x[(x >= -1.0) & (x <= 2.0)]
    rounding = 1e-13 if dtype == "float64" else 1e-5  # of positions, by slopes up to 7
    even, found = jax.jit(curve.value), jax.jit(searched.value)
    np.testing.assert_allclose(even(between), found(between), rtol=0, atol=rounding)
    line = np.exp(2.0) * (1.0 + np.array([0.5, 1.0]))
    np.testing.assert_allclose(even(np.array([2.5, 3.0], dtype)), line, rtol=rounding)


def test_what_is_no_number_stays_none():
    nodes = np.linspace(-1.0, 2.0, 8)
    curve = hermite_curve(nodes, np.exp(nodes), np.exp(nodes))
    assert np.isnan(jax.jit(curve.value)(np.nan))


def test_nodes_that_do_not_ascend_are_refused():
    with pytest.raises(ValueError, match="nodes must ascend"):
        hermite_curve(NODES[::-1].copy(), VALUES, SLOPES)
