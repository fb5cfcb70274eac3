r"""One blast wave at a place, with a front that takes a time to rise.

Time $t$ counts from the first departure from the still air. With rise time $\tau$,
peak $P$, duration $t_d$ and suction $P^-$ of duration $t^-$ the wave has four pieces:

$$p = P\,(3x^2 - 2x^3), \quad x = t/\tau \qquad \text{the rise}$$
$$p = P \qquad \text{held for a time } t_h$$
$$p = P\,(1-s)\,e^{-bs}, \quad s = (t-\tau-t_h)/(t_d-\tau-t_h) \qquad
  \text{Friedlander's decay}$$
$$p = -\tfrac{27}{4}\,P^-\,s\,(1-s)^2, \quad s = (t - t_d)/t^- \qquad
  \text{the suction of `negative\_phase.py`}$$

Arrival, peak, duration and both impulses are exactly those asked for: the decay $b$ is
solved from the impulse that the rise leaves, $k = (i - P\tau/2)/(P(t_d-\tau))$. Up to
$k = e - 2 = 0.718$ nothing is held. There $b = -1$ and the decay starts level; a larger
share would rise behind the front to more than its peak, so instead the peak is held,
for the share $t_h/(t_d-\tau) = (k-(e-2))/(3-e)$, which joins with a level slope. The
laws of this house need it only outside their ranges. No such wave has $k \le 0$ or
$k \ge 1$, more impulse than a rectangle: its decay, and all of its pressure, is NaN.

What an instrument samples is a mean over each sample: so a front between two samples
lands where it should, and a step never overshoots. The means are the integrals of each
piece over the part of the sample that it covers, written in sums of what has one sign,
not as differences of integrals from the arrival: as exact in single precision as their
arguments are. A time of the day is not: count it from close by.
"""

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float

from jblast.types import as_float_arrays
from jblast.waves.waveform.friedlander_integrals import (
    decay_of_fraction,
    impulse_fraction,
)

LEVEL = math.e - 2.0
"""Impulse over peak times duration of a decay that starts level, $b = -1$ [-]."""


class Pulse(NamedTuple):
    r"""One wave at a place. The fields broadcast.

    Attributes:
        arrival_time: When it first departs from zero [s]; infinite: never.
        peak: Overpressure that it reaches, $P$ [Pa].
        rise_time: From zero to the peak, $\tau$ [s]; may be zero.
        duration: Of the positive phase, rise included, $t_d$ [s].
        decay: Friedlander's $b$ behind the peak, at least -1 [-].
        suction: Greatest underpressure $P^-$ [Pa].
        suction_duration: Of the negative phase, $t^-$ [s].
        hold_time: How long the peak lasts, $t_h$ [s]; zero for most.
    """

    arrival_time: Float[Array, "..."]
    peak: Float[Array, "..."]
    rise_time: Float[Array, "..."]
    duration: Float[Array, "..."]
    decay: Float[Array, "..."]
    suction: Float[Array, "..."]
    suction_duration: Float[Array, "..."]
    hold_time: Float[Array, "..."]

    @property
    def decay_duration(self) -> Float[Array, "..."]:
        """Of what follows the rise and the hold, up to the end of the overpressure."""
        return self.duration - self.rise_time - self.hold_time


@jax.jit
def pulse_of(
    arrival_time: Float[ArrayLike, "..."],
    peak: Float[ArrayLike, "..."],
    impulse: Float[ArrayLike, "..."],
    duration: Float[ArrayLike, "..."],
    rise_time: Float[ArrayLike, "..."],
    suction: Float[ArrayLike, "..."],
    suction_impulse: Float[ArrayLike, "..."],
) -> Pulse:
    """Return the wave that has these values.

    Args:
        arrival_time: When it arrives [s].
        peak: Overpressure [Pa], positive.
        impulse: Of the positive phase [Pa s]: see above for those that there are.
        duration: Of the positive phase [s], positive.
        rise_time: From zero to the peak [s], below the duration; 0: a sharp front.
        suction: Greatest underpressure [Pa], positive.
        suction_impulse: Of the negative phase [Pa s], positive.
    """
    arrival_time, peak, impulse, duration, rise_time, suction, suction_impulse = (
        as_float_arrays(
            arrival_time, peak, impulse, duration, rise_time, suction, suction_impulse
        )
    )
    behind = duration - rise_time
    fraction = (impulse - 0.5 * peak * rise_time) / (peak * behind)
    possible = (fraction > 0) & (fraction < 1)
    fraction = jnp.where(possible, fraction, 0.5)
    decay = decay_of_fraction(jnp.minimum(fraction, LEVEL))
    held = jnp.maximum(fraction - LEVEL, 0.0) / (1.0 - LEVEL)
    return Pulse(
        arrival_time=arrival_time,
        peak=peak,
        rise_time=rise_time,
        duration=duration,
        decay=jnp.where(possible, decay, jnp.nan),
        suction=suction,
        suction_duration=16.0 / 9.0 * suction_impulse / suction,
        hold_time=held * behind,
    )


@jax.jit
def pulse_pressure(pulse: Pulse, time: Float[ArrayLike, "..."]) -> Float[Array, "..."]:
    """Return the overpressure at instants [Pa].

    Args:
        pulse: The wave.
        time: On the clock of its arrival [s].
    """
    (time,) = as_float_arrays(time)
    since = time - pulse.arrival_time
    peaked = pulse.rise_time + pulse.hold_time
    x = jnp.clip(since / _not_zero(pulse.rise_time), 0.0, 1.0)
    s = jnp.clip((since - peaked) / pulse.decay_duration, 0.0, 1.0)
    q = 1.0 - jnp.clip((since - pulse.duration) / pulse.suction_duration, 0.0, 1.0)
    rise = x * x * (3.0 - 2.0 * x)
    decay = (1.0 - s) * jnp.exp(-pulse.decay * s)
    shape = jnp.where(since < pulse.rise_time, rise, decay)
    suction = 6.75 * pulse.suction * (1.0 - q) * q * q
    return jnp.where(since < 0, 0.0, pulse.peak * shape - suction)


@jax.jit
def pulse_mean(
    pulse: Pulse, start: Float[ArrayLike, "..."], stop: Float[ArrayLike, "..."]
) -> Float[Array, "..."]:
    """Return the mean overpressure from start to stop [Pa].

    Args:
        pulse: The wave.
        start: Of the sample, on the clock of the arrival [s].
        stop: Of the sample [s], after its start.
    """
    start, stop = as_float_arrays(start, stop)
    span = stop - start
    start, stop = start - pulse.arrival_time, stop - pulse.arrival_time
    peaked = pulse.rise_time + pulse.hold_time
    end = pulse.duration + pulse.suction_duration

    def part(first, last, length):
        """Return share of the sample, middle and half width, these over the length."""
        width = span - jnp.maximum(first - start, 0) - jnp.maximum(stop - last, 0)
        width = jnp.maximum(width, 0)
        middle = 0.5 * (jnp.maximum(start, first) + jnp.minimum(stop, last))
        inside = jnp.clip(middle, first, last) - first
        return width / span, inside / length, 0.5 * width / length

    share, m, h = part(
        jnp.zeros_like(peaked), pulse.rise_time, _not_zero(pulse.rise_time)
    )
    total = share * (m * m * (3.0 - 2.0 * m) + h * h * (1.0 - 2.0 * m))
    total = total + part(pulse.rise_time, peaked, 1.0)[0]
    share, m, h = part(peaked, pulse.duration, pulse.decay_duration)
    width = 2.0 * h
    k = impulse_fraction(pulse.decay * width)
    # e^{-b s0} [(1 - s1) (1 - e^{-y})/y + (s1 - s0) k(y)] with y = b (s1 - s0)
    shape = jnp.maximum(1.0 - m - h, 0) * (1.0 - pulse.decay * width * k) + width * k
    total = total + share * shape * jnp.exp(-pulse.decay * jnp.maximum(m - h, 0))
    share, m, h = part(pulse.duration, end, pulse.suction_duration)
    q = 1.0 - m
    suction = share * (q * q * m + h * h * (1.0 / 3.0 - q))
    return pulse.peak * total - 6.75 * pulse.suction * suction


def _not_zero(rise_time: Float[Array, "..."]) -> Float[Array, "..."]:
    """Return what to divide by: a sharp front has no rise to be in."""
    return jnp.where(rise_time > 0, rise_time, 1.0)
