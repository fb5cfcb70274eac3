r"""Air as a medium of sound: state, sound speed and absorption.

Humid air is an ideal mixture of dry air and water vapour with the mole fraction

$$x = h\,p_{sat}(T)/P$$

where $h$ is the relative humidity and $p_{sat}$ the saturation pressure of ISO
9613-1:1993, annex B. Sound speed and density follow from it.

A plane wave of one frequency decays as $\exp(-\alpha x)$. Stokes and ISO 9613-1 give
$\alpha$ in nepers per metre; a neper is 8.686 dB. Stokes has viscosity alone. Below
some 10 kHz nearly all of the loss is the relaxation of oxygen and nitrogen, which
depends on humidity and is in ISO 9613-1 only: 270 times Stokes below 50 Hz, 131 times
at 500 Hz, 14 times at 8 kHz (20 C, 70 %).

The standard gives the magnitude $|H(f)| = e^{-\alpha(f) d}$ that remains after a
distance $d$, and no phase. `absorption_transfer` is the causal filter of least delay
with this magnitude: its phase is the Hilbert transform of $\ln|H|$ (Kramers and
Kronig). For the relaxations of the standard this is the dispersion of the air,

$$\frac{A f^2}{f_\nu + f^2/f_\nu} = \mathrm{Re}\,\frac{A f_\nu\,jf}{f_\nu + jf}$$

whose right-hand side is causal: the front travels at the speed of sound of frozen
molecules, and the slow part of the signal follows. The term in $f^2$ has no causal
filter at all frequencies, only one up to half the sampling rate. It delays the signal
by $\ln 2\,f_s\,c\,d/\pi^2$ for an absorption of $c f^2$ (0.3 ms at 5 km and 48 kHz).
"""

from typing import Any

from jaxtyping import Complex

from jblast.constants import (
    AIR_HEAT_CAPACITY_RATIO,
    DRY_AIR_GAS_CONSTANT,
    STANDARD_PRESSURE,
    STANDARD_TEMPERATURE,
)
from jblast.scene.scene import Air
from jblast.types import as_numbers, namespace
from jblast.waves.arguments import Number, checked
from jblast.waves.tables import Numbers

LAPSE_RATE = 0.0065
"""Fall of temperature with height below the tropopause [K/m]. ISO 2533:1975."""
TROPOPAUSE = 11_000.0
"""Geopotential height where the temperature stops falling [m]. ISO 2533:1975."""
HYDROSTATIC_GRADIENT = 9.80665 / 287.05287
"""Gravity over gas constant $g/R$ [K/m], with the digits of ISO 2533:1975."""
WATER_TO_DRY_AIR_MOLAR_MASS = 18.015 / 28.964
"""Molar mass of water over that of dry air [-]; kg/kmol, IUPAC and ISO 2533:1975."""
WATER_VAPOUR_HEAT_CAPACITY = 4.0
r"""Molar $c_p/R$ of water vapour [-]: three translations, three rotations, one.

Its vibrations add 0.04 at 300 K, which moves a sound speed by less than 0.01 %.
"""
TRIPLE_POINT = 273.16
"""Temperature of the triple point of water [K]. ISO 9613-1:1993, annex B."""
REFERENCE_TEMPERATURE = 293.15
"""Reference temperature of ISO 9613-1:1993 [K]."""
# The slowest relaxation, of nitrogen in dry air at 9 Hz, falls by e^-14 in this time.
TAIL_S = 0.25
"""Length of the filter of the absorption, as padding behind a signal [s]."""


@checked
def standard_atmosphere(
    altitude: Number,
) -> tuple[Numbers, Numbers]:
    r"""Return temperature [K] and pressure [Pa] of the standard atmosphere.

    $$T = T_0 - L h, \qquad P = P_0\,(T/T_0)^{g/(R L)}$$

    Valid from -2 to 11 km. Above the tropopause it continues at constant temperature,
    $P \propto \exp(-g h/(R T))$, as the standard does to 20 km, so that a height above
    the tropopause has a value during a fit.

    Args:
        altitude: Geopotential height above sea level $h$ [m].

    References:
        ISO 2533:1975.
    """
    xp = namespace(altitude)
    # Capped: from 44 km on the line would be below 0 K, and its power NaN.
    temperature = STANDARD_TEMPERATURE - LAPSE_RATE * xp.minimum(altitude, TROPOPAUSE)
    troposphere = (temperature / STANDARD_TEMPERATURE) ** (
        HYDROSTATIC_GRADIENT / LAPSE_RATE
    )
    height_above = xp.maximum(altitude - TROPOPAUSE, 0.0)
    stratosphere = xp.exp(-HYDROSTATIC_GRADIENT * height_above / temperature)
    return temperature, STANDARD_PRESSURE * troposphere * stratosphere


def saturation_pressure(temperature: Number) -> Numbers:
    r"""Return the pressure of water vapour over water [Pa].

    $$p_{sat} = P_0\,10^{4.6151 - 6.8346\,(273.16/T)^{1.261}}$$

    Args:
        temperature: Temperature $T$ [K], 253 to 323.

    References:
        ISO 9613-1:1993, annex B, read second-hand in two implementations that agree.
    """
    exponent = 4.6151 - 6.8346 * (TRIPLE_POINT / temperature) ** 1.261
    return STANDARD_PRESSURE * 10.0**exponent


def water_vapour_fraction(
    temperature: Number,
    pressure: Number,
    relative_humidity: Number,
) -> Numbers:
    r"""Return the mole fraction of water vapour, $x = h\,p_{sat}(T)/P$ [-]."""
    return relative_humidity * saturation_pressure(temperature) / pressure


@checked
def sound_speed_in_air(
    temperature: Number,
    pressure: Number,
    relative_humidity: Number,
) -> Numbers:
    r"""Return the speed of sound in humid air [m/s].

    $$c = \sqrt{\gamma R T},\quad \gamma = \frac{C}{C-1},\quad
    C = (1-x)\tfrac{7}{2} + 4x,\quad R = \frac{R_d}{1 - (1 - M_w/M_d)\,x}$$

    with $C$ the molar $c_p$ of the mixture in units of the gas constant. Air is not
    quite ideal: dry, this is 0.03 to 0.04 % slower than Cramer (1993) between 0 and
    30 C, which changes an arrival by less than any scatter. The effect of humidity
    agrees with his within 0.03 % of the speed. Dry air at 15 C has the 340.29 m/s of
    ISO 2533, the reference of the Kingery-Bulmash curves.

    Args:
        temperature: Temperature $T$ [K].
        pressure: Pressure $P$ [Pa].
        relative_humidity: Fraction $h$, 0 to 1.

    References:
        Ideal mixture; Cramer (1993), J. Acoust. Soc. Am. 93:2510, to compare.
    """
    fraction = water_vapour_fraction(temperature, pressure, relative_humidity)
    dry_heat_capacity = AIR_HEAT_CAPACITY_RATIO / (AIR_HEAT_CAPACITY_RATIO - 1.0)
    heat_capacity = dry_heat_capacity + fraction * (
        WATER_VAPOUR_HEAT_CAPACITY - dry_heat_capacity
    )
    gamma = heat_capacity / (heat_capacity - 1.0)
    return namespace(gamma).sqrt(gamma * _gas_constant(fraction) * temperature)


@checked
def air_density(
    temperature: Number,
    pressure: Number,
    relative_humidity: Number,
) -> Numbers:
    r"""Return the density of humid air [kg/m3], $\rho = P/(R T)$.

    Lower than CIPM-2007, which includes the compressibility of air, by 0.02 to 0.06 %
    between 0 and 30 C.

    Args:
        temperature: Temperature $T$ [K].
        pressure: Pressure $P$ [Pa].
        relative_humidity: Fraction $h$, 0 to 1.
    """
    fraction = water_vapour_fraction(temperature, pressure, relative_humidity)
    return pressure / (_gas_constant(fraction) * temperature)


def _gas_constant(fraction):
    """Specific gas constant of air with a mole fraction of water vapour [J/(kg K)]."""
    return DRY_AIR_GAS_CONSTANT / (1.0 - (1.0 - WATER_TO_DRY_AIR_MOLAR_MASS) * fraction)


@checked
def effective_sound_speed(
    sound_speed: Number,
    wind_along: Number,
) -> Numbers:
    r"""Return the speed of sound along a path through wind [m/s].

    $$c_{eff} = c_0 + \mathbf{w} \cdot \mathbf{n}$$

    with $\mathbf n$ the direction from charge to sensor: a tail wind adds. In uniform
    wind the wave is a sphere that drifts, so the exact travel time over $\mathbf d$
    solves $c_0 t = |\mathbf{d} - \mathbf{w} t|$ and the exact speed is
    $w_\parallel + \sqrt{c_0^2 - w_\perp^2}$. The crosswind left out slows it by the
    fraction $w_\perp^2/(2 c_0^2)$ of $c_0$: 0.04 % at 10 m/s. The formula is for winds
    well below the speed of sound; a faster head wind gives zero and less.

    Args:
        sound_speed: $c_0$ in still air [m/s], positive.
        wind_along: Wind's component along the path
            $\mathbf{w} \cdot \mathbf{n}$ [m/s]; negative is a head wind.
    """
    return sound_speed + wind_along


def ambient(air: Air) -> tuple[Numbers, Numbers]:
    """Return temperature [K] and pressure [Pa], given or from the altitude."""
    if air.altitude is None:
        return air.temperature, air.pressure
    return standard_atmosphere(air.altitude)


def sound_speed_of(air: Air) -> Numbers:
    """Return the speed of sound [m/s], given or from temperature and humidity."""
    if air.sound_speed is not None:
        return air.sound_speed
    temperature, pressure = ambient(air)
    return sound_speed_in_air(temperature, pressure, air.relative_humidity)


@checked
def iso_9613_absorption(
    frequency: Number,
    temperature: Number,
    pressure: Number,
    relative_humidity: Number,
) -> Numbers:
    r"""Return the absorption with the relaxation of oxygen and nitrogen [Np/m].

    $$8.686\,\alpha = 8.686\,f^2 \left\{ 1.84\times10^{-11}\,\frac{p_r}{P} \theta^{1/2}
      + \theta^{-5/2} \left[ \frac{0.01275\,e^{-2239.1/T}}{f_O + f^2/f_O}
      + \frac{0.1068\,e^{-3352/T}}{f_N + f^2/f_N} \right] \right\}$$

    $$f_O = \frac{P}{p_r} \left( 24 + 40400\,h\,\frac{0.02 + h}{0.391 + h} \right),
      \qquad f_N = \frac{P}{p_r} \theta^{-1/2} \left( 9 + 280\,h\,
      e^{-4.170 (\theta^{-1/3} - 1)} \right)$$

    with $\theta = T/293.15$ K, $p_r = 101325$ Pa and $h$ the vapour's mole fraction in
    per cent. The standard gives dB/m, with 8.686 dB to the neper. The result here is in
    nepers. The standard states 10 % uncertainty from 50 Hz to 10 kHz, -20 to 50 C,
    below 200 kPa; outside, the result is extrapolated.

    Args:
        frequency: $f$ [Hz], positive.
        temperature: $T$ [K].
        pressure: $P$ [Pa].
        relative_humidity: Fraction, 0 to 1.

    References:
        ISO 9613-1:1993, eqs. 3-5, second-hand from two implementations that agree.
    """
    xp = namespace(frequency, temperature, pressure, relative_humidity)
    atmospheres = pressure / STANDARD_PRESSURE
    theta = temperature / REFERENCE_TEMPERATURE
    # The relaxation frequencies of the standard are fits in per cent, not in fractions.
    percent = 100.0 * water_vapour_fraction(temperature, pressure, relative_humidity)
    # Dry air leaves 24 and 9 Hz an atmosphere, so neither divisor below is ever zero.
    oxygen = atmospheres * (
        24.0 + 4.04e4 * percent * (0.02 + percent) / (0.391 + percent)
    )
    nitrogen = (
        atmospheres
        * theta**-0.5
        * (9.0 + 280.0 * percent * xp.exp(-4.170 * (theta ** (-1.0 / 3.0) - 1.0)))
    )
    square = frequency * frequency
    relaxation = theta**-2.5 * (
        0.01275 * xp.exp(-2239.1 / temperature) / (oxygen + square / oxygen)
        + 0.1068 * xp.exp(-3352.0 / temperature) / (nitrogen + square / nitrogen)
    )
    return square * (1.84e-11 * theta**0.5 / atmospheres + relaxation)


def absorption_transfer(
    count: int,
    rate: float,
    distance: Number,
    temperature: Number,
    pressure: Number,
    relative_humidity: Number,
) -> Complex[Any, " frequency"]:
    """Return the transfer function at 0, rate / count, ... to half the rate [-].

    Args:
        count: Number of samples, even.
        rate: Sampling rate [Hz].
        distance: Length of the path through the air [m], not negative.
        temperature: Temperature [K].
        pressure: Pressure [Pa].
        relative_humidity: Relative humidity, 0 to 1.
    """
    from jax import lax, numpy as jnp  # filters run in JAX alone

    distance = as_numbers(distance)
    frequency = jnp.arange(count // 2 + 1, dtype=distance.dtype) * (rate / count)
    log_gain = -distance * iso_9613_absorption(
        frequency, temperature, pressure, relative_humidity
    )
    cepstrum = jnp.fft.irfft(log_gain, count)
    # A causal filter of least delay has a causal cepstrum: the part at negative times
    # is folded onto the positive ones, which doubles them.
    causal = cepstrum[1 : count // 2]
    phase = jnp.fft.rfft(jnp.pad(2.0 * causal, (1, count // 2))).imag
    gain = jnp.exp(log_gain)
    return lax.complex(gain * jnp.cos(phase), gain * jnp.sin(phase))
