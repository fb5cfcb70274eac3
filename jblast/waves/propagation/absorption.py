r"""How air takes energy out of sound: Stokes, Stokes-Kirchhoff and ISO 9613-1.

A plane wave of one frequency decays as $\exp(-\alpha x)$; all three give $\alpha$ in
nepers per metre, and a neper is 8.686 dB. Classical theory, viscosity and conduction,
is what a thesis or a textbook takes; below some 10 kHz nearly all the loss is instead
the relaxation of oxygen and nitrogen, which depends on humidity and which only ISO
9613-1 has: 270 times Stokes below 50 Hz, 131 times at 500 Hz, 14 times at 8 kHz (20 C,
70 %).
"""

import math

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Bool, Float

from jblast.constants import AIR_HEAT_CAPACITY_RATIO, STANDARD_PRESSURE
from jblast.types import as_float_arrays
from jblast.waves.arguments import checked
from jblast.waves.propagation.atmosphere import water_vapour_fraction

DECIBELS_PER_NEPER = 20.0 / math.log(10.0)
"""Decibels in a neper, 8.685889638 [dB]. By definition of both."""

BULK_TO_SHEAR_VISCOSITY = 0.6
r"""$\mu_B/\eta$ of air [-]: rotation of the molecules. Greenspan (1959), J. Acoust.
Soc. Am. 31:155, read second-hand; it makes the first term of ISO 9613-1 come out."""

PRANDTL_NUMBER = 0.71
r"""$\eta c_p/\kappa$ of air near 20 C [-]. Textbook value, two digits."""

REFERENCE_TEMPERATURE = 293.15
"""Reference temperature of ISO 9613-1:1993 [K]."""

ISO_DECIBELS_PER_NEPER = 8.686
"""What ISO 9613-1:1993 writes for `DECIBELS_PER_NEPER` [dB]."""

ISO_FREQUENCIES = (50.0, 10e3)
ISO_TEMPERATURES = (253.15, 323.15)
ISO_HIGHEST_PRESSURE = 200e3


@checked
def stokes_absorption(
    frequency: Float[ArrayLike, "..."],
    air_density: Float[ArrayLike, "..."],
    sound_speed: Float[ArrayLike, "..."],
    temperature: Float[ArrayLike, "..."],
) -> Float[Array, "..."]:
    r"""Return the absorption by shear viscosity alone [Np/m].

    $$\alpha = \frac{2\,\eta\,\omega^2}{3\,\rho_0 c_0^3}, \qquad
      \eta = 2.791\times10^{-7}\,T^{0.7355}\ \mathrm{Pa\,s}$$

    Short of the truth by one or two orders of magnitude at audible frequencies.

    Args:
        frequency: $f = \omega/2\pi$ [Hz], positive.
        air_density: $\rho_0$ [kg/m3].
        sound_speed: $c_0$ [m/s].
        temperature: $T$ [K].

    References:
        Parab's thesis, eq. 3.1; its viscosity is read from the public plugin.
    """
    frequency, air_density, sound_speed = as_float_arrays(
        frequency, air_density, sound_speed
    )
    return (
        (2.0 / 3.0)
        * _shear_viscosity(temperature)
        * _square_over_cube(frequency, sound_speed)
        / air_density
    )


@checked
def stokes_kirchhoff_absorption(
    frequency: Float[ArrayLike, "..."],
    air_density: Float[ArrayLike, "..."],
    sound_speed: Float[ArrayLike, "..."],
    temperature: Float[ArrayLike, "..."],
) -> Float[Array, "..."]:
    r"""Return the classical absorption: viscosity, rotation and conduction [Np/m].

    $$\alpha = \frac{\omega^2}{2 \rho_0 c_0^3} \left[ \tfrac43 \eta + \mu_B
      + \kappa \left( \frac{1}{c_v} - \frac{1}{c_p} \right) \right]$$

    with $\mu_B = 0.6\,\eta$ and $\kappa = \eta c_p/0.71$, so that the last term is
    $\eta (\gamma - 1)/0.71$. It is 1.87 times Stokes, and the first term of ISO 9613-1
    (no relaxation): within 0.2 % at 20 C, 4.2 % between -20 and 50 C.

    Args:
        frequency: $f = \omega/2\pi$ [Hz], positive.
        air_density: $\rho_0$ [kg/m3].
        sound_speed: $c_0$ [m/s].
        temperature: $T$ [K].

    References:
        Kirchhoff (1868), Ann. Phys. 210:177, in the form of textbooks.
    """
    frequency, air_density, sound_speed = as_float_arrays(
        frequency, air_density, sound_speed
    )
    conduction = (AIR_HEAT_CAPACITY_RATIO - 1.0) / PRANDTL_NUMBER
    return (
        0.5
        * (4.0 / 3.0 + BULK_TO_SHEAR_VISCOSITY + conduction)
        * _shear_viscosity(temperature)
        * _square_over_cube(frequency, sound_speed)
        / air_density
    )


@checked
def iso_9613_absorption(
    frequency: Float[ArrayLike, "..."],
    temperature: Float[ArrayLike, "..."],
    pressure: Float[ArrayLike, "..."],
    relative_humidity: Float[ArrayLike, "..."],
) -> Float[Array, "..."]:
    r"""Return the absorption with the relaxation of oxygen and nitrogen [Np/m].

    $$8.686\,\alpha = 8.686\,f^2 \left\{ 1.84\times10^{-11}\,\frac{p_r}{P} \theta^{1/2}
      + \theta^{-5/2} \left[ \frac{0.01275\,e^{-2239.1/T}}{f_O + f^2/f_O}
      + \frac{0.1068\,e^{-3352/T}}{f_N + f^2/f_N} \right] \right\}$$

    $$f_O = \frac{P}{p_r} \left( 24 + 40400\,h\,\frac{0.02 + h}{0.391 + h} \right),
      \qquad f_N = \frac{P}{p_r} \theta^{-1/2} \left( 9 + 280\,h\,
      e^{-4.170 (\theta^{-1/3} - 1)} \right)$$

    with $\theta = T/293.15$ K, $p_r = 101325$ Pa and $h$ the vapour's mole fraction in
    per cent. The standard gives dB/m, with 8.686 dB to the neper; here they are nepers,
    so multiply by `ISO_DECIBELS_PER_NEPER` for its own numbers. It states 10 %
    uncertainty where `iso_9613_valid`; outside the formula simply goes on.

    Args:
        frequency: $f$ [Hz], positive.
        temperature: $T$ [K].
        pressure: $P$ [Pa].
        relative_humidity: Fraction, 0 to 1.

    References:
        ISO 9613-1:1993, eqs. 3-5, second-hand from two implementations that agree.
    """
    frequency, temperature, pressure = as_float_arrays(frequency, temperature, pressure)
    atmospheres = pressure / STANDARD_PRESSURE
    theta = temperature / REFERENCE_TEMPERATURE
    percent = 100.0 * water_vapour_fraction(temperature, pressure, relative_humidity)
    oxygen = atmospheres * (
        24.0 + 4.04e4 * percent * (0.02 + percent) / (0.391 + percent)
    )
    nitrogen = (
        atmospheres
        * theta**-0.5
        * (9.0 + 280.0 * percent * jnp.exp(-4.170 * (theta ** (-1.0 / 3.0) - 1.0)))
    )
    square = frequency * frequency
    relaxation = theta**-2.5 * (
        0.01275 * jnp.exp(-2239.1 / temperature) / (oxygen + square / oxygen)
        + 0.1068 * jnp.exp(-3352.0 / temperature) / (nitrogen + square / nitrogen)
    )
    return square * (1.84e-11 * theta**0.5 / atmospheres + relaxation)


def iso_9613_valid(
    frequency: Float[ArrayLike, "..."],
    temperature: Float[ArrayLike, "..."],
    pressure: Float[ArrayLike, "..."],
) -> Bool[Array, "..."]:
    """Return where ISO 9613-1 claims 10 %: 50 Hz to 10 kHz, -20 to 50 C, below 2 bar.

    The standard also bounds the vapour and the frequency over the pressure; those
    bounds we have from memory only, and leave them out.
    """
    frequency, temperature, pressure = as_float_arrays(frequency, temperature, pressure)
    return (
        (frequency >= ISO_FREQUENCIES[0])
        & (frequency <= ISO_FREQUENCIES[1])
        & (temperature >= ISO_TEMPERATURES[0])
        & (temperature <= ISO_TEMPERATURES[1])
        & (pressure < ISO_HIGHEST_PRESSURE)
    )


def _shear_viscosity(temperature: Float[ArrayLike, "..."]) -> Float[Array, "..."]:
    """Return the dynamic viscosity of air [Pa s] by a power of temperature."""
    (temperature,) = as_float_arrays(temperature)
    return 2.791e-7 * temperature**0.7355


def _square_over_cube(
    frequency: Float[Array, "..."], sound_speed: Float[Array, "..."]
) -> Float[Array, "..."]:
    r"""Return $\omega^2/c_0^3$ [s/m3]."""
    omega = 2.0 * math.pi * frequency
    return omega * omega / sound_speed**3
