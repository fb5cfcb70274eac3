r"""Means of a pulse over even samples, as fast as memory takes them.

The same as `pulse_mean`, for samples one after another at one rate. Inside a piece of
the pulse the mean about the middle $m$ of a sample of half width $h$ (over the length
of the piece) is as short as the pressure itself: with $x = bh$

$$\overline{(1-s)\,e^{-bs}} = e^{-bm} \left[(1-m)\,\frac{\sinh x}{x}
  + h\,\frac{x \cosh x - \sinh x}{x^2}\right]$$

whose brackets are numbers of the pulse, so a sample costs one exponential and a few
products; both polynomials gain a term in $h^2$. Only samples that hold an end of a
piece, five of a pulse, are asked of `pulse_mean` and put in.

Time is counted in samples from the one that holds the arrival, whole ones apart from
the part of one: so in single precision the front stands where it does in double, if
the arrival itself is told as a number of samples that single precision can tell.
"""

import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Float, Int

from jblast.waves.waveform.friedlander_integrals import impulse_fraction
from jblast.waves.waveform.pulse import Pulse, pulse_mean

FARTHEST = 1 << 30
"""Samples that an arrival may be off the first one; farther it counts as that far."""


def pulse_samples(
    pulse: Pulse, start: Float[Array, ""], rate: float, count: int
) -> Float[Array, " sample"]:
    """Return the mean overpressure over each of some samples [Pa].

    Args:
        pulse: One wave: scalars; `vmap` does many.
        start: Where the first sample begins, on the clock of the arrival [s].
        rate: Samples a second [Hz].
        count: How many samples.
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
    # samples that hold an end: each once, as the others are put past the last
    last = jnp.asarray(FARTHEST, ends.dtype)
    held = jnp.floor(jnp.minimum(ends - part, last)).astype(whole.dtype) - whole
    again = (held[:, None] == held[None, :]) & np.tri(5, k=-1, dtype=bool)
    outside = again.any(axis=1) | (held < 0) | (held >= count)
    begin = (held + whole).astype(part.dtype) + part
    exact = pulse_mean(wave, begin, begin + 1.0)
    place = jnp.where(outside, count + jnp.arange(5, dtype=held.dtype), held)
    return inside.at[place].set(exact, mode="drop", unique_indices=True)


def _in_samples(
    pulse: Pulse, start: Float[Array, ""], rate: float
) -> tuple[Pulse, Int[Array, ""], Float[Array, ""]]:
    """Return the pulse with times in samples, and the first sample since the arrival.

    The last as whole samples and the part of one.
    """
    never = jnp.isposinf(pulse.arrival_time)
    since = (start - jnp.where(never, 0.0, pulse.arrival_time)) * rate
    since = jnp.where(never, -float(FARTHEST), jnp.clip(since, -FARTHEST, FARTHEST))
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
    """Return the means over samples that lie in one piece, as if all did."""
    _, risen, peaked, positive, over = ends
    rise = jnp.where(wave.rise_time > 0, wave.rise_time, 1.0)
    b, half = wave.decay, 0.5 / wave.decay_duration
    y = 2.0 * b * half
    k = impulse_fraction(y)
    # the brackets of the text by k(y), as in `pulse_mean`, but from the middle on
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
    # kept apart, or they are computed anew for each sample
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
