"""Signs that a record holds more than one pulse, or a ring of its sensor.

Both are read from what one pulse leaves over, and only begin a second fit: whether they
are there is decided by how much better that one is.
"""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.inference.picks.ready.bins import SINGLE_BEHIND, Bins
from jblast.inference.picks.ready.case import Case
from jblast.inference.picks.unknowns import CENTRE, Natural

LOUD = 9.5
"""Power of an oscillation [of white noise], which noise has once in 140 records."""

SHARP = 8.0
"""Standard deviations of a step."""

ODD = 4.0
"""Standard deviations of a squared misfit from which on one pulse is not all."""

CORNER = 0.3
"""Of a high-pass, times the duration of the positive phase, to begin with."""

FREQUENCIES = np.linspace(0.08, 2.9, 96)
"""Looked at [rad/sample]."""

NEAREST = 4.0
"""A further front is as many samples, and two rises, behind the first."""

SIDES = (1, 2, 4, 8)
"""Bins on either side of a step."""


class Signs(NamedTuple):
    """What may be in a record.

    Attributes:
        rings: 1: an oscillation; else 0.
        power: Of the loudest oscillation [of white noise].
        follows: 1: a further front; else 0.
        passed: 1: something that one pulse is not; else 0.
        start: Unknowns of all to begin with: see `unknowns.FURTHER`.
    """

    rings: Float[Array, ""]
    power: Float[Array, ""]
    follows: Float[Array, ""]
    passed: Float[Array, ""]
    start: Float[Array, "7"]


def signs_in(
    bins: Bins, apart: Float[Array, " bin"], case: Case, natural: Natural
) -> Signs:
    """Return what may be in a record.

    Args:
        bins: Where it is looked at.
        apart: Whitened differences to one pulse.
        case: The record.
        natural: The pulse, in samples.
    """
    power, omega = _oscillation(bins, apart)
    step, lag, height = _step(bins, apart, case, natural.rise)
    count = jnp.sum((apart != 0).astype(apart.dtype))
    ratio = jnp.sum(apart * apart) / jnp.maximum(count - CENTRE.size, 1.0)
    odd = ratio > 1.0 + ODD * jnp.sqrt(2.0 / jnp.maximum(count, 1.0))
    rings = (power > LOUD) | odd
    start = [jnp.log(omega), np.log(0.05), jnp.log(lag), jnp.log(height), 0.0]
    start += [np.log(CORNER) - jnp.log(natural.duration), 0.0]
    kind = apart.dtype
    return Signs(
        rings.astype(kind),
        power,
        (step > SHARP).astype(kind),
        odd.astype(kind),
        jnp.stack([jnp.asarray(x).astype(kind) for x in start]),
    )


def _oscillation(bins: Bins, apart):
    """Return the power of the loudest oscillation behind the front, and its omega."""
    first = bins.single.start + int(np.argmax(bins.first[bins.single] >= 0))
    behind = apart[first : first + SINGLE_BEHIND]
    phases = FREQUENCIES[:, None] * np.arange(behind.shape[0])[None, :]
    real = jnp.asarray(np.cos(phases), apart.dtype) @ behind
    imaginary = jnp.asarray(np.sin(phases), apart.dtype) @ behind
    power = (real**2 + imaginary**2) / behind.shape[0]
    best = jnp.argmax(power)
    return power[best], jnp.asarray(FREQUENCIES, apart.dtype)[best]


def _step(bins: Bins, apart, case: Case, rise):
    """Return the clearest step up behind the front, its lag and its height."""
    used = (case.weight > 0).astype(apart.dtype)
    gain = jnp.sum(case.noise.taps)
    # plain differences again, as far as noise is white
    weight = jnp.square(case.weight * gain)
    value = apart * case.weight * gain
    late = bins.start.astype(apart.dtype) > NEAREST + 2.0 * rise
    sums = jnp.concatenate([jnp.zeros_like(value[:1]), jnp.cumsum(value)])
    weights = jnp.concatenate([jnp.zeros_like(weight[:1]), jnp.cumsum(weight)])
    n = value.shape[0]
    found = []
    for side in SIDES:
        at = np.arange(side, n - side)
        before, after = at - side, at + side
        left = weights[at] - weights[before]
        right = weights[after] - weights[at]
        both = (left > 0) & (right > 0) & late[at] & (used[at] > 0)
        left, right = jnp.where(both, left, 1.0), jnp.where(both, right, 1.0)
        rise_of = (sums[after] - sums[at]) / right - (sums[at] - sums[before]) / left
        size = jnp.where(both, rise_of / jnp.sqrt(1.0 / left + 1.0 / right), 0.0)
        best = jnp.argmax(size)
        place = jnp.asarray(bins.start[at], apart.dtype)[best]
        found.append((size[best], place, rise_of[best]))
    sizes = jnp.stack([size for size, _, _ in found])
    row = jnp.argmax(sizes)
    lag = jnp.stack([place for _, place, _ in found])[row]
    height = jnp.stack([height for _, _, height in found])[row]
    return sizes[row], jnp.maximum(lag, 1.0), jnp.clip(height, 0.02, 5.0)
