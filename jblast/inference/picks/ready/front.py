r"""Where a record's first front lies, to a few samples: means behind over means before.

A step of the mean seen over $w$ samples on either side, in standard deviations of white
noise, $D_w = \sqrt{w/2}\,(\bar p_{[k, k+w)} - \bar p_{[k-w, k)})$, is the energy ratio
of a detector (STA/LTA, Allen 1978) with a sign, which drift and hum leave small, and
over many $w$ at once: of short pulses the short ones speak, of faint long ones the long
ones. The largest step is the front, unless an earlier one is clear, too: the wave that
a wall sends back may be the larger.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Float, Int

CLEAR = 12.0
"""An earlier step is another front when it is as many times the rms of those before."""

SHARE = 0.3
"""And as large a share of the largest."""

LARGEST_WIDTH = 2048

FIRST = 64
"""One of so many parts of a record, the first, tells what it began with."""


class Front(NamedTuple):
    """A front as seen at first.

    Attributes:
        sample: The first sample behind it.
        width: Over how many samples it is clearest.
        step: $D_w$ there, in the unit of the samples.
    """

    sample: Int[Array, ""]
    width: Int[Array, ""]
    step: Float[Array, ""]


def widths_of(samples: int) -> list[int]:
    """Return the widths that a record of some length is looked at over."""
    widths, width = [], 1
    while width <= min(max(samples // 8, 1), LARGEST_WIDTH):
        widths.append(width)
        width *= 2
    return widths


def first_front(samples: Float[Array, " sample"]) -> Front:
    """Return the first front of a record.

    Args:
        samples: Overpressure in any unit.
    """
    n = samples.shape[0]
    widths = widths_of(n)
    sums = jnp.concatenate([jnp.zeros_like(samples[:1]), jnp.cumsum(samples)])
    many = max(n // FIRST, 1)
    steps = _Steps(
        sums=jnp.pad(sums, widths[-1], mode="edge"),
        level=sums[many] / float(many),
        widths=jnp.asarray(widths),
    )
    found = _largest(steps, jnp.full(len(widths), n))
    for _ in range(2):
        found = _earlier(steps, found)
    return found


class _Steps(NamedTuple):
    """What the steps of a record are computed from, one width at a time.

    All of them at once would leave the cache of a core, and be kept for little: they
    are asked for three times, mostly for the largest of them alone.

    Attributes:
        sums: Running ones of the samples; the ends again on either side, as often as
            the largest width.
        level: Mean that the record began with.
        widths: That it is looked at over, powers of two.
    """

    sums: Float[Array, " padded"]
    level: Float[Array, ""]
    widths: Int[Array, " width"]

    def over(self, width: Int[Array, ""]) -> Float[Array, " sample"]:
        """Return the steps over a width; zero where they have no room.

        What is behind a front is above what the record began with, too: the way back
        from the suction is a step, but no front.
        """
        margin = 1 << (self.widths.shape[0] - 1)
        n = self.sums.shape[0] - 1 - 2 * margin
        here = self.sums[margin : margin + n]
        ahead = lax.dynamic_slice_in_dim(self.sums, margin + width, n)
        back = lax.dynamic_slice_in_dim(self.sums, margin - width, n)
        wide = width.astype(here.dtype)
        step = ahead - here - jnp.maximum(here - back, wide * self.level)
        index = jnp.arange(n)
        room = (index >= width) & (index <= n - width)
        return jnp.where(room, step * jnp.sqrt(0.5 / wide), 0.0)


def _largest(steps: _Steps, ends: Int[Array, " width"]) -> Front:
    """Return the largest step; of each width those before an end count."""

    def before(width, end):
        step = steps.over(width)
        return jnp.where(jnp.arange(step.shape[0]) < end, step, 0.0)

    heights = lax.map(lambda one: jnp.max(before(*one)), (steps.widths, ends))
    row = jnp.argmax(heights)
    width = steps.widths[row]
    return Front(jnp.argmax(before(width, ends[row])), width, heights[row])


def _earlier(steps: _Steps, found: Front) -> Front:
    """Return a clear front that comes before one, or that one."""
    ends = found.sample - jnp.maximum(2 * steps.widths, 2 * found.width)
    other = _largest(steps, jnp.where(steps.widths <= found.width, ends, 0))
    # what came before the earlier one, over its width
    before = steps.over(other.width)
    quiet = jnp.arange(before.shape[0]) < other.sample - 2 * other.width
    many = jnp.sum(quiet)
    squares = jnp.sum(jnp.where(quiet, jnp.square(before), 0.0))
    noise = jnp.sqrt(squares / jnp.maximum(many, 1).astype(before.dtype))
    clear = (
        (other.step > CLEAR * noise)
        & (other.step > SHARE * found.step)
        & (many >= 16)
        & (noise > 0)
    )
    chosen = [jnp.where(clear, a, b) for a, b in zip(other, found, strict=True)]
    return Front(*(lax.stop_gradient(x) for x in chosen))
