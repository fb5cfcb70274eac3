import jax
import jax.numpy as jnp
import numpy as np

from jblast.waves.propagation import (
    air_density,
    iso_9613_absorption,
    sound_speed_in_air,
    stokes_absorption,
)

# Frequency [Hz], temperature [K], pressure [Pa], relative humidity, and what the PyPI
# package acoustic-toolbox 0.2.2 makes of them [dB/m]: of its module
# standards.iso_9613_1_1993, in kPa and per cent, attenuation_coefficient(p, T, 101.325,
# 293.15, relaxation_frequency_nitrogen(p, T, h), relaxation_frequency_oxygen(p, h), f)
# with h = molar_concentration_water_vapour(hr, saturation_pressure(T), p).
INDEPENDENT = np.array(
    [
        (50.0, 293.15, 101325.0, 0.7, 5.66921467e-05),
        (125.0, 293.15, 101325.0, 0.7, 0.000334986697),
        (1000.0, 293.15, 101325.0, 0.7, 0.00497781085),
        (8000.0, 293.15, 101325.0, 0.7, 0.0776331531),
        (79.5774715459, 313.0, 101325.0, 0.5, 0.000107198558),
        (250.0, 273.15, 101325.0, 0.2, 0.00183165431),
        (2000.0, 253.15, 90000.0, 0.8, 0.019875847),
        (4000.0, 323.15, 101325.0, 0.1, 0.0467294756),
        (10000.0, 303.15, 70000.0, 0.95, 0.0804588401),
        (500.0, 283.15, 54000.0, 0.05, 0.0109198039),
    ]
)

ISO_DECIBELS_PER_NEPER = 8.686
THESIS = (500.0 / (2 * np.pi), 1.2, 340.0, 313.0)


def test_iso_9613_is_what_an_independent_package_computes():
    *air, printed = INDEPENDENT.T
    np.testing.assert_allclose(
        ISO_DECIBELS_PER_NEPER * iso_9613_absorption(*air), printed, rtol=1e-6
    )


def test_stokes_is_the_number_of_the_thesis():
    # omega = 500 rad/s at 313 K: three printed digits, 0.007 % over a kilometre
    alpha = stokes_absorption(*THESIS)
    np.testing.assert_allclose(alpha, 6.75e-8, atol=5e-11)
    assert round(100 * float(-jnp.expm1(-1000.0 * alpha)), 3) == 0.007


def test_stokes_is_short_of_iso_9613_by_one_or_two_orders_of_magnitude():
    # 20 C, 70 %; printed 270, 131, 59, 14 with the air of Stokes not stated
    frequency = np.array([20.0, 500.0, 1e3, 8e3])
    iso = iso_9613_absorption(frequency, 293.15, 101325.0, 0.7)
    stokes = stokes_absorption(frequency, 1.204, 343.2, 293.15)
    np.testing.assert_allclose(iso / stokes, [270, 131, 59, 14], rtol=0.02)


def test_classical_absorption_is_iso_9613_without_relaxation():
    # Far above both relaxation frequencies these add a constant. In dry air those are
    # 24 and 9 Hz, and at 100 MHz the constant is a millionth.
    alpha = iso_9613_absorption(1e8, 293.15, 101325.0, 0.0)
    speed = sound_speed_in_air(293.15, 101325.0, 0.0)
    density = air_density(293.15, 101325.0, 0.0)
    # viscosity, rotation (0.6 of the viscosity) and conduction (Prandtl number 0.71),
    # over viscosity alone
    more = (4 / 3 + 0.6 + 0.4 / 0.71) / (4 / 3)
    classical = more * stokes_absorption(1e8, density, speed, 293.15)
    # 1.84e-11 has three digits, the Prandtl number two
    np.testing.assert_allclose(classical, alpha, rtol=5e-3)


def test_log_slopes_of_stokes_are_the_exponents():
    def log_law(x):
        return jnp.log(stokes_absorption(*jnp.exp(x)))

    slopes = jax.grad(log_law)(jnp.log(jnp.array(THESIS)))
    np.testing.assert_allclose(slopes, [2.0, -1.0, -3.0, 0.7355], rtol=1e-12)


def test_absorption_of_a_given_wave_is_a_function_of_frequency_over_pressure():
    # at one temperature and mole fraction, alpha/P depends on f/P alone
    one = iso_9613_absorption(1000.0, 290.0, 1e5, 0.3)
    half = iso_9613_absorption(500.0, 290.0, 5e4, 0.15)
    np.testing.assert_allclose(half, 0.5 * one, rtol=1e-12)


def test_dry_air_has_a_gradient_to_humidity():
    slope = jax.grad(iso_9613_absorption, argnums=3)(1000.0, 293.15, 101325.0, 0.0)
    step = 1e-7
    rise = iso_9613_absorption(1000.0, 293.15, 101325.0, step) - iso_9613_absorption(
        1000.0, 293.15, 101325.0, 0.0
    )
    # half a step times a curvature of some 1e2 in units of the slope; rounding 1e-7
    np.testing.assert_allclose(slope, rise / step, rtol=1e-4)
