import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.constants import STANDARD_PRESSURE, STANDARD_SOUND_SPEED
from jblast.waves.propagation import (
    air_density,
    saturation_pressure,
    sound_speed_in_air,
    standard_atmosphere,
)

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
