"""Pulses by the laws, many at a time, for templates.

The module is separate from the other templates since it imports JAX, which the matched
filter does not need.
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float

from jblast.kept_programs import kept
from jblast.types import as_float_arrays
from jblast.waves.laws.shock_kinematics import shock_kinematics_impulse
from jblast.waves.pulse import Pulse, pulse_of, pulse_samples
from jblast.waves.waveform import blast_pulse, weak_shock_rise_time


@kept
def pulses_by_law(
    mass: Float[ArrayLike, "..."],
    distance: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, ""],
    sound_speed: Float[ArrayLike, ""],
    burst: str,
) -> Pulse:
    """Return blasts whose fronts arrive at time zero.

    Args:
        mass: TNT-equivalent mass [kg], positive.
        distance: Slant range [m], positive.
        ambient_pressure: Ambient pressure [Pa].
        sound_speed: Speed of sound [m/s].
        burst: "surface" or "free-air".
    """
    mass, distance, ambient, speed = as_float_arrays(
        mass, distance, ambient_pressure, sound_speed
    )
    ambient, speed = (jnp.broadcast_to(x, mass.shape) for x in (ambient, speed))
    blast = blast_pulse(distance, mass, ambient, speed, burst)
    impulse = shock_kinematics_impulse(distance, mass, ambient, speed, burst)
    rise = weak_shock_rise_time(blast.peak, impulse, blast.duration)
    return pulse_of(
        jnp.zeros_like(mass),
        blast.peak,
        impulse,
        blast.duration,
        rise,
        blast.suction,
        blast.suction_impulse,
    )


@kept
def sampled(pulses: Pulse, rate_hz: float, count: int) -> Float[Array, "pulse sample"]:
    """Return the mean of each pulse over each sample from its front on [Pa].

    Args:
        pulses: Pulses whose fronts arrive at time zero.
        rate_hz: Sampling rate [Hz].
        count: Number of samples.
    """
    start = jnp.zeros((), pulses.peak.dtype)
    return jax.vmap(lambda pulse: pulse_samples(pulse, start, rate_hz, count))(pulses)
