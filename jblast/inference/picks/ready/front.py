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
    widths = widths_of(samples.shape[0])
    sums = jnp.concatenate([jnp.zeros_like(samples[:1]), jnp.cumsum(samples)])
    many = max(samples.shape[0] // FIRST, 1)
    level = sums[many] / float(many)
    steps = jnp.stack([_steps(sums, level, width) for width in widths])
    found = _largest(steps, widths)
    for _ in range(2):
        found = _earlier(steps, widths, found)
    return found


def _steps(sums, level, width):
    """Return the steps over a width, by running sums; zero where they have no room.

    What is behind a front is above what the record began with, too: the way back from
    the suction is a step, but no front.
    """
    behind = sums[2 * width :] - sums[width:-width]
    before = sums[width:-width] - sums[: -2 * width]
    step = behind - jnp.maximum(before, width * level)
    none = jnp.zeros(width, sums.dtype)
    return jnp.concatenate([none, step * (0.5 / width) ** 0.5, none[1:]])


def _largest(steps, widths) -> Front:
    """Return the largest of some steps."""
    n = steps.shape[1]
    place = jnp.argmax(steps.reshape(-1))
    row, sample = place // n, place % n
    return Front(sample, jnp.asarray(widths)[row], steps.reshape(-1)[place])


def _earlier(steps, widths, found: Front) -> Front:
    """Return a clear front that comes before one, or that one."""
    of_width = jnp.asarray(widths)[:, None]
    index = jnp.arange(steps.shape[1])[None, :]
    apart = jnp.maximum(2 * of_width, 2 * found.width)
    before = (index < found.sample - apart) & (of_width <= found.width)
    seen = jnp.where(before, steps, 0.0)
    other = _largest(seen, widths)
    # what came before the earlier one, at each width
    quiet = (index < other.sample - 2 * of_width).astype(steps.dtype)
    many = jnp.sum(quiet, axis=1)
    rms = jnp.sqrt(jnp.sum(jnp.square(steps) * quiet, axis=1) / jnp.maximum(many, 1.0))
    row = jnp.argmax(jnp.asarray(widths) == other.width)
    noise = rms[row]
    clear = (
        (other.step > CLEAR * noise)
        & (other.step > SHARE * found.step)
        & (many[row] >= 16)
        & (noise > 0)
    )
    chosen = [jnp.where(clear, a, b) for a, b in zip(other, found, strict=True)]
    return Front(*(lax.stop_gradient(x) for x in chosen))
