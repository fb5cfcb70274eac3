r"""The air a wave travels in: standard, humid or moving; its sound speed and density.

Humid air is taken as an ideal mixture of dry air and water vapour, mole fraction

$$x = h\,p_{sat}(T)/P$$

with relative humidity $h$ and the saturation pressure of ISO 9613-1:1993, annex B.
"""

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float

from jblast.constants import (
    AIR_HEAT_CAPACITY_RATIO,
    DRY_AIR_GAS_CONSTANT,
    STANDARD_PRESSURE,
    STANDARD_TEMPERATURE,
)
from jblast.types import as_float_array, as_float_arrays
from jblast.waves.arguments import checked

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


@checked
def standard_atmosphere(
    altitude: Float[ArrayLike, "..."],
) -> tuple[Float[Array, "..."], Float[Array, "..."]]:
    r"""Return temperature [K] and pressure [Pa] of the standard atmosphere.

    $$T = T_0 - L h, \qquad P = P_0\,(T/T_0)^{g/(R L)}$$

    Made for -2 to 11 km. Above the tropopause it goes on at constant temperature,
    $P \propto \exp(-g h/(R T))$, as the standard does to 20 km, so that a fitted height
    that strays has a value.

    Args:
        altitude: Geopotential height above sea level $h$ [m].

    References:
        ISO 2533:1975.
    """
    altitude = as_float_array(altitude)
    temperature = STANDARD_TEMPERATURE - LAPSE_RATE * jnp.minimum(altitude, TROPOPAUSE)
    troposphere = (temperature / STANDARD_TEMPERATURE) ** (
        HYDROSTATIC_GRADIENT / LAPSE_RATE
    )
    height_above = jnp.maximum(altitude - TROPOPAUSE, 0.0)
    stratosphere = jnp.exp(-HYDROSTATIC_GRADIENT * height_above / temperature)
    return temperature, STANDARD_PRESSURE * troposphere * stratosphere


def saturation_pressure(temperature: Float[ArrayLike, "..."]) -> Float[Array, "..."]:
    r"""Return the pressure of water vapour over water [Pa].

    $$p_{sat} = P_0\,10^{4.6151 - 6.8346\,(273.16/T)^{1.261}}$$

    Args:
        temperature: Temperature $T$ [K], 253 to 323.

    References:
        ISO 9613-1:1993, annex B, read second-hand in two implementations that agree.
    """
    temperature = as_float_array(temperature)
    exponent = 4.6151 - 6.8346 * (TRIPLE_POINT / temperature) ** 1.261
    return STANDARD_PRESSURE * 10.0**exponent


def water_vapour_fraction(
    temperature: Float[ArrayLike, "..."],
    pressure: Float[ArrayLike, "..."],
    relative_humidity: Float[ArrayLike, "..."],
) -> Float[Array, "..."]:
    r"""Return the mole fraction of water vapour, $x = h\,p_{sat}(T)/P$ [-]."""
    pressure, relative_humidity = as_float_arrays(pressure, relative_humidity)
    return relative_humidity * saturation_pressure(temperature) / pressure


@checked
def sound_speed_in_air(
    temperature: Float[ArrayLike, "..."],
    pressure: Float[ArrayLike, "..."],
    relative_humidity: Float[ArrayLike, "..."],
) -> Float[Array, "..."]:
    r"""Return the speed of sound in humid air [m/s].

    $$c = \sqrt{\gamma R T},\quad \gamma = \frac{C}{C-1},\quad
    C = (1-x)\tfrac{7}{2} + 4x,\quad R = \frac{R_d}{1 - (1 - M_w/M_d)\,x}$$

    with $C$ the molar $c_p$ of the mixture in units of the gas constant. Air is not
    quite ideal: dry, this is 0.03 to 0.04 % slower than Cramer (1993) between 0 and
    30 C, which moves an arrival by less than any scatter; the part that humidity adds
    agrees with his within 0.03 % of the speed. Dry air at 15 C comes out as the
    340.29 m/s of ISO 2533, which is what the Kingery-Bulmash curves are scaled from.

    Args:
        temperature: Temperature $T$ [K].
        pressure: Pressure $P$ [Pa].
        relative_humidity: Fraction $h$, 0 to 1.

    References:
        Ideal mixture; Cramer (1993), J. Acoust. Soc. Am. 93:2510, to compare.
    """
    temperature = as_float_array(temperature)
    fraction = water_vapour_fraction(temperature, pressure, relative_humidity)
    dry_heat_capacity = AIR_HEAT_CAPACITY_RATIO / (AIR_HEAT_CAPACITY_RATIO - 1.0)
    heat_capacity = dry_heat_capacity + fraction * (
        WATER_VAPOUR_HEAT_CAPACITY - dry_heat_capacity
    )
    gamma = heat_capacity / (heat_capacity - 1.0)
    return jnp.sqrt(gamma * _gas_constant(fraction) * temperature)


@checked
def air_density(
    temperature: Float[ArrayLike, "..."],
    pressure: Float[ArrayLike, "..."],
    relative_humidity: Float[ArrayLike, "..."],
) -> Float[Array, "..."]:
    r"""Return the density of humid air [kg/m3], $\rho = P/(R T)$.

    Below CIPM-2007, which knows air's compressibility, by 0.02 to 0.06 % between 0 and
    30 C.

    Args:
        temperature: Temperature $T$ [K].
        pressure: Pressure $P$ [Pa].
        relative_humidity: Fraction $h$, 0 to 1.
    """
    temperature, pressure = as_float_arrays(temperature, pressure)
    fraction = water_vapour_fraction(temperature, pressure, relative_humidity)
    return pressure / (_gas_constant(fraction) * temperature)


def _gas_constant(fraction):
    """Specific gas constant of air with a mole fraction of water vapour [J/(kg K)]."""
    return DRY_AIR_GAS_CONSTANT / (1.0 - (1.0 - WATER_TO_DRY_AIR_MOLAR_MASS) * fraction)


@checked
def effective_sound_speed(
    sound_speed: Float[ArrayLike, "..."],
    wind_along: Float[ArrayLike, "..."],
) -> Float[Array, "..."]:
    r"""Return the speed of sound along a path through wind [m/s].

    $$c_{eff} = c_0 + \mathbf{w} \cdot \mathbf{n}$$

    with $\mathbf n$ the direction from charge to sensor: a tail wind adds. In uniform
    wind the wave is a sphere that drifts, so the exact travel time over $\mathbf d$
    solves $c_0 t = |\mathbf{d} - \mathbf{w} t|$ and the exact speed is
    $w_\parallel + \sqrt{c_0^2 - w_\perp^2}$. The crosswind left out slows it by the
    fraction $w_\perp^2/(2 c_0^2)$ of $c_0$: 0.04 % at 10 m/s. Meant for winds well
    below the speed of sound; nearer it the answer falls to zero and below.

    Args:
        sound_speed: $c_0$ in still air [m/s], positive.
        wind_along: Wind's component along the path
            $\mathbf{w} \cdot \mathbf{n}$ [m/s]; negative is a head wind.
    """
    sound_speed, wind_along = as_float_arrays(sound_speed, wind_along)
    return sound_speed + wind_along
