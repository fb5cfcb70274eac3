"""Light from a charge: the arrival of the flash, and the direction of its source.

Both follow a straight line from the charge to the sensor. Refraction bends it by some
1e-5 rad a kilometre near level ground; a compass and a level are far worse.
"""

import math

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Bool, Float

from jblast.constants import LIGHT_SPEED
from jblast.registry import Law, declared_scatter, register
from jblast.types import as_float_array, as_float_arrays
from jblast.waves.arguments import checked


@checked
def light_arrival_time(slant_range: Float[ArrayLike, "..."]) -> Float[Array, "..."]:
    r"""Return the travel time of light [s].

    $$t = R/c$$

    The speed is that in vacuum; air would delay it by 0.03 %: 1 ns a kilometre.

    Args:
        slant_range: Range $R$ [m].
    """
    return as_float_array(slant_range) / LIGHT_SPEED


def light_valid(slant_range: Float[ArrayLike, "..."]) -> Bool[Array, "..."]:
    """Return True everywhere."""
    return jnp.full(as_float_array(slant_range).shape, True)


register(
    Law(
        quantity="flash_time_s",
        name="light",
        function=light_arrival_time,
        range="everywhere",
        source="SI Brochure, 9th edition",
        valid=light_valid,
        scatter=declared_scatter(shot=0.0, record=0.0),
        scatter_source="exact",
    )
)


@checked
def bearing(
    toward_east: Float[ArrayLike, "..."], toward_north: Float[ArrayLike, "..."]
) -> Float[Array, "..."]:
    r"""Return the direction of the charge, clockwise from north [rad], 0 to $2\pi$.

    A charge exactly above or below has none: the result is zero, with slope zero.

    Args:
        toward_east: East component from sensor to charge [m].
        toward_north: North component from sensor to charge [m].
    """
    east, north = as_float_arrays(toward_east, toward_north)
    aside = (east != 0) | (north != 0)
    # guarded on the input: the slope of arctan2 at (0, 0) is NaN
    angle = jnp.arctan2(jnp.where(aside, east, 0.0), jnp.where(aside, north, 1.0))
    return jnp.mod(angle, 2 * math.pi)


@checked
def elevation(
    toward_east: Float[ArrayLike, "..."],
    toward_north: Float[ArrayLike, "..."],
    toward_up: Float[ArrayLike, "..."],
) -> Float[Array, "..."]:
    r"""Return the direction of the charge, above the horizon [rad].

    The horizon is level. Over a distance $d$ the Earth drops by $d^2/2R$, an angle of
    $d/2R$ = 8e-5 rad per kilometre.

    Args:
        toward_east: East component from sensor to charge [m].
        toward_north: North component from sensor to charge [m].
        toward_up: Upward component from sensor to charge [m].
    """
    east, north, up = as_float_arrays(toward_east, toward_north, toward_up)
    squared = jnp.square(east) + jnp.square(north)
    # negated comparison, so that NaN stays NaN; guarded roots have a finite slope
    aside = ~(squared <= 0)
    level = jnp.where(aside, jnp.sqrt(jnp.where(aside, squared, 1.0)), 0.0)
    apart = aside | (up != 0)
    return jnp.arctan2(jnp.where(apart, up, 0.0), jnp.where(apart, level, 1.0))


def line_of_sight_valid(
    toward_east: Float[ArrayLike, "..."], toward_north: Float[ArrayLike, "..."]
) -> Bool[Array, "..."]:
    """Return False exactly above or below the charge, where no bearing exists."""
    east, north = as_float_arrays(toward_east, toward_north)
    return (east != 0) | (north != 0)


for _quantity, _function in (("bearing_rad", bearing), ("elevation_rad", elevation)):
    register(
        Law(
            quantity=_quantity,
            name="line_of_sight",
            function=_function,
            range="aside of the charge's vertical",
            source="geometry",
            valid=line_of_sight_valid,
            scatter=declared_scatter(shot=0.0, record=0.0),
            scatter_source="exact",
        )
    )
