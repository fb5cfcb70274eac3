"""The pulse of Friedlander: its shape, its slopes, its impulse and its spectrum."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad

from jblast.waves.waveform import (
    friedlander_impulse,
    friedlander_pressure,
    friedlander_spectrum,
    modified_friedlander_pressure,
)
from tests.tools.slopes import with_slopes

PEAK, DURATION = 2e5, 4e-3
"""The pulse of the thesis."""


def by_quadrature(function, start, end):
    return quad(function, start, end, epsabs=1e-9, epsrel=1e-12, limit=400)[0]


def test_the_pulse_of_the_thesis_is_the_printed_formula():
    time = np.array([0.0, 1e-3, 4e-3, 9e-3])
    printed = PEAK * (1 - time / DURATION) * np.exp(-time / DURATION)
    np.testing.assert_allclose(
        friedlander_pressure(time, PEAK, DURATION), printed, rtol=1e-14
    )


def test_nothing_is_felt_before_the_arrival_and_the_peak_at_it():
    time = jnp.array([-1e9, -1e-12, 0.0])
    pressure = modified_friedlander_pressure(time, PEAK, DURATION, 2.0)
    assert pressure.tolist() == [0.0, 0.0, PEAK]


def test_a_missing_time_stays_missing():
    assert jnp.isnan(friedlander_pressure(math.nan, PEAK, DURATION))


def test_the_slope_at_the_arrival_is_that_behind_the_front():
    slope = jax.jit(jax.grad(modified_friedlander_pressure))
    at = slope(0.0, PEAK, DURATION, 2.0)
    np.testing.assert_allclose(at, -PEAK * 3.0 / DURATION, rtol=1e-14)
    assert slope(-1e-9, PEAK, DURATION, 2.0) == 0.0


@pytest.mark.parametrize("decay", [-0.93, -1e-9, 0.0, 0.05, 1.0, 8.87])
def test_the_impulse_is_the_area_of_the_positive_phase(decay):
    area = by_quadrature(
        lambda t: float(modified_friedlander_pressure(t, PEAK, DURATION, decay)),
        0.0,
        DURATION,
    )
    np.testing.assert_allclose(
        friedlander_impulse(PEAK, DURATION, decay), area, rtol=1e-11
    )


def test_slope_and_curvature_of_the_impulse_are_defined_at_zero_decay():
    # k = 1/2 - b/6 + b^2/24
    at = with_slopes(lambda decay: friedlander_impulse(1.0, 1.0, decay))
    np.testing.assert_allclose(at(0.0)[1:], [-1 / 6, 1 / 12], rtol=1e-14)


@pytest.mark.parametrize("decay", [0.3, 1.0, 2.5])
def test_the_whole_record_has_the_closed_impulse(decay):
    area = by_quadrature(
        lambda t: float(modified_friedlander_pressure(t, 1.0, 1.0, decay)), 0, np.inf
    )
    # Zero at b = 1; quadrature is asked for 1e-9.
    np.testing.assert_allclose(area, 1 / decay - 1 / decay**2, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("decay", [0.3, 1.0, 2.5])
def test_the_tail_is_lowest_where_the_calculus_says(decay):
    time, step = DURATION * (1 + 1 / decay), 1e-4 * DURATION
    low = modified_friedlander_pressure(
        jnp.array([time - step, time, time + step]), PEAK, DURATION, decay
    )
    np.testing.assert_allclose(
        low[1], -PEAK / decay * math.exp(-(decay + 1)), rtol=1e-13
    )
    assert low[1] < low[0]
    assert low[1] < low[2]
    slope = jax.jit(jax.grad(modified_friedlander_pressure))(
        time, PEAK, DURATION, decay
    )
    # Against the slope at the front: rounding of t.
    assert abs(slope) < 1e-14 * PEAK / DURATION


@pytest.mark.parametrize("decay", [0.2, 1.0, 6.0])
@pytest.mark.parametrize("frequency", [0.01, 13.0, 40.0, 700.0])
def test_the_spectrum_is_the_fourier_integral(decay, frequency):
    # In units of the duration, to where e^(-b t) is 1e-20. A cell is at most 0.3 long
    # and holds one period at most; forty nodes of Gauss integrate it to rounding.
    nodes, weights = np.polynomial.legendre.leggauss(40)
    cuts = np.linspace(0.0, 46.0 / decay, 1 + math.ceil(200 / decay))
    length = cuts[1]
    t = cuts[:-1, None] + length * (nodes + 1) / 2
    wave = np.exp(-2j * np.pi * frequency * DURATION * t)
    integral = ((1 - t) * np.exp(-decay * t) * wave) @ weights * length / 2
    expected = PEAK * DURATION * integral.sum()
    # The integral is at most 1/b^2 = 25 P t before waves cancel in it.
    np.testing.assert_allclose(
        friedlander_spectrum(frequency, PEAK, DURATION, decay),
        expected,
        rtol=1e-9,
        atol=1e-9 * PEAK * DURATION,
    )


@pytest.mark.parametrize("decay", [0.4, 1.0, 3.0])
def test_the_energy_is_the_same_in_time_and_frequency(decay):
    in_time = by_quadrature(
        lambda t: float(modified_friedlander_pressure(t, 1.0, 1.0, decay)) ** 2,
        0,
        np.inf,
    )
    in_frequency = by_quadrature(
        lambda f: 2 * abs(complex(friedlander_spectrum(f, 1.0, 1.0, decay))) ** 2,
        0,
        np.inf,
    )
    exact = 1 / (2 * decay) - 1 / (2 * decay**2) + 1 / (4 * decay**3)
    np.testing.assert_allclose([in_time, in_frequency], exact, rtol=1e-8)


def test_a_record_that_does_not_decay_has_no_spectrum():
    with pytest.raises(ValueError, match=r"decay must be positive.*got -0\.5"):
        friedlander_spectrum(10.0, PEAK, DURATION, jnp.array([1.0, -0.5]))
    inside = jax.jit(friedlander_spectrum)(10.0, PEAK, DURATION, jnp.array([1.0, -0.5]))
    assert jnp.isnan(inside).tolist() == [False, True]
