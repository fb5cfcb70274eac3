"""Bins of samples about a front: single where it rises, wider away from it.

What a pulse does a time $x$ behind its front takes about $x$ to be done, so means over
a share of $x$ keep nearly all that single samples tell, and a record of thousands of
samples becomes two hundred numbers. Nothing is approximated by that: the model's means
over a bin are exact (`waves/pulse.py`).

The bins are the same for all records, counted in samples from the one where the front
was seen; sample $i$ covers $i - 1/2$ to $i + 1/2$.
"""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

SINGLE_BEFORE, SINGLE_BEHIND = 24, 96
"""Samples that are bins of their own."""

GROWTH_BEFORE, GROWTH_BEHIND = 0.2, 0.05
"""Width of a bin over its distance from the front [-]."""


class Bins(NamedTuple):
    """Where bins lie, in samples from the front's.

    Attributes:
        first: First sample of each.
        width: How many samples it has.
    """

    first: Int[np.ndarray, " bin"]
    width: Int[np.ndarray, " bin"]

    @property
    def start(self) -> Float[np.ndarray, " bin"]:
        """Where each begins [samples]."""
        return self.first - 0.5

    @property
    def stop(self) -> Float[np.ndarray, " bin"]:
        """Where each ends [samples]."""
        return self.first + self.width - 0.5

    @property
    def ends(self) -> Float[np.ndarray, " end"]:
        """Where each begins, and where the last one ends [samples]."""
        return np.append(self.start, self.stop[-1])

    @property
    def middle(self) -> Float[np.ndarray, " bin"]:
        """The middle of each [samples]."""
        return self.first + 0.5 * (self.width - 1)

    @property
    def single(self) -> slice:
        """Which bins are samples of their own: those in a row about the front."""
        ones = np.flatnonzero(self.width == 1)
        return slice(int(ones[0]), int(ones[-1]) + 1)

    def means_by(self, at_ends: Float[Array, "row end"]) -> Float[Array, "row bin"]:
        """Return means over each, where they meet, by antiderivatives at `ends`."""
        width = self.width.astype(at_ends.dtype)
        return (at_ends[:, 1:] - at_ends[:, :-1]) / width[None, :]


def bins_about_front(samples: int) -> Bins:
    """Return the bins that cover a record wherever its front lies.

    Args:
        samples: Of the record.
    """
    behind = [
        *range(SINGLE_BEHIND + 1),
        *_growing(SINGLE_BEHIND, GROWTH_BEHIND, samples),
    ]
    before = [
        *range(SINGLE_BEFORE + 1),
        *_growing(SINGLE_BEFORE, GROWTH_BEFORE, samples),
    ]
    ends = np.array([-end for end in reversed(before)][:-1] + behind)
    return Bins(ends[:-1], np.diff(ends))


def _growing(start: int, growth: float, last: int) -> list[int]:
    """Return ends of bins from a distance on."""
    ends = [start]
    while ends[-1] < last:
        ends.append(ends[-1] + max(1, round(growth * ends[-1])))
    return ends[1:]


def means_in_bins(
    bins: Bins, samples: Float[Array, " sample"], front: Int[Array, ""]
) -> Float[Array, " bin"]:
    """Return the mean of the samples in each bin; of bins beyond the record, its ends.

    Args:
        bins: Where they lie.
        samples: Of a record.
        front: The sample that bins count from.
    """
    n = samples.shape[0]
    sums = jnp.concatenate([jnp.zeros_like(samples[:1]), jnp.cumsum(samples)])
    first = jnp.clip(front + bins.first, 0, n - 1)
    last = jnp.clip(front + bins.first + bins.width, first + 1, n)
    wide = (sums[last] - sums[first]) / (last - first).astype(samples.dtype)
    # single samples themselves: a difference of sums has lost digits
    single = bins.single
    return wide.at[single].set(samples[first[single]])


def bins_within(
    bins: Bins,
    front: Int[Array, ""],
    first: Int[Array, ""] | int,
    last: Int[Array, ""] | int,
) -> Bool[Array, " bin"]:
    """Return which bins hold samples from the first to before the last only."""
    start = front + bins.first
    return (start >= first) & (start + bins.width <= last)
