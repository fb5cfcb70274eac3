r"""Blast waves at a position as pulses: pressure, means over samples, ground motion.

In air the wave has a front with a finite rise time. Time $t$ counts from the first
departure from the still air. With rise time $\tau$, peak $P$, duration $t_d$ and
suction $P^-$ of duration $t^-$ the wave has four pieces:

$$p = P\,(3x^2 - 2x^3), \quad x = t/\tau \qquad \text{the rise}$$
$$p = P \qquad \text{held for a time } t_h$$
$$p = P\,(1-s)\,e^{-bs}, \quad s = (t-\tau-t_h)/(t_d-\tau-t_h) \qquad
  \text{Friedlander's decay}$$
$$p = -\tfrac{27}{4}\,P^-\,s\,(1-s)^2, \quad s = (t - t_d)/t^- \qquad
  \text{the suction of `waveform.py`}$$

Arrival, peak, duration and both impulses are exactly those given: the decay $b$ is
solved from the impulse that the rise leaves, $k = (i - P\tau/2)/(P(t_d-\tau))$. Up to
$k = e - 2 = 0.718$ nothing is held. There $b = -1$ and the decay starts level; a larger
share would rise behind the front to more than its peak, so instead the peak is held,
for the share $t_h/(t_d-\tau) = (k-(e-2))/(3-e)$, which joins with a level slope. The
laws of this package need it only outside their ranges. No such wave has $k \le 0$ or
$k \ge 1$, more impulse than a rectangle: its decay, and all of its pressure, is NaN.

An instrument's sample is a mean over the sample: a front between two samples is placed
correctly, and a step never overshoots. The means are the integrals of each piece over
the part of the sample that it covers, written as sums of terms of one sign, not as
differences of integrals from the arrival: as exact in single precision as their
arguments are. A time of day is not: give times relative to a nearby one.

`pulse_samples` gives the same means for consecutive samples at one rate, as fast as
memory is written. Inside a piece of the pulse the mean about the middle $m$ of a sample
of half width $h$ (over the length of the piece) is as short a formula as the pressure:
with $x = bh$

$$\overline{(1-s)\,e^{-bs}} = e^{-bm} \left[(1-m)\,\frac{\sinh x}{x}
  + h\,\frac{x \cosh x - \sinh x}{x^2}\right]$$

whose brackets are constants of the pulse, so a sample costs one exponential and a few
products; both polynomials gain a term in $h^2$. Only samples that hold an end of a
piece, five for a pulse, are computed by `pulse_mean` and inserted. Time is counted in
samples from the one that contains the arrival, whole samples separately from the
fraction of one. In single precision the front is then placed as in double, if the
arrival itself is given as a number of samples that single precision resolves.

In the ground the pulse of a P wave has displacement and velocity

$$s(t) = A\,u^2 e^{-u}, \qquad \dot s(t) = \frac{A}{\tau}\,u\,(2 - u)\,e^{-u}, \qquad
u = (t - t_0)/\tau \ge 0$$

It is the shortest pulse of this kind that begins without a step of the velocity and
returns to rest. The shape is a choice: laws give two numbers of the pulse, and it has
exactly two parameters. The displacement is largest at $u = 2$, the velocity at
$u = 2 - \sqrt 2$, so a peak displacement $D$ and a peak velocity $v$ determine

$$A = \frac{e^2}{4} D, \qquad
\tau = (2\sqrt 2 - 2)\,e^{\sqrt 2 - 2} \frac{A}{v} = 0.852 \frac{D}{v}$$
"""

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, ArrayLike, Float, Int

from jblast.types import as_float_array, as_float_arrays
from jblast.waves.waveform import decay_of_fraction, impulse_fraction

LEVEL = math.e - 2.0
"""Impulse over peak times duration of a decay that starts level, $b = -1$ [-]."""
# Half of the range of int32, so that a sum of two such indices cannot overflow.
MAX_INDEX = 1 << 30
"""Largest distance of an arrival from the first sample; larger ones are clipped."""
AMPLITUDE_OVER_PEAK = math.exp(2.0) / 4.0
r"""Amplitude $A$ over peak displacement, which is at $u = 2$ [-]."""
PEAK_VELOCITY_FACTOR = (2.0 * math.sqrt(2.0) - 2.0) * math.exp(math.sqrt(2.0) - 2.0)
r"""Peak velocity over $A/\tau$ [-]."""


class Pulse(NamedTuple):
    r"""One wave at a position. The fields broadcast.

    Attributes:
        arrival_time: Start of the rise [s]; infinite for no wave.
        peak: Largest overpressure, $P$ [Pa].
        rise_time: Time from zero to the peak, $\tau$ [s]; may be zero.
        duration: Duration of the positive phase with the rise, $t_d$ [s].
        decay: Friedlander's $b$ behind the peak, at least -1 [-].
        suction: Largest underpressure $P^-$ [Pa].
        suction_duration: Duration of the negative phase, $t^-$ [s].
        hold_time: Duration of the peak, $t_h$ [s]; zero for most waves.
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
        """Duration from the end of the hold to the end of the overpressure [s]."""
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
    """Return the wave with given peak, durations and impulses.

    Args:
        arrival_time: Start of the rise [s].
        peak: Overpressure [Pa], positive.
        impulse: Impulse of the positive phase [Pa s]; for its range see the docstring
            of the module.
        duration: Duration of the positive phase [s], positive.
        rise_time: Time from zero to the peak [s], below the duration; 0 for a sharp
            front.
        suction: Largest underpressure [Pa], positive.
        suction_impulse: Impulse of the negative phase [Pa s], positive.
    """
    arrival_time, peak, impulse, duration, rise_time, suction, suction_impulse = (
        as_float_arrays(
            arrival_time, peak, impulse, duration, rise_time, suction, suction_impulse
        )
    )
    behind = duration - rise_time
    fraction = (impulse - 0.5 * peak * rise_time) / (peak * behind)
    possible = (fraction > 0) & (fraction < 1)
    # a harmless input where no wave exists; the decay there is set to NaN below
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
    """Return the overpressure at times [Pa].

    Args:
        pulse: The wave.
        time: Times on the clock of the arrival [s].
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
        start: Start of the sample, on the clock of the arrival [s].
        stop: End of the sample [s].
    """
    start, stop = as_float_arrays(start, stop)
    span = stop - start
    start, stop = start - pulse.arrival_time, stop - pulse.arrival_time
    peaked = pulse.rise_time + pulse.hold_time
    end = pulse.duration + pulse.suction_duration

    def part(first, last, length):
        """Return the share of the sample, and middle and half width over the length."""
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
    """Return the rise time as a divisor: 1 for a sharp front."""
    return jnp.where(rise_time > 0, rise_time, 1.0)


def pulse_samples(
    pulse: Pulse, start: Float[Array, ""], rate: float, count: int
) -> Float[Array, " sample"]:
    """Return the mean overpressure over each of several samples [Pa].

    Args:
        pulse: One wave with scalar fields; use `vmap` for more.
        start: Start of the first sample, on the clock of the arrival [s].
        rate: Sampling rate [Hz].
        count: Number of samples.
    """
    wave, whole, part = _in_samples(pulse, start, rate)
    ends = jnp.stack(
        [
            jnp.zeros_like(wave.duration),
            wave.rise_time,
            wave.rise_time + wave.hold_time,
            wave.duration,
            wave.duration + wave.suction_duration,
        ]
    )
    index = jnp.arange(count, dtype=whole.dtype)
    inside = _inside(wave, ends, (index + whole).astype(part.dtype) + part + 0.5)
    # Samples that contain an end, each once: duplicates get indices past the last
    # sample, which the scatter drops. So all indices are unique, as XLA is promised.
    last = jnp.asarray(MAX_INDEX, ends.dtype)
    at_end = jnp.floor(jnp.minimum(ends - part, last)).astype(whole.dtype) - whole
    repeated = (at_end[:, None] == at_end[None, :]) & np.tri(5, k=-1, dtype=bool)
    outside = repeated.any(axis=1) | (at_end < 0) | (at_end >= count)
    begin = (at_end + whole).astype(part.dtype) + part
    exact = pulse_mean(wave, begin, begin + 1.0)
    target = jnp.where(outside, count + jnp.arange(5, dtype=at_end.dtype), at_end)
    return inside.at[target].set(exact, mode="drop", unique_indices=True)


def _in_samples(
    pulse: Pulse, start: Float[Array, ""], rate: float
) -> tuple[Pulse, Int[Array, ""], Float[Array, ""]]:
    """Return the pulse with times in samples, and the time of the first sample.

    That time counts from the arrival, as whole samples and the fraction of one.
    """
    # an infinite arrival becomes a finite one far away: inf - inf would be NaN
    never = jnp.isposinf(pulse.arrival_time)
    since = (start - jnp.where(never, 0.0, pulse.arrival_time)) * rate
    since = jnp.where(never, -float(MAX_INDEX), jnp.clip(since, -MAX_INDEX, MAX_INDEX))
    whole = jnp.floor(since)
    times = {
        name: getattr(pulse, name) * rate
        for name in ("rise_time", "hold_time", "duration", "suction_duration")
    }
    wave = pulse._replace(arrival_time=jnp.zeros_like(since), **times)
    return wave, whole.astype(jnp.int32), since - whole


def _inside(
    wave: Pulse, ends: Float[Array, "5"], middle: Float[Array, " sample"]
) -> Float[Array, " sample"]:
    """Return the means over samples, exact for samples within one piece."""
    _, risen, peaked, positive, over = ends
    rise = _not_zero(wave.rise_time)
    b, half = wave.decay, 0.5 / wave.decay_duration
    y = 2.0 * b * half
    k = impulse_fraction(y)
    # the brackets of the module's docstring by k(y), relative to the middle
    level = jnp.exp(0.5 * y) * (1.0 - y * k)
    first = level + jnp.exp(0.5 * y) * (2.0 * k - (1.0 - y * k)) * half
    of_wave = (
        risen,
        peaked,
        positive,
        over,
        1.0 / rise,
        jnp.square(0.5 / rise),
        2.0 * half,
        b,
        wave.peak,
        wave.peak * first,
        wave.peak * level,
        1.0 / wave.suction_duration,
        jnp.square(0.5 / wave.suction_duration),
        6.75 * wave.suction,
    )
    # behind a barrier, because XLA would recompute them for each sample
    return _by_piece(middle, *lax.optimization_barrier(of_wave))


def _by_piece(
    middle: Float[Array, " sample"],
    risen: Float[Array, ""],
    peaked: Float[Array, ""],
    positive: Float[Array, ""],
    over: Float[Array, ""],
    per_rise: Float[Array, ""],
    rise_width: Float[Array, ""],
    per_decay: Float[Array, ""],
    b: Float[Array, ""],
    peak: Float[Array, ""],
    first: Float[Array, ""],
    level: Float[Array, ""],
    per_suction: Float[Array, ""],
    suction_width: Float[Array, ""],
    depth: Float[Array, ""],
) -> Float[Array, " sample"]:
    """Return the means by inverse lengths and squared half widths of the pieces."""
    x = middle * per_rise
    up = peak * (rise_width + x * (x * (3.0 - 2.0 * x) - 2.0 * rise_width))
    s = jnp.clip((middle - peaked) * per_decay, 0.0, 1.0)
    down = (first - level * s) * jnp.exp(-b * s)
    q = 1.0 - (middle - positive) * per_suction
    low = suction_width / 3.0 + q * (q * (1.0 - q) - suction_width)
    push = jnp.where(middle < risen, up, jnp.where(middle < peaked, peak, down))
    value = jnp.where(middle < positive, push, -depth * low)
    return jnp.where((middle < 0) | (middle > over), 0.0, value)


class GroundPulse(NamedTuple):
    r"""One pulse of the ground, or several. The fields broadcast.

    Attributes:
        arrival_time: Start $t_0$ [s]; infinite for no pulse.
        amplitude: $A$ [m].
        time_constant: $\tau$ [s].
    """

    arrival_time: Float[Array, "..."]
    amplitude: Float[Array, "..."]
    time_constant: Float[Array, "..."]


@jax.jit
def ground_pulse_of(
    arrival_time: Float[ArrayLike, "..."],
    displacement: Float[ArrayLike, "..."],
    velocity: Float[ArrayLike, "..."],
) -> GroundPulse:
    """Return the pulse with given peak displacement and peak velocity.

    Args:
        arrival_time: Start [s].
        displacement: Peak displacement [m]; zero where the velocity is zero.
        velocity: Peak velocity [m/s].
    """
    arrival_time, displacement, velocity = as_float_arrays(
        arrival_time, displacement, velocity
    )
    amplitude = AMPLITUDE_OVER_PEAK * displacement
    moves = velocity > 0.0
    # a pulse of zero amplitude has any time constant; 1 keeps gradients finite
    tau = PEAK_VELOCITY_FACTOR * amplitude / jnp.where(moves, velocity, 1.0)
    return GroundPulse(arrival_time, amplitude, jnp.where(moves, tau, 1.0))


@jax.jit
def ground_pulse_displacement(
    pulse: GroundPulse, time: Float[ArrayLike, "..."]
) -> Float[Array, "..."]:
    """Return the displacement at times [m]; zero before the arrival."""
    u = _since_arrival(pulse, time) / pulse.time_constant
    return pulse.amplitude * u**2 * jnp.exp(-u)


@jax.jit
def ground_pulse_velocity(
    pulse: GroundPulse, time: Float[ArrayLike, "..."]
) -> Float[Array, "..."]:
    """Return the velocity at times [m/s]; zero before the arrival."""
    u = _since_arrival(pulse, time) / pulse.time_constant
    return pulse.amplitude / pulse.time_constant * u * (2.0 - u) * jnp.exp(-u)


@jax.jit
def ground_pulse_velocity_mean(
    pulse: GroundPulse,
    start: Float[ArrayLike, "..."],
    stop: Float[ArrayLike, "..."],
) -> Float[Array, "..."]:
    r"""Return the mean velocity between two times [m/s].

    It is the difference of the displacements, written without cancellation:

    $$s(u + \delta) - s(u) = A\,e^{-u}\left[u^2 (e^{-\delta} - 1)
      + (2 u \delta + \delta^2)\,e^{-\delta}\right]$$

    Args:
        pulse: The pulse.
        start: Starts of the intervals [s].
        stop: Ends of the intervals [s].
    """
    start, stop = as_float_arrays(start, stop)
    first = _since_arrival(pulse, start)
    # of a sample that contains the arrival only the part after it counts
    inside = jnp.minimum(_since_arrival(pulse, stop), stop - start)
    u, delta = first / pulse.time_constant, inside / pulse.time_constant
    # by expm1: a sample is much shorter than the time constant, and a difference of
    # exponentials would cancel
    rise = u**2 * jnp.expm1(-delta) + (2.0 * u + delta) * delta * jnp.exp(-delta)
    return pulse.amplitude * jnp.exp(-u) * rise / (stop - start)


def _since_arrival(
    pulse: GroundPulse, time: Float[ArrayLike, "..."]
) -> Float[Array, "..."]:
    return jnp.maximum(as_float_array(time) - pulse.arrival_time, 0.0)
