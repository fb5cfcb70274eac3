"""A law: the arrival of sound with a constant lead."""

import jax.numpy as jnp

from jblast.registry import Law, declared_scatter, register

LEAD_M = 3.0


def arrival(slant_range, sound_speed):
    """Return the travel time of sound that starts `LEAD_M` from the charge [s]."""
    return jnp.maximum(slant_range - LEAD_M, 0.0) / sound_speed


register(
    Law(
        quantity="air_arrival_s",
        name="straight_sound",
        function=arrival,
        range="everywhere",
        source="definition of the sound speed",
        valid=lambda slant_range: slant_range > LEAD_M,
        scatter=declared_scatter(shot=0.02, record=0.01),
        scatter_source="declared",
    )
)
