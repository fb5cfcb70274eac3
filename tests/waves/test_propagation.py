"""Air as a medium: state, sound speed, wind, absorption and its filter."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.constants import STANDARD_PRESSURE, STANDARD_SOUND_SPEED
from jblast.waves.propagation import (
    absorption_transfer,
    air_density,
    effective_sound_speed,
    iso_9613_absorption,
    saturation_pressure,
    sound_speed_in_air,
    standard_atmosphere,
)
from tests.waves.absorbing import absorb

# Geopotential height, temperature, pressure, density as the standard prints them.
STANDARD_TABLE = [
    (0.0, 288.15, 101325.0, 1.2250),
    (1000.0, 281.65, 89874.6, 1.11164),
    (5000.0, 255.65, 54019.9, 0.73612),
    (10000.0, 223.15, 26436.3, 0.41271),
    (11000.0, 216.65, 22632.1, 0.36392),
    (20000.0, 216.65, 5474.89, 0.088035),
]


@pytest.mark.parametrize(("altitude", "kelvin", "pascal", "density"), STANDARD_TABLE)
def test_standard_atmosphere_is_the_printed_table(altitude, kelvin, pascal, density):
    temperature, pressure = standard_atmosphere(altitude)
    np.testing.assert_allclose(temperature, kelvin, rtol=1e-12)
    # six printed digits; the density has the library's five-digit gas constant
    np.testing.assert_allclose(pressure, pascal, rtol=4e-6)
    np.testing.assert_allclose(air_density(temperature, pressure, 0.0), density, 3e-5)


def test_pressure_falls_by_the_weight_of_the_air():
    # hydrostatics: dP/dh = -rho g; the gas constant of the density has five digits
    heights = jnp.array([-1000.0, 0.0, 3000.0, 10900.0, 11100.0, 18000.0])
    slope = jax.vmap(jax.grad(lambda h: standard_atmosphere(h)[1]))(heights)
    density = air_density(*standard_atmosphere(heights), 0.0)
    np.testing.assert_allclose(slope, -9.80665 * density, rtol=2e-5)


def test_dry_standard_air_has_the_sound_speed_the_curves_are_scaled_from():
    speed = sound_speed_in_air(288.15, STANDARD_PRESSURE, 0.0)
    np.testing.assert_allclose(speed, STANDARD_SOUND_SPEED, atol=0.005)


def test_dry_air_at_20_celsius_has_the_reference_speed_of_iso_9613():
    # 343.2 m/s, four printed digits
    assert abs(sound_speed_in_air(293.15, STANDARD_PRESSURE, 0.0) - 343.2) < 0.05


def test_saturation_pressure_is_the_printed_vapour_pressure():
    # steam tables: 611.2 Pa at 0 C, 1228 at 10, 2339 at 20, 4246 at 30; ISO's fit is
    # within 0.2 % of them
    np.testing.assert_allclose(
        saturation_pressure(jnp.array([273.15, 283.15, 293.15, 303.15])),
        [611.2, 1228.0, 2339.0, 4246.0],
        rtol=2e-3,
    )


def _laboratory_air():
    celsius, pressure, humidity = np.meshgrid(
        np.linspace(0, 30, 7),
        np.linspace(75e3, 102e3, 4),
        np.linspace(0, 1, 5),
        indexing="ij",
    )
    return celsius, pressure, humidity


def _davis_vapour_fraction(celsius, pressure, humidity):
    """Davis (1992), Metrologia 29:67: the vapour fraction of CIPM-81/91 and -2007."""
    kelvin = celsius + 273.15
    saturation = np.exp(
        1.2378847e-5 * kelvin**2
        - 1.9121316e-2 * kelvin
        + 33.93711047
        - 6343.1645 / kelvin
    )
    enhancement = 1.00062 + 3.14e-8 * pressure + 5.6e-7 * celsius**2
    return humidity * enhancement * saturation / pressure


def _cramer_sound_speed(t, p, humidity):
    """Cramer (1993), J. Acoust. Soc. Am. 93:2510: real air, 400 ppm of CO2."""
    w, c = _davis_vapour_fraction(t, p, humidity), 4e-4
    return (
        331.5024
        + 0.603055 * t
        - 0.000528 * t**2
        + (51.471935 + 0.1495874 * t - 0.000782 * t**2) * w
        + (-1.82e-7 + 3.73e-8 * t - 2.93e-10 * t**2) * p
        + (-85.20931 - 0.228525 * t + 5.91e-5 * t**2) * c
        - 2.835149 * w**2
        - 2.15e-13 * p**2
        + 29.179762 * c**2
        + 0.000486 * w * p * c
    )


def test_sound_speed_is_cramers_but_for_the_ideal_gas():
    celsius, pressure, humidity = _laboratory_air()
    ours = sound_speed_in_air(celsius + 273.15, pressure, humidity)
    cramer = _cramer_sound_speed(celsius, pressure, humidity)
    # dry, a real gas is 0.027 to 0.042 % faster here
    dry = ours[..., 0] / cramer[..., 0] - 1
    assert np.all((dry > -4.2e-4) & (dry < -2.6e-4))
    # what humidity adds: up to 0.7 % at 30 C and low pressure, ours within 0.03 %
    np.testing.assert_allclose(
        ours / ours[..., :1], cramer / cramer[..., :1], rtol=3e-4
    )


def _cipm_density(t, p, humidity):
    """CIPM-2007: Picard et al. (2008), Metrologia 45:149, 400 ppm of CO2."""
    x, kelvin = _davis_vapour_fraction(t, p, humidity), t + 273.15
    compressibility = (
        1
        - p
        / kelvin
        * (
            1.58123e-6
            - 2.9331e-8 * t
            + 1.1043e-10 * t**2
            + (5.707e-6 - 2.051e-8 * t) * x
            + (1.9898e-4 - 2.376e-6 * t) * x**2
        )
        + (p / kelvin) ** 2 * (1.83e-11 - 0.765e-8 * x**2)
    )
    return 3.483740e-3 * p * (1 - 0.3780 * x) / (compressibility * kelvin)


def test_density_is_cipm_2007_but_for_the_ideal_gas():
    celsius, pressure, humidity = _laboratory_air()
    ours = air_density(celsius + 273.15, pressure, humidity)
    departure = ours / _cipm_density(celsius, pressure, humidity) - 1
    assert np.all((departure > -6.1e-4) & (departure < -1.9e-4))


def test_a_head_or_tail_wind_is_exact_and_a_crosswind_is_of_second_order():
    way = np.array([300.0, 400.0])
    for angle in np.linspace(0, 2 * np.pi, 13):
        wind = 10.0 * np.array([np.cos(angle), np.sin(angle)])
        along = way @ wind / 500.0
        # the root of c t = |d - w t|: (c^2 - w^2) t^2 + 2 d.w t - d^2 = 0
        square = 340.0**2 - wind @ wind
        exact = (np.sqrt((way @ wind) ** 2 + way @ way * square) - way @ wind) / square
        left_out = effective_sound_speed(340.0, along) - 500.0 / exact
        # sqrt(c^2 - w^2) = c - w^2/(2c) - w^4/(8c^3) - ..., the last below 1e-4 m/s
        np.testing.assert_allclose(left_out, (100.0 - along**2) / 680.0, atol=5e-5)


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


def test_iso_9613_is_what_an_independent_package_computes():
    *air, printed = INDEPENDENT.T
    # 8.686 dB to the neper, as the standard has it
    np.testing.assert_allclose(8.686 * iso_9613_absorption(*air), printed, rtol=1e-6)


RATE, BEFORE = 48e3, 1000
IMPULSE = np.zeros(48_000)
IMPULSE[BEFORE] = 1.0
AIRS = {"mild": (293.15, 0.5), "cold and dry": (263.15, 0.1), "hot": (313.15, 0.95)}


def relaxations(temperature, humidity):
    """Strength and frequency of both, by the standard, and its term in f^2."""
    theta = temperature / 293.15
    saturation = 10 ** (-6.8346 * (273.16 / temperature) ** 1.261 + 4.6151)
    h = 100.0 * humidity * saturation
    oxygen = 24 + 4.04e4 * h * (0.02 + h) / (0.391 + h)
    nitrogen = 9 + 280 * h * math.exp(-4.17 * (theta ** (-1 / 3) - 1))
    strong = theta**-2.5 * 0.01275 * math.exp(-2239.1 / temperature)
    weak = theta**-2.5 * 0.1068 * math.exp(-3352 / temperature)
    both = ((strong, oxygen), (weak, nitrogen / theta**0.5))
    return both, 1.84e-11 * theta**0.5


def decibels(frequency, distance, temperature, humidity):
    both, classical = relaxations(temperature, humidity)
    alpha = classical * frequency**2
    for a, f in both:
        alpha = alpha + a * frequency**2 / (f + frequency**2 / f)
    return -20 / math.log(10) * distance * alpha


def heard(distance, temperature, humidity, dtype=np.float64):
    air = [dtype(x) for x in (distance, temperature, 101325.0, humidity)]
    return jitted(IMPULSE.astype(dtype), *air)


@jax.jit
def jitted(samples, distance, temperature, pressure, humidity):
    return absorb(samples, RATE, distance, temperature, pressure, humidity)


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("air", AIRS.values(), ids=AIRS)
def test_the_spectrum_is_the_standards_and_nothing_is_heard_before(air, dtype):
    frequency = np.fft.rfftfreq(IMPULSE.size, 1 / RATE)
    deepest = -100 if dtype == np.float64 else -60
    for distance in (50.0, 500.0, 5000.0):
        out = np.asarray(heard(distance, *air, dtype=dtype), float)
        expected = decibels(frequency, distance, *air)
        asked = (frequency >= 20) & (frequency <= 10e3) & (expected > deepest)
        found = 20 * np.log10(np.abs(np.fft.rfft(out)[asked]))
        # what is asked for; 3e-7 and 7e-4 dB are found
        np.testing.assert_allclose(found, expected[asked], rtol=0, atol=0.01)
        # amplitude before the front over the largest: roundings of the transforms
        level = 1e-13 if dtype == np.float64 else 1e-5
        assert np.abs(out[:BEFORE]).max() < level * np.abs(out).max()


def test_its_phase_is_the_dispersion_of_the_relaxations_and_a_delay():
    temperature, humidity = AIRS["mild"]
    distance, count = 1000.0, 2**16
    transfer = np.asarray(
        absorption_transfer(count, RATE, distance, temperature, 101325.0, humidity)
    )
    frequency = np.arange(1, 2000) * RATE / count  # up to 1.5 kHz
    phase = np.unwrap(np.angle(transfer[1:2000]))
    both, _ = relaxations(temperature, humidity)
    expected = sum(
        -distance * a * f * np.imag(1j * frequency / (f + 1j * frequency))
        for a, f in both
    )
    left = phase - expected
    late = np.polyfit(frequency, left, 1)
    # what is left is a delay: past half the rate nothing is absorbed, which bends it
    # by the cube of frequency over rate
    np.testing.assert_allclose(left, frequency * late[0], rtol=0, atol=2e-3)
    assert np.abs(expected).max() > 0.5
