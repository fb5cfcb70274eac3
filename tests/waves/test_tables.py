"""Forms of curves, the tables of JAX, and arrivals by quadrature."""

import math
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.interpolate import CubicSpline

from jblast.waves.laws.shock_kinematics import FRONTS
from jblast.waves.tables import (
    Curve,
    arrival,
    broken_power,
    cubics,
    hermite_table,
    joined,
    polynomial,
    power_sum,
    slope_of,
    smooth_step,
    spline_slopes,
    tabulated,
)

X = np.linspace(-1.0, 2.0, 31)


@pytest.mark.parametrize(
    ("form", "expected"),
    [
        (
            polynomial([1.0, -2.0, 0.5], 0.3, 2.0),
            lambda z: np.exp(1 - 2 * (u := 0.3 + 2 * np.log(z)) + u**2 / 2),
        ),
        (power_sum((3.0, -1.0), (2.0, 0.5)), lambda z: 3 / z + 2 * np.sqrt(z)),
        (
            broken_power(2.0, -1.0, (0.5, 3.0, 0.25)),
            lambda z: 2 / z * (1 + (z / 0.5) ** 3) ** 0.25,
        ),
    ],
)
def test_forms_are_their_formulas(form, expected):
    np.testing.assert_allclose(np.exp(form(X)), expected(np.exp(X)), rtol=1e-13)


@pytest.mark.parametrize("ends", [None, (0.3, -1.2)])
def test_splines_are_those_of_scipy(ends):
    x = np.sort(np.random.default_rng(0).uniform(0.0, 5.0, 12))
    y = np.sin(2 * x)
    kind: Any = "natural" if ends is None else ((1, ends[0]), (1, ends[1]))
    scipys = CubicSpline(x, y, bc_type=kind)
    at = np.linspace(x[0], x[-1], 100)
    slopes = spline_slopes(x, y, ends)
    np.testing.assert_allclose(slopes, scipys(x, 1), atol=1e-11)
    np.testing.assert_allclose(cubics(x, y, slopes)(at), scipys(at), atol=1e-12)


def test_a_curve_is_a_power_law_outside_its_span_with_a_continuous_slope():
    curve = Curve(polynomial([0.2, 1.0, 0.7]), 0.5, 3.0)
    first, last = math.log(0.5), math.log(3.0)
    assert curve.end_slopes == pytest.approx(
        (1 + 1.4 * first, 1 + 1.4 * last), abs=1e-11
    )
    for end, slope in zip((first, last), curve.end_slopes, strict=True):
        outward = math.copysign(3.0, end - 0.2)
        beyond = curve(np.array([end, end + outward]))
        assert np.diff(beyond)[0] == pytest.approx(slope * outward, rel=1e-12)
        # half of the slope from either side of the clamp, in JAX too
        assert jax.grad(curve.exact)(end) == pytest.approx(slope, abs=1e-9)


def test_a_blend_is_five_percent_wide_and_twice_smooth():
    form = joined([polynomial([0.0, 1.0]), polynomial([0.5, -2.0])], [2.0])
    half, join = 0.5 * math.log(1.05), math.log(2.0)
    inside = np.array([-half, half]) * (1 - 1e-9) + join
    assert form(inside) == pytest.approx([inside[0], 0.5 - 2 * inside[1]], abs=1e-9)
    assert slope_of(form, join - 2 * half) == pytest.approx(1.0, abs=1e-9)
    first, second = jax.grad(smooth_step), jax.grad(jax.grad(smooth_step))
    for at, value in ((1e-9, 0.0), (0.5, 0.5), (1 - 1e-9, 1.0)):
        assert smooth_step(at, 0.0, 1.0) == pytest.approx(value, abs=1e-12)
        if at != 0.5:
            assert first(at, 0.0, 1.0) == pytest.approx(0.0, abs=1e-13)
            # 60 t at this t; a step that is smooth only once has 6
            assert second(at, 0.0, 1.0) == pytest.approx(0.0, abs=1e-6)


def test_a_table_meets_its_form_and_is_smooth_across_its_nodes():
    form = FRONTS["surface"].form
    table = tabulated(form, -2.0, 5.0)
    x = np.random.default_rng(1).uniform(-2.0, 5.0, 5000)
    np.testing.assert_allclose(table(jnp.asarray(x)), form(x), rtol=0, atol=2e-7)
    value, slope = table.rows.sum(1), table.rows @ np.arange(4.0)
    np.testing.assert_allclose(value[:-1], table.rows[1:, 0], atol=1e-12)
    np.testing.assert_allclose(slope[:-1], table.rows[1:, 1], atol=1e-12)
    assert table.rows[[0, -1], 2:].tolist() == [[0.0, 0.0], [0.0, 0.0]]
    assert table.first == pytest.approx(-2.0)
    assert table.first + table.step * (len(table.rows) - 2) == pytest.approx(5.0)


def test_a_table_is_exact_for_a_cubic_and_straight_beyond_it():
    cubic = np.polynomial.Polynomial([1.0, -0.5, 0.25, 0.125])
    nodes = np.linspace(0.0, 2.0, 5)
    table = hermite_table(0.0, 0.5, cubic(nodes), cubic.deriv()(nodes))
    x = np.array([0.1, 0.5, 1.99, 2.0])
    np.testing.assert_allclose(table(jnp.asarray(x)), cubic(x), rtol=1e-13)
    for end, out in ((0.0, -7.0), (2.0, 9.0)):
        expected = cubic(end) + cubic.deriv()(end) * (out - end)
        assert float(table(jnp.asarray(out))) == pytest.approx(expected, rel=1e-13)
    assert np.isnan(table(jnp.asarray(np.nan)))


def test_an_arrival_is_the_integral_of_one_over_the_speed():
    log_ratio = power_sum((2.0, -3.0), (0.5, -1.0))
    form = arrival(log_ratio, 0.1, 0.02, 1e5)

    def slowness(z):
        return 1.0 / math.sqrt(1.0 + 6.0 / 7.0 * math.exp(log_ratio(np.log(z))))

    for z in (0.1, 0.13, 1.0, 40.0):
        integral = quad(slowness, 0.1, z, epsrel=1e-13, epsabs=0)[0]
        assert z * math.exp(form(np.log(z))) == pytest.approx(
            0.02 + integral, rel=1e-12
        )
    # far away the front moves with sound, and has its head start
    head = [z * -math.expm1(form(np.log(z))) for z in (1e4, 1e5)]
    assert head[1] - head[0] == pytest.approx(3 / 7 * 0.5 * math.log(10), rel=1e-3)
