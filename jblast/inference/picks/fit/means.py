r"""Means of a pulse over bins, and their slopes.

The slope of a mean is a difference of what the slope of the antiderivative is at the
two ends of a bin, and bins meet: so all seven slopes take one exponential an end. With
$u$ the time since the arrival, $x = u/\tau$, $L = t_d - \tau$, $s = (u - \tau)/L$ and
$r = (u - t_d)/t^-$, each within 0 and 1,

$$\int p = P \tau\,(x^3 - \tfrac12 x^4) + P L\,H(s) - \tfrac{27}{4} P^- t^- K(r),$$

$H(s) = \int_0^s (1-\sigma)\,e^{-b\sigma}\,\mathrm{d}\sigma$ and
$K(r) = \tfrac12 r^2 - \tfrac23 r^3 + \tfrac14 r^4$. The means themselves are not such
differences, which lose digits (`waves/waveform/pulse.py`); a slope has them to spare.
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.inference.picks.fit.computed_once import in_halves
from jblast.inference.picks.ready.bins import Bins
from jblast.waves.waveform.friedlander_integrals import impulse_fraction
from jblast.waves.waveform.pulse import Pulse, pulse_mean

SMALL = 0.02
"""Below it the integral of x (1 - x) exp(-y x) is by its series: closed, it cancels."""


def means_over(bins: Bins, pulse: Pulse) -> Float[Array, " bin"]:
    """Return the means of a pulse over bins.

    Args:
        bins: Contiguous.
        pulse: With a rise, and nothing held; times in samples.
    """
    numbers = jnp.stack(pulse[:7])
    kind = numbers.dtype
    start, stop = bins.start.astype(kind), bins.stop.astype(kind)

    @jax.custom_jvp
    def of(numbers):
        made = Pulse(*numbers, hold_time=jnp.zeros((), kind))
        return pulse_mean(made, start, stop)

    @of.defjvp
    def _(primals, tangents):
        # slopes by these seven numbers once, not by each unknown there is
        return of(primals[0]), tangents[0] @ mean_slopes(bins, primals[0])

    return of(numbers)


def mean_slopes(bins: Bins, numbers: Float[Array, "7"]) -> Float[Array, "7 bin"]:
    """Return the slopes of means over bins by arrival, peak, rise and so on.

    Args:
        bins: Contiguous.
        numbers: The first seven of a `Pulse`, in its order.
    """
    ends = bins.ends.astype(numbers.dtype)
    return bins.means_by(_antiderivative_slopes(ends, *numbers))


def mean_columns(bins: Bins, pulse: Pulse) -> Float[Array, "2 bin"]:
    """Return the means over bins by a peak of 1, and by a suction of 1.

    Args:
        bins: Contiguous.
        pulse: With a rise, and nothing held; its peak and suction are not asked for.
    """
    since = bins.ends.astype(pulse.arrival_time.dtype) - pulse.arrival_time
    rise, length, fall = pulse.rise_time, pulse.decay_duration, pulse.suction_duration
    x, s, r = _shares(since, rise, length, pulse.duration, fall)
    y = pulse.decay * s
    k = impulse_fraction(y)
    at_ends = jnp.stack(
        [
            rise * _risen(x) + length * _fallen(s, k, _late(y, k)),
            -6.75 * fall * _sucked(r),
        ]
    )
    return bins.means_by(at_ends)


def _antiderivative_slopes(time, arrival, peak, rise, duration, decay, suction, fall):
    """Return the slopes of the integral up to each instant, [7, instant]."""
    since, length = time - arrival, duration - rise
    x, s, r = _shares(since, rise, length, duration, fall)
    up = x * x * (3.0 - 2.0 * x)
    risen = _risen(x)
    y = decay * s
    k, falling = in_halves(lambda y: (impulse_fraction(y), jnp.exp(-y)), y)
    late = _late(y, k)
    middle = _middle(y, k, late)
    down = (1.0 - s) * falling
    fallen = _fallen(s, k, late)
    low = r * (1.0 - r) * (1.0 - r)
    sucked = _sucked(r)
    rising = since < rise
    deep = 6.75 * suction
    return jnp.stack(
        [
            deep * low - peak * jnp.where(rising, up, down),
            rise * risen + length * fallen,
            peak * jnp.where(rising, risen - x * up, 0.5 - fallen - (1.0 - s) * down),
            peak * (fallen - s * down) + deep * low,
            -peak * length * s * s * ((1.0 - s) * late + s * middle),
            -6.75 * fall * sucked,
            deep * (r * low - sucked),
        ]
    )


def _shares(since, rise, length, duration, fall):
    """Return how far the rise, the decay and the suction are, each from 0 to 1."""
    x = jnp.clip(since / rise, 0.0, 1.0)
    s = jnp.clip((since - rise) / length, 0.0, 1.0)
    r = jnp.clip((since - duration) / fall, 0.0, 1.0)
    return x, s, r


def _risen(x):
    """Return the integral of the rise up to a share of it."""
    return x * x * x * (1.0 - 0.5 * x)


def _late(y, k):
    """Return the integral of x exp(-y x), by that of 1 - x."""
    return 1.0 - y * k - k


def _fallen(s, k, late):
    """Return the integral of the decay up to a share of it, by those."""
    return s * ((1.0 - s) * (k + late) + s * k)


def _sucked(r):
    """Return the integral of the suction up to a share of it."""
    return r * r * (0.5 + r * (0.25 * r - 2.0 / 3.0))


def _middle(y, k, late):
    """Return the integral of x (1 - x) exp(-y x), by those of 1 - x and of x."""
    near = jnp.abs(y) < SMALL
    series = 1.0 / 6.0 + y * (-1.0 / 12.0 + y * (1.0 / 40.0 - y / 180.0))
    return jnp.where(near, series, (k - late) / jnp.where(near, 1.0, y))
