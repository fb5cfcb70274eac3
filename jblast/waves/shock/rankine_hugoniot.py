r"""What a shock of a given peak does to the air: Rankine's and Hugoniot's relations.

Mass, momentum and energy are conserved across the front, in an ideal gas of $\gamma$ =
1.4. With $x = p/P_0$,

$$M^2 = 1 + \tfrac67 x, \quad \frac{u}{c_0} = \frac{5x}{7M}, \quad
\frac{\rho}{\rho_0} = \frac{7+6x}{7+x}, \quad \frac{T}{T_0} = \frac{(1+x)(7+x)}{7+6x}$$

$$q = \tfrac12\rho u^2 = \frac{5}{2}\frac{p^2}{7P_0+p}, \qquad
p_r = 2p\,\frac{7P_0+4p}{7P_0+p} = 2p + \tfrac{12}{5} q$$

Each is written so that nothing cancels however weak the shock. Real air above some ten
bar is not ideal: the reflected pressure of Kingery and Bulmash exceeds $p_r$ by 3.4 %
at Z = 0.7, 11 % at 0.5 and 53 % at 0.1 (free air); past Z = 1 the two agree to 1.6 %
(1.1 % on the surface).
"""

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float

from jblast.constants import STANDARD_PRESSURE, STANDARD_SOUND_SPEED
from jblast.types import as_float_arrays
from jblast.waves.arguments import checked


@checked
def shock_mach_number(
    peak_overpressure: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
) -> Float[Array, "..."]:
    r"""Return the speed of the front over that of sound, $M = \sqrt{1+\tfrac67x}$ [-].

    The arguments here and below:

    Args:
        peak_overpressure: $p$ [Pa], positive.
        ambient_pressure: $P_0$ [Pa], positive.
    """
    p, ambient = as_float_arrays(peak_overpressure, ambient_pressure)
    return jnp.sqrt(1.0 + 6.0 / 7.0 * (p / ambient))


@checked
def shock_overpressure(
    mach_number: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
) -> Float[Array, "..."]:
    r"""Return the peak overpressure, $p = \tfrac76 P_0 (M-1)(M+1)$ [Pa].

    Args:
        mach_number: Speed of the front over that of sound $M$ [-], at least 1.
        ambient_pressure: $P_0$ [Pa], positive.
    """
    m, ambient = as_float_arrays(mach_number, ambient_pressure)
    return 7.0 / 6.0 * ambient * (m - 1.0) * (m + 1.0)


@checked
def blast_wind(
    peak_overpressure: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    sound_speed: Float[ArrayLike, "..."] = STANDARD_SOUND_SPEED,
) -> Float[Array, "..."]:
    r"""Return the speed of the air behind the front, $u = 5 c_0 x/(7M)$ [m/s].

    Args:
        peak_overpressure: $p$ [Pa], positive.
        ambient_pressure: $P_0$ [Pa], positive.
        sound_speed: $c_0$ [m/s], positive.
    """
    p, ambient, sound = as_float_arrays(
        peak_overpressure, ambient_pressure, sound_speed
    )
    return plane_wave_wind(p / ambient, sound)


def plane_wave_wind(
    overpressure: Float[Array, "..."], sound_speed: Float[Array, "..."]
) -> Float[Array, "..."]:
    r"""Return $5 c_0 x/(7\sqrt{1 + 6x/7})$ [m/s] of any $x$: suctions draw it back.

    Args:
        overpressure: $x = p/P_0$ [-], above -7/6.
        sound_speed: $c_0$, or its share along an axis [m/s].
    """
    steep = jnp.sqrt(1.0 + 6.0 / 7.0 * overpressure)
    return 5.0 / 7.0 * sound_speed * overpressure / steep


@checked
def shock_density_ratio(
    peak_overpressure: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
) -> Float[Array, "..."]:
    r"""Return the density behind the front over that ahead, at most 6 [-]."""
    p, ambient = as_float_arrays(peak_overpressure, ambient_pressure)
    return (7.0 * ambient + 6.0 * p) / (7.0 * ambient + p)


@checked
def shock_temperature_ratio(
    peak_overpressure: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
) -> Float[Array, "..."]:
    r"""Return the absolute temperature behind the front over that ahead [-]."""
    p, ambient = as_float_arrays(peak_overpressure, ambient_pressure)
    return (1.0 + p / ambient) * ((7.0 * ambient + p) / (7.0 * ambient + 6.0 * p))


@checked
def dynamic_pressure(
    peak_overpressure: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
) -> Float[Array, "..."]:
    r"""Return the dynamic pressure of the wind, $q = \tfrac12\rho u^2$ [Pa]."""
    p, ambient = as_float_arrays(peak_overpressure, ambient_pressure)
    return 2.5 * p * (p / (7.0 * ambient + p))


@checked
def normally_reflected_pressure(
    peak_overpressure: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
) -> Float[Array, "..."]:
    """Return the peak overpressure on a rigid wall that the front hits squarely [Pa].

    Twice the incident one for a weak shock, eight times for a strong one.
    """
    p, ambient = as_float_arrays(peak_overpressure, ambient_pressure)
    return 2.0 * p * ((7.0 * ambient + 4.0 * p) / (7.0 * ambient + p))
