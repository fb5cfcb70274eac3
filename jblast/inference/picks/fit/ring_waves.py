r"""The waves that what a resonant sensor makes of a pulse is a sum of.

Those that are forced: powers of the share of the rise that has passed; the pulse's own
decay, times powers of the share of that; powers of the share of the suction. And the
ring $e^{\lambda t}$ of each of four pieces, counted from where it begins.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.inference.picks.fit.computed_once import in_halves
from jblast.inference.picks.oscillation import oscillation
from jblast.inference.picks.ready.bins import Bins


class Terms(NamedTuple):
    r"""The coefficients of $\mathrm{Re}\,(C z)$: of what is forced, and of the ring.

    Attributes:
        up: Of powers of the share of the rise that has passed.
        down: Of powers of that of the decay, each times the pulse's own.
        low: Of powers of that of the suction.
        real: Of the ring that each piece begins with, the last behind all of them.
        imaginary: The other part of these.
    """

    up: Float[Array, " power"]
    down: Float[Array, " power"]
    low: Float[Array, " power"]
    real: Float[Array, "4"]
    imaginary: Float[Array, "4"]


class Waves(NamedTuple):
    """What waves add to the mean over each bin: less their differences, by its width.

    Attributes:
        forced: Of the rise, the decay and the suction, up to one power of the share of
            the decay more than `Terms` has.
        rings: Real parts of the four rings, then imaginary ones; then the same times
            the time since each began.
    """

    forced: Float[Array, "wave bin"]
    rings: Float[Array, "16 bin"]


class _Passed(NamedTuple):
    """Where instants lie: in which piece, and how much of each has passed."""

    inside: Float[Array, "4 instant"]
    rise: Float[Array, " instant"]
    decay: Float[Array, " instant"]
    suction: Float[Array, " instant"]
    elapsed: Float[Array, " instant"]


def sums_over(
    bins: Bins, numbers: Float[Array, "9"], terms: Terms
) -> Float[Array, "3 bin"]:
    r"""Return what the sum of all waves, $\mathrm{Re}\,(C z)$, adds to the mean.

    Args:
        bins: Contiguous.
        numbers: As `waves_over` has them.
        terms: By these numbers.

    Returns:
        All of it, then the ring $C z$ alone, real and imaginary part.
    """
    passed = _passed(bins, numbers)
    up, down, low = passed.inside[:3]
    s = passed.decay
    falling = (terms.down[0] + terms.down[1] * s) * jnp.exp(-numbers[4] * s)
    rising = terms.up @ _powers(terms.up.size, passed.rise)
    sucked = terms.low @ _powers(terms.low.size, passed.suction)
    cos, sin = oscillation(*_pole(numbers), passed.elapsed)
    a, b = terms.real @ passed.inside, terms.imaginary @ passed.inside
    forced = up * rising + down * falling + low * sucked
    real, imaginary = a * cos - b * sin, a * sin + b * cos
    return -bins.means_by(jnp.stack([forced + real, real, imaginary]))


def waves_over(bins: Bins, numbers: Float[Array, "9"], terms: Terms) -> Waves:
    """Return the waves over bins.

    Args:
        bins: Contiguous.
        numbers: Arrival, peak, rise, duration, decay, suction and its duration,
            frequency and damping; times in samples.
        terms: By these numbers: how many powers there are.
    """
    passed = _passed(bins, numbers)
    both = oscillation(*_pole(numbers), passed.elapsed)
    falling = in_halves(lambda s: jnp.exp(-numbers[4] * s), passed.decay)
    up, down, low = passed.inside[:3]
    forced = [
        up[None, :] * _powers(terms.up.size, passed.rise),
        (down * falling)[None, :] * _powers(terms.down.size + 1, passed.decay),
        low[None, :] * _powers(terms.low.size, passed.suction),
    ]
    rings = jnp.concatenate([passed.inside * x[None, :] for x in both])
    rings = jnp.concatenate([rings, passed.elapsed[None, :] * rings])
    return Waves(-bins.means_by(jnp.concatenate(forced)), -bins.means_by(rings))


def _passed(bins: Bins, numbers) -> _Passed:
    """Return where the ends of bins lie in a pulse."""
    arrival, _, rise, duration, _, _, fall, _, _ = numbers
    since = bins.ends.astype(numbers.dtype) - arrival
    edges = jnp.stack([jnp.zeros_like(rise), rise, duration, duration + fall])
    begun = (since[None, :] >= edges[:, None]).astype(since.dtype)
    inside = begun - jnp.concatenate([begun[1:], jnp.zeros_like(begun[:1])])
    return _Passed(
        inside=inside,
        rise=jnp.clip(since / rise, 0.0, 1.0),
        decay=jnp.clip((since - rise) / (duration - rise), 0.0, 1.0),
        suction=jnp.clip((since - duration) / fall, 0.0, 1.0),
        elapsed=jnp.maximum(since - edges @ inside, 0.0),
    )


def _pole(numbers):
    """Return real and imaginary part of the pole."""
    omega, damping = numbers[7], numbers[8]
    return -damping * omega, omega * jnp.sqrt(1.0 - damping * damping)


def _powers(many, x):
    """Return powers of numbers, [power, number]."""
    made = [jnp.ones_like(x)]
    for _ in range(many - 1):
        made.append(made[-1] * x)
    return jnp.stack(made)
