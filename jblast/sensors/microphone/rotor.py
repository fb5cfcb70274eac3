r"""The tones of a vehicle's own rotors, which follow their speeds.

A rotor of $B$ blades at speed $\Omega(t)$ sounds at the harmonics $m$ of its blade
passage,

$$p(t) = (\Omega/\Omega_0)^2 \sum_m A_m \sin(m B \varphi(t) + \alpha_m), \quad
  \dot\varphi = \Omega$$

louder as its thrust does. Between knots the speed is straight, so the phase is a
parabola there and is integrated exactly, as turns less whole ones: it stays as exact
after hours. Samples are means over their duration; a harmonic above half the rate, of
which they would be aliases, is left out.
"""

import math
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Key

from jblast.errors import InputError
from jblast.types import as_float_array


class Rotors(eqx.Module):
    """Rotors whose tones a microphone on board hears.

    Attributes:
        time: Knots of the speeds, rising [s]; before and after them they are constant.
        speed: Of each rotor [rad/s].
        amplitude: Of each harmonic of the blade passage, at the microphone [Pa].
        reference_speed: At which the amplitudes hold [rad/s].
        blades: Of each rotor.
    """

    time: Float[Array, " knot"] = eqx.field(converter=as_float_array)
    speed: Float[Array, "knot rotor"] = eqx.field(converter=as_float_array)
    amplitude: Float[Array, " harmonic"] = eqx.field(converter=as_float_array)
    reference_speed: Float[Array, ""] = eqx.field(converter=as_float_array)
    blades: int = eqx.field(static=True, default=2)

    def __check_init__(self):
        if self.speed.ndim != 2 or self.time.shape != self.speed.shape[:1]:
            raise InputError(
                "rotors: expected times [knot] and speeds [knot, rotor], got shapes "
                f"{self.time.shape} and {self.speed.shape}"
            )


class RotorPhase(NamedTuple):
    """Rotors that are set up.

    Attributes:
        rotors: What they are.
        time: Of the knots, since the record began [s].
        turns: Of each rotor at the knots, whole ones left out.
        offset: Of each rotor's harmonics [rad].
    """

    rotors: Rotors
    time: Float[Array, " knot"]
    turns: Float[Array, "knot rotor"]
    offset: Float[Array, "rotor harmonic"]


def rotor_phase(
    rotors: Rotors, start_s: Float[Array, ""], key: Key[Array, ""]
) -> RotorPhase:
    """Set rotors up: their turns up to each knot, and where they stood at first.

    Args:
        rotors: What they are.
        start_s: When the record begins, on the clock of the knots [s].
        key: What the first phases are drawn from.
    """
    step = jnp.diff(rotors.time)[:, None]
    mean = 0.5 * (rotors.speed[1:] + rotors.speed[:-1])
    turned = step * mean / (2 * math.pi)
    none = jnp.zeros_like(rotors.speed[:1])
    turns = jnp.concatenate([none, jnp.cumsum(turned - jnp.floor(turned), axis=0)])
    shape = (rotors.speed.shape[1], rotors.amplitude.size)
    offset = 2 * math.pi * jax.random.uniform(key, shape)
    return RotorPhase(rotors, rotors.time - start_s, turns - jnp.floor(turns), offset)


def rotor_tones(
    phase: RotorPhase,
    shift: tuple[Float[Array, ""], Float[Array, ""]],
    time: Float[Array, " sample"],
    rate: float,
) -> Float[Array, " sample"]:
    """Return what the rotors sound like [Pa].

    Args:
        phase: Rotors that are set up.
        shift: What `time` counts from, since the record began, as `block_start`.
        time: Middle of each sample [s].
        rate: Samples a second [Hz].
    """
    rotors = phase.rotors
    knots = phase.time - shift[0] - shift[1]
    last = knots.size - 1
    knot = jnp.clip(jnp.searchsorted(knots, time, side="right") - 1, 0, last)
    since = (time - knots[knot])[:, None]
    first = rotors.speed[knot]
    gap = (knots[jnp.minimum(knot + 1, last)] - knots[knot])[:, None]
    rise = rotors.speed[jnp.minimum(knot + 1, last)] - first
    slope = jnp.where((gap > 0) & (since > 0), rise / jnp.where(gap > 0, gap, 1.0), 0.0)
    speed = first + slope * since
    turns = phase.turns[knot] + since * (first + 0.5 * slope * since) / (2 * math.pi)
    turns = turns - jnp.floor(turns)
    harmonic = jnp.arange(1.0, rotors.amplitude.size + 1.0) * rotors.blades
    harmonic = harmonic[None, None, :]  # axes: sample, rotor, harmonic
    frequency = speed[:, :, None] * harmonic / (2 * math.pi)
    mean = jnp.where(frequency < rate / 2, jnp.sinc(frequency / rate), 0.0)
    tone = jnp.sin(2 * math.pi * turns[:, :, None] * harmonic + phase.offset[None])
    loudness = (speed / rotors.reference_speed) ** 2
    return jnp.einsum("sr,h,srh->s", loudness, rotors.amplitude, mean * tone)
