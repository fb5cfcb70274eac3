r"""Whether a charge above the ground bursts as in free air, at a place.

The free-air curves hold until the reflection from the ground arrives. It comes from the
image of the charge below the ground, at a distance of

$$R' = \sqrt{R^2 + 4 h h_s}$$

for a charge $h$ and a sensor $h_s$ above the ground. Where it arrives after the
positive phase has ended, peak, impulse and duration are those of free air: what UFC
3-340-02 calls a free-air burst (from memory) reaches a place before any reflection
does. Both times are those of the free-air curves. The reflection runs through air that
the incident wave has warmed and pushed, and so comes a little sooner than reckoned. A
sensor on the ground meets both at once.
"""

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Bool, Float

from jblast.constants import STANDARD_PRESSURE, STANDARD_SOUND_SPEED
from jblast.types import as_float_arrays
from jblast.waves.laws.kingery_bulmash.laws import kingery_bulmash_duration
from jblast.waves.laws.shock_kinematics.laws import shock_kinematics_arrival_time


def image_range(
    slant_range: Float[ArrayLike, "..."],
    height_of_burst: Float[ArrayLike, "..."],
    sensor_height: Float[ArrayLike, "..."],
) -> Float[Array, "..."]:
    r"""Return the distance from the image of the charge, $\sqrt{R^2 + 4 h h_s}$ [m].

    Args:
        slant_range: $R$ [m].
        height_of_burst: $h$ [m]; below the ground it counts as on it.
        sensor_height: $h_s$ [m]; likewise.
    """
    r, h, h_s = as_float_arrays(slant_range, height_of_burst, sensor_height)
    lifted = 4.0 * jnp.maximum(h, 0.0) * jnp.maximum(h_s, 0.0)
    far = lifted > 0.0
    return jnp.where(far, jnp.sqrt(jnp.where(far, r**2 + lifted, 1.0)), r)


def bursts_in_free_air(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    height_of_burst: Float[ArrayLike, "..."],
    sensor_height: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    sound_speed: Float[ArrayLike, "..."] = STANDARD_SOUND_SPEED,
) -> Bool[Array, "..."]:
    """Return where the reflection from the ground comes after the positive phase.

    Args:
        slant_range: From the charge [m].
        charge_mass: TNT-equivalent mass [kg].
        height_of_burst: Of the charge above the ground [m].
        sensor_height: Of the place above the ground [m].
        ambient_pressure: $P_0$ [Pa].
        sound_speed: $c_0$ [m/s].
    """
    r, mass = as_float_arrays(slant_range, charge_mass)
    far = image_range(r, height_of_burst, sensor_height)
    good = (r > 0.0) & (mass > 0.0) & (far > r)
    r, mass = jnp.where(good, r, 1.0), jnp.where(good, mass, 1.0)
    far = jnp.where(good, far, 2.0)
    air = (mass, ambient_pressure, sound_speed, "free-air")
    delay = shock_kinematics_arrival_time(far, *air)
    delay = delay - shock_kinematics_arrival_time(r, *air)
    return good & (delay >= kingery_bulmash_duration(r, *air))
