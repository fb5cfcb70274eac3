"""When a front passed each microphone of an array, counted from their mean.

Every pair has its delay (`pair_delay`); times that fit them all best, and their
covariance, are what a plane or a sphere is fitted to. Noise is taken to be independent
from one microphone to another: that of wind and of electronics is, a distant road is
not, and an array closer than its wavelength hears the road as one more front.
"""

from itertools import combinations
from typing import NamedTuple

import numpy as np
from jaxtyping import ArrayLike, Float

from jblast.detect.array.pair_delay import PairDelay, Weighting, pair_delay
from jblast.errors import InputError

FEWEST, MOST = 2, 8
"""Microphones of an array."""
NEIGHBOURS = 16
"""Bins at either side over which powers are averaged."""
CERTAIN = 6.0
"""Sound in a bin is told from noise by so many standard deviations of the average."""
QUIETEST = 1e-12
"""Least noise, as a share of the loudest bin: silence between bangs is no knowledge."""
TAPERED = 0.05
"""Share of a window that fades in, and out."""


class RelativeTimes(NamedTuple):
    """When a front passed each microphone, counted from their mean.

    Attributes:
        time: Since the mean of all [s].
        covariance: Of these times [s^2]; singular, since their sum is zero.
        pairs: Delay of each pair, `(first, second)` counted from zero.
        lost: Pairs in which no delay is told.
    """

    time: Float[np.ndarray, " channel"]
    covariance: Float[np.ndarray, "channel channel"]
    pairs: dict[tuple[int, int], PairDelay]
    lost: tuple[tuple[int, int], ...]

    @property
    def complete(self) -> bool:
        """Whether the delays told reach every microphone."""
        return bool(np.isfinite(self.time).all())


def relative_times(
    samples: Float[ArrayLike, "channel n"],
    rate_hz: float,
    noise_variance: Float[ArrayLike, "channel bin"],
    largest_s: Float[ArrayLike, "..."],
    *,
    weighting: Weighting = "ml",
) -> RelativeTimes:
    """Return when a front passed each microphone.

    Args:
        samples: Two to eight records of one window, all on one clock; an even number of
            samples, the bang well inside.
        rate_hz: Samples a second.
        noise_variance: Of the noise in each bin of the window's unitary transform
            (`whitening.bin_variances`) [unit of the samples, squared].
        largest_s: Greatest delay of any pair, or of each [s]: the distance between the
            microphones over the speed of sound, and some.
        weighting: As in `pair_delay`.

    Raises:
        InputError: Too few or too many records, an odd window, or samples that are no
            numbers.
    """
    samples = np.asarray(samples, float)
    count, length = samples.shape
    if not FEWEST <= count <= MOST:
        raise InputError(
            f"samples: expected {FEWEST} to {MOST} microphones, got {count}"
        )
    if length % 2 or length < 4 * NEIGHBOURS:
        raise InputError(
            f"samples: expected an even number, {4 * NEIGHBOURS} or more, got {length}"
        )
    if not np.isfinite(samples).all():
        raise InputError("samples: expected finite numbers, got NaN or infinity")
    fade = _fade(length)
    spectra = np.fft.rfft((samples - samples.mean(axis=1, keepdims=True)) * fade)
    noise = np.asarray(noise_variance, float) * np.sum(fade**2)
    loudest = np.max(np.abs(spectra) ** 2, axis=1, keepdims=True)
    noise = np.maximum(noise, QUIETEST * loudest)
    gain, sound = _gain_and_sound(np.abs(spectra) ** 2, noise)
    spectra, noise = spectra / np.sqrt(gain)[:, None], noise / gain[:, None]
    reach = np.broadcast_to(np.asarray(largest_s, float), (count, count))
    pairs = {
        (i, j): pair_delay(
            spectra[[i, j]],
            sound,
            noise[[i, j]],
            rate_hz,
            float(reach[i, j]),
            weighting=weighting,
        )
        for i, j in combinations(range(count), 2)
    }
    return _combined(pairs, count)


def _fade(length: int) -> Float[np.ndarray, " n"]:
    """Return a window that is one but for its ends (Tukey's)."""
    ends = max(int(TAPERED * length), 1)
    rise = 0.5 * (1 - np.cos(np.pi * (np.arange(ends) + 0.5) / ends))
    return np.concatenate([rise, np.ones(length - 2 * ends), rise[::-1]])


def _gain_and_sound(
    power: Float[np.ndarray, "channel bin"], noise: Float[np.ndarray, "channel bin"]
) -> tuple[Float[np.ndarray, " channel"], Float[np.ndarray, " bin"]]:
    """Return by how much each record is louder, and the power that they share.

    Bins in which the sound cannot be told from the noise hold none.
    """
    width = 2 * NEIGHBOURS + 1
    kernel = np.full(width, 1 / width)
    above = np.array([np.convolve(p, kernel, "same") for p in power - noise])
    over = np.divide(above, noise, out=np.zeros_like(above), where=noise > 0)
    heard = over.sum(axis=0) > CERTAIN * np.sqrt(len(power) / width)
    heard &= (above > 0).all(axis=0)
    if not heard.any():
        return np.ones(len(power)), np.zeros(power.shape[1])
    gain = above[:, heard].sum(axis=1)
    gain = gain / gain.mean()
    return gain, np.where(heard, (above / gain[:, None]).mean(axis=0), 0.0)


def _combined(pairs: dict[tuple[int, int], PairDelay], count: int) -> RelativeTimes:
    """Return the times that fit all delays best, by least squares."""
    lost = tuple(pair for pair, delay in pairs.items() if np.isnan(delay.delay))
    known = {pair: delay for pair, delay in pairs.items() if pair not in lost}
    design = np.zeros((len(known), count))
    for row, (i, j) in enumerate(known):
        design[row, [i, j]] = -1.0, 1.0
    if np.linalg.matrix_rank(design) < count - 1:
        nothing = np.full((count, count), np.nan)
        return RelativeTimes(nothing[0], nothing, pairs, lost)
    variance = np.array([delay.sigma**2 for delay in known.values()])
    share = np.array([delay.share for delay in known.values()])
    weighed = design.T / variance
    gives = np.linalg.pinv(weighed @ design) @ weighed
    # an error of one record moves all its pairs; that of a product moves its own alone
    own = np.zeros(count)
    seen = np.abs(design).sum(axis=0)
    for (i, j), v, (first, second, _) in zip(known, variance, share, strict=True):
        own[i] += v * first / seen[i]
        own[j] += v * second / seen[j]
    between = design @ np.diag(own) @ design.T + np.diag(variance * share[:, 2])
    delays = np.array([delay.delay for delay in known.values()])
    return RelativeTimes(gives @ delays, gives @ between @ gives.T, pairs, lost)
