r"""Arrival of the flash."""

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Bool, Float

from jblast.constants import LIGHT_SPEED
from jblast.registry import Law, declared_scatter, register
from jblast.types import as_float_array
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
