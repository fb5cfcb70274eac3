"""Onsets in a recording of any length: intervals that may contain a blast.

The power of a few milliseconds over that of the half second before them, as `sta_lta`,
but about the mean of that half second, in bins and block by block: a recording of an
hour takes constant memory. The result is an interval of equal length about each onset.
Whether it contains a blast is decided by the fit of a pulse (`picks`).
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from jblast.observations.records.recording import PressureRecord, Recording
from jblast.signals.sta_lta import ON

SHORT_BINS, LONG_BINS = 5, 500
"""Windows after and before an onset: the defaults of `sta_lta`, 5 ms and 0.5 s."""
BIN_S, BIN_SAMPLES = 0.001, 4
"""A bin is a millisecond, or so many samples where these take longer."""
BEFORE_S, AFTER_S = 0.5, 1.5
"""Of a stretch about an onset; where samples are few, `MIN_SAMPLES` of them."""
MIN_SAMPLES = 4096
"""Smallest number of samples of a stretch; declared. A quarter lies before the
onset."""
QUIETER = 0.1
"""Onsets whose peak is below this share of the loudest one's (20 dB) are left out."""
SILENT = 1e-12
"""Share of a block's power below which sums of squares are rounding."""
MAX_ONSETS = 16
"""Largest number of onsets of a channel; the loudest are used."""


class Onset(NamedTuple):
    """A sudden rise of the power of a channel.

    Attributes:
        sample: Where it begins, to a bin.
        ratio: Of powers, after over before.
        peak: Largest size of a sample about the mean before, in the stretch after it.
    """

    sample: int
    ratio: float
    peak: float


class Stretches(NamedTuple):
    """Intervals of a channel that may contain a blast.

    Attributes:
        records: Stretches of equal length, in order of time.
        quieter: How many onsets were left out: 20 dB below the loudest, or beyond the
            `MAX_ONSETS` loudest.
    """

    records: tuple[PressureRecord, ...]
    quieter: int


def stretches(recording: Recording) -> tuple[Stretches, ...]:
    """Return the stretches of each channel; of a short recording, all of it.

    The loudest sample of a channel is always within one: a record that begins with the
    bang has nothing quiet before it, and no onset.

    Raises:
        InputError: A sample is no finite number.
    """
    before, after = _lengths(recording.rate_hz)
    if recording.length <= before + after:
        samples = recording.samples(0, recording.length)
        return tuple(
            Stretches((recording.stretch(channel, 0, own),), 0)
            for channel, own in enumerate(samples)
        )
    found, loudest = _onsets(recording, after)
    return tuple(
        _stretches(recording, channel, own, loud)
        for channel, (own, loud) in enumerate(zip(found, loudest, strict=True))
    )


def _stretches(
    recording: Recording, channel: int, onsets: list[Onset], loudest: int
) -> Stretches:
    """Return the stretches about the loud ones of a channel's onsets."""
    before, after = _lengths(recording.rate_hz)
    peak = max((onset.peak for onset in onsets), default=0.0)
    loud = [onset for onset in onsets if onset.peak >= QUIETER * peak]
    loud = sorted(sorted(loud, key=lambda onset: -onset.peak)[:MAX_ONSETS])
    begins = [onset.sample for onset in loud]
    if not any(0 <= loudest - begin < after for begin in begins):
        begins = sorted([*begins, loudest])  # nothing quiet before it
    records = []
    for at in begins:
        start = min(max(at - before, 0), recording.length - before - after)
        records.append(recording.record(channel, start, start + before + after))
    return Stretches(tuple(records), len(onsets) - len(loud))


def _lengths(rate_hz: float) -> tuple[int, int]:
    """Return how many samples of a stretch come before its onset, and after it."""
    least = MIN_SAMPLES / (BEFORE_S + AFTER_S)
    return round(BEFORE_S * max(rate_hz, least)), round(AFTER_S * max(rate_hz, least))


class _Channel:
    """State of one channel from block to block."""

    def __init__(self):
        self.onsets: list[Onset] = []
        self.mean = 0.0
        self.largest, self.loudest = 0.0, 0


def _onsets(recording: Recording, after: int) -> tuple[list[list[Onset]], list[int]]:
    """Return each channel's onsets, a stretch apart, and where it is loudest."""
    size = max(BIN_SAMPLES, round(BIN_S * recording.rate_hz))
    carry = np.zeros((len(recording.names), 0))
    channels = [_Channel() for _ in recording.names]
    first = 0  # sample that the carried ones begin at
    for start, block in recording.blocks():
        samples = np.concatenate([carry, block], axis=1)
        bins = samples.shape[1] // size
        for channel, own in zip(channels, samples, strict=True):
            _take_in(channel, own[: bins * size], first, size, after)
            size_of = np.abs(own - own.mean())
            at = int(np.argmax(size_of))
            if size_of[at] > channel.largest:
                channel.largest, channel.loudest = float(size_of[at]), first + at
        keep = (LONG_BINS + SHORT_BINS - 1) * size + samples.shape[1] - bins * size
        carry = samples[:, max(samples.shape[1] - keep, 0) :]
        first = start + block.shape[1] - carry.shape[1]
    return [one.onsets for one in channels], [one.loudest for one in channels]


def _take_in(
    channel: _Channel,
    samples: Float[np.ndarray, " sample"],
    first: int,
    size: int,
    after: int,
) -> None:
    """Enter a block's onsets, the first of each stretch."""
    ratio, means = _ratios(samples.reshape(-1, size))
    for nth in np.flatnonzero(ratio > ON):
        at = first + (LONG_BINS + int(nth)) * size
        if channel.onsets and at < channel.onsets[-1].sample + after:
            continue
        _follow(channel, samples, first, after)
        channel.onsets.append(Onset(at, float(ratio[nth]), 0.0))
        channel.mean = float(means[nth])
    _follow(channel, samples, first, after)


def _follow(
    channel: _Channel, samples: Float[np.ndarray, " sample"], first: int, after: int
) -> None:
    """Enter how loud it was after a channel's last onset, as far as a block goes."""
    if not channel.onsets:
        return
    last = channel.onsets[-1]
    since = samples[max(last.sample - first, 0) : max(last.sample + after - first, 0)]
    peak = float(np.abs(since - channel.mean).max(initial=last.peak))
    channel.onsets[-1] = last._replace(peak=peak)


def _ratios(
    bins: Float[np.ndarray, "bin sample"],
) -> tuple[Float[np.ndarray, " end"], Float[np.ndarray, " end"]]:
    """Return the power after each bin over that before it, and the mean before it."""
    if len(bins) < LONG_BINS + SHORT_BINS:
        return np.zeros(0), np.zeros(0)
    middle = float(bins.mean())  # or squares of an offset would hide all else
    sums = np.cumsum(bins.sum(axis=1) - bins.shape[1] * middle)
    squares = np.cumsum(((bins - middle) ** 2).sum(axis=1))
    sums, squares = (np.concatenate([[0.0], total]) for total in (sums, squares))
    ends = np.arange(LONG_BINS, len(bins) - SHORT_BINS + 1)
    n_before, n_after = LONG_BINS * bins.shape[1], SHORT_BINS * bins.shape[1]
    sum_before = sums[ends] - sums[ends - LONG_BINS]
    mean = sum_before / n_before
    before = (squares[ends] - squares[ends - LONG_BINS]) / n_before - mean**2
    power = (squares[ends + SHORT_BINS] - squares[ends]) / n_after
    shift = (sums[ends + SHORT_BINS] - sums[ends]) / n_after
    # about the mean before: a step of the baseline is loud, too
    now = power - 2.0 * mean * shift + mean**2
    # after silence what is heard is loud, but what rounding leaves of it is not
    floor = SILENT * squares[-1] / bins.size
    ratio = now / np.maximum(before, floor) if floor > 0 else np.zeros_like(now)
    return ratio, mean + middle
