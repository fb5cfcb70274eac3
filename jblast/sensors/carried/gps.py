"""A receiver of satellites on a vehicle: place and velocity, noisy, and some time ago.

Errors are white: those of a receiver over minutes, which wander by metres, are left
out, as a vehicle that holds its place by them goes with them.
"""

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.types import as_float_array


class Gps(eqx.Module):
    """A receiver.

    Rate and delay are those of PX4's plugin for Gazebo (PX4-SITL_gazebo-classic,
    gazebo_gps_plugin: 5 Hz, 0.12 s), the velocity's noise is that of a u-blox NEO-M8
    (data sheet: 0.05 m/s for half of all samples); the places' are declared.

    Attributes:
        rate: Fixes a second [Hz].
        delay: From a fix to its report, shorter than the time between two [s].
        horizontal_noise: One standard deviation of a fix, east and north each [m].
        vertical_noise: Likewise, up [m].
        velocity_noise: Likewise, along each axis [m/s].
    """

    rate: float = eqx.field(static=True, converter=float, default=5.0)
    delay: float = eqx.field(static=True, converter=float, default=0.12)
    horizontal_noise: Float[Array, ""] = eqx.field(
        converter=as_float_array, default=0.4
    )
    vertical_noise: Float[Array, ""] = eqx.field(converter=as_float_array, default=0.8)
    velocity_noise: Float[Array, ""] = eqx.field(converter=as_float_array, default=0.05)

    def __check_init__(self):
        if not self.rate > 0:
            raise ValueError(f"rate must be positive, got {self.rate:g} Hz")
        if not 0 <= self.delay < 1 / self.rate:
            raise ValueError(
                f"delay must be shorter than the time between two fixes, "
                f"{1 / self.rate:g} s, and not negative, got {self.delay:g} s"
            )

    def noise(self) -> Float[Array, "6"]:
        """Return one standard deviation of each number of a fix [m, m/s]."""
        place = [self.horizontal_noise, self.horizontal_noise, self.vertical_noise]
        return jnp.stack([*place, *[self.velocity_noise] * 3])


class Fix(NamedTuple):
    """Where a receiver was.

    Attributes:
        position_m: East, north, up.
        velocity_m_s: East, north, up.
    """

    position_m: Float[Array, "3"]
    velocity_m_s: Float[Array, "3"]


def fix(
    noise: Float[Array, "6"],
    gps: Gps,
    position_m: Float[Array, "3"],
    velocity_m_s: Float[Array, "3"],
) -> Fix:
    """Return a fix, noise and all.

    Args:
        noise: Standard normal numbers, of place and of velocity.
        gps: The receiver.
        position_m: Where it is.
        velocity_m_s: How it moves.
    """
    off = gps.noise() * noise
    return Fix(position_m + off[:3], velocity_m_s + off[3:])
