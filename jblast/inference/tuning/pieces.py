"""A record in pieces: its ends faded, its spectrum in bands, its limit left out."""

import numpy as np
from jaxtyping import Bool, Float, Int

TAPER = 0.05
"""Part of a record that is faded in, and out."""
BANDS = 48
FEWEST = 12
"""Fourier coefficients in a band."""
SKIPPED = 4
"""Fourier coefficients from the mean on, which taper and drifts spoil."""


def taper_of(count: int) -> Float[np.ndarray, " sample"]:
    """Return a record's weights: 1, but a cosine at both ends."""
    faded = max(1, round(TAPER * count))
    rise = 0.5 - 0.5 * np.cos(np.pi * (np.arange(faded) + 0.5) / faded)
    return np.concatenate([rise, np.ones(count - 2 * faded), rise[::-1]])


def around_limit(
    clipped: Bool[np.ndarray, " sample"],
) -> tuple[Int[np.ndarray, "2 sample"], Float[np.ndarray, " sample"]]:
    """Return for each sample the two that stand for it, and the share of the second.

    Noise is loudest where it is slow, so a line between the samples before and after is
    near to what it was where the recorder was at its limit.
    """
    number = np.arange(clipped.size)
    if not clipped.any() or clipped.all():
        return np.stack([number, number]), np.zeros(clipped.size)
    alive = number[~clipped]
    after = np.minimum(np.searchsorted(alive, number), alive.size - 1)
    before = np.maximum(np.searchsorted(alive, number, side="right") - 1, 0)
    first, last = alive[before], alive[after]
    apart = np.maximum(last - first, 1)
    return np.stack([first, last]), np.where(clipped, (number - first) / apart, 0.0)


def bands_of(
    count: int,
) -> tuple[Int[np.ndarray, " frequency"], Float[np.ndarray, " band"]]:
    """Return the band of each Fourier coefficient of a record, and their sizes.

    Bands are even in the logarithm of frequency where they hold enough; neither the
    lowest few coefficients nor the one at half the rate, which is real, are in any.
    """
    size = count // 2 + 1
    edges = np.geomspace(SKIPPED, size - 1, BANDS + 1)
    number = np.arange(size)
    band = np.searchsorted(edges, number, side="right") - 1
    band[(number < SKIPPED) | (number >= size - 1)] = -1
    merged, held, current = np.full(size, -1), [], 0
    for one in range(BANDS):
        inside = band == one
        if not inside.any():
            continue
        merged[inside] = current
        total = np.count_nonzero(merged == current)
        if total >= FEWEST:
            held.append(total)
            current += 1
    if held and (rest := np.count_nonzero(merged == current)):
        merged[merged == current] = current - 1
        held[-1] += rest
    return merged, np.array(held, float)
