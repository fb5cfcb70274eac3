"""The history of the overpressure at a place by closed forms."""

from collections.abc import Callable
from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.waves.waveform import (
    friedlander_decay,
    friedlander_pressure,
    modified_friedlander_pressure,
    negative_phase_pressure,
)


class PulseParameters(NamedTuple):
    """What a closed form needs of a waveform, in any units that go together.

    Attributes:
        peak: Overpressure at the front.
        duration: Of the positive phase.
        impulse: Of the positive phase.
        suction: Greatest underpressure, positive.
        suction_impulse: Of the negative phase, positive.
    """

    peak: Float[Array, "..."]
    duration: Float[Array, "..."]
    impulse: Float[Array, "..."]
    suction: Float[Array, "..."]
    suction_impulse: Float[Array, "..."]


def triangle(time: Float[Array, "..."], pulse: PulseParameters) -> Float[Array, "..."]:
    """Return a straight fall to zero, and nothing after."""
    return pulse.peak * jnp.maximum(1.0 - time / pulse.duration, 0.0)


def decay_one(time: Float[Array, "..."], pulse: PulseParameters) -> Float[Array, "..."]:
    """Return Friedlander's pulse of decay 1 with its own tail."""
    return friedlander_pressure(time, pulse.peak, pulse.duration)


def decay_of_impulse(
    time: Float[Array, "..."], pulse: PulseParameters
) -> Float[Array, "..."]:
    """Return Friedlander's pulse that has the impulse, with its own tail."""
    decay = friedlander_decay(pulse.peak, pulse.impulse, pulse.duration)
    return modified_friedlander_pressure(time, pulse.peak, pulse.duration, decay)


def cut(time: Float[Array, "..."], pulse: PulseParameters) -> Float[Array, "..."]:
    """Return Friedlander's pulse that has the impulse, and nothing after."""
    return jnp.where(time < pulse.duration, decay_of_impulse(time, pulse), 0.0)


def with_suction(
    time: Float[Array, "..."], pulse: PulseParameters
) -> Float[Array, "..."]:
    """Return Friedlander's pulse that has the impulse, and the cubic negative phase.

    Its duration is the cubic's own for its underpressure and impulse.
    """
    length = 16.0 / 9.0 * pulse.suction_impulse / pulse.suction
    after = negative_phase_pressure(time, pulse.duration, pulse.suction, length)
    return jnp.where(time < pulse.duration, decay_of_impulse(time, pulse), after)


Form = Callable[[Float[Array, "..."], PulseParameters], Float[Array, "..."]]
"""The overpressure by the time since arrival, which is not negative."""

POSITIVE: dict[str, Form] = {
    "triangle": triangle,
    "Friedlander, b = 1": decay_one,
    "Friedlander, b of impulse": decay_of_impulse,
}
"""For the positive phase."""

WHOLE: dict[str, Form] = {
    "b = 1, own tail": decay_one,
    "b of impulse, own tail": decay_of_impulse,
    "b of impulse, then nothing": cut,
    "b of impulse, then cubic": with_suction,
}
"""For both phases."""
