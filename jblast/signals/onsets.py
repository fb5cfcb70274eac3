"""Onsets in a recording of any length: intervals that may contain a blast.

An onset is a large ratio of the power of a few milliseconds to that of the half second
before them (STA/LTA, Allen 1978), about the mean of that half second, in bins and block
by block: a recording of any length takes constant memory. The result is an interval of
equal length about each onset. The fit of a pulse decides if it contains a blast
(`picks`).
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from jblast.observations.records.recording import PressureRecord, Recording

SHORT_BINS, LONG_BINS = 5, 500
"""Windows after and before an onset, conventions: 5 ms, the order of the positive phase
of 1 kg, and a hundred times as long, so that its scatter is a tenth."""
ON = 10.0
"""Least ratio of powers of an onset, a convention: stationary noise rarely reaches
10 dB."""
BIN_S, BIN_SAMPLES = 0.001, 4
"""Length of a bin [s], and the smallest number of samples of one: the power of fewer
scatters by more than its mean, so slow recorders have longer bins."""
BEFORE_S, AFTER_S = 0.5, 1.5
"""Interval before and after an onset [s], with at least `MIN_SAMPLES` samples: quiet
enough to measure the noise, and a tail many times the duration of a blast."""
MIN_SAMPLES = 4096
"""Smallest number of samples of an interval, a quarter of them before the onset: enough
for a pulse and its noise at the low rates of barographs."""
LEAST_PEAK_SHARE = 0.1
"""Smallest peak of an onset, over that of the loudest (20 dB down): weaker ones are
mostly echoes and rattle, each at the cost of a pick."""
ROUNDING_SHARE = 1e-12
"""Share of a block's power below which differences of running sums are rounding."""
MAX_ONSETS = 16
"""Largest number of onsets of a channel, of which the loudest are kept: bounds the time
spent on a channel of continuous impulsive noise."""


class Onset(NamedTuple):
    """A sudden rise of the power of a channel.

    Attributes:
        sample: First sample, to the precision of a bin.
        ratio: Power after over power before.
        peak: Largest deviation of a sample from the mean before, in the interval after.
    """

    sample: int
    ratio: float
    peak: float


class Stretches(NamedTuple):
    """Intervals of a channel that may contain a blast.

    Attributes:
        records: Intervals of equal length, in order of time.
        quieter: Number of onsets left out: 20 dB below the loudest, or beyond the
            `MAX_ONSETS` loudest.
    """

    records: tuple[PressureRecord, ...]
    quieter: int


def stretches(recording: Recording) -> tuple[Stretches, ...]:
    """Return the intervals of each channel; of a short recording, all of it.

    The loudest sample of a channel is always within one: a record that begins with the
    blast has nothing quiet before it, and no onset.

    Raises:
        InputError: A sample is not finite.
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
    """Return the intervals about the loudest of a channel's onsets."""
    before, after = _lengths(recording.rate_hz)
    peak = max((onset.peak for onset in onsets), default=0.0)
    loud = [onset for onset in onsets if onset.peak >= LEAST_PEAK_SHARE * peak]
    loud = sorted(sorted(loud, key=lambda onset: -onset.peak)[:MAX_ONSETS])
    begins = [onset.sample for onset in loud]
    # a blast at the beginning of a recording has no onset: nothing is quiet before it
    if not any(0 <= loudest - begin < after for begin in begins):
        begins = sorted([*begins, loudest])
    records = []
    for at in begins:
        start = min(max(at - before, 0), recording.length - before - after)
        records.append(recording.record(channel, start, start + before + after))
    return Stretches(tuple(records), len(onsets) - len(loud))


def _lengths(rate_hz: float) -> tuple[int, int]:
    """Return the number of samples of an interval before its onset, and after it."""
    least = MIN_SAMPLES / (BEFORE_S + AFTER_S)
    return round(BEFORE_S * max(rate_hz, least)), round(AFTER_S * max(rate_hz, least))


class _Channel:
    """State of one channel between blocks."""

    def __init__(self):
        self.onsets: list[Onset] = []
        self.mean = 0.0
        self.largest, self.loudest = 0.0, 0


def _onsets(recording: Recording, after: int) -> tuple[list[list[Onset]], list[int]]:
    """Return each channel's onsets, at least `after` apart, and its loudest sample."""
    size = max(BIN_SAMPLES, round(BIN_S * recording.rate_hz))
    carry = np.zeros((len(recording.names), 0))
    channels = [_Channel() for _ in recording.names]
    # number of the first carried sample
    first = 0
    for start, block in recording.blocks():
        samples = np.concatenate([carry, block], axis=1)
        bins = samples.shape[1] // size
        for channel, own in zip(channels, samples, strict=True):
            _take_in(channel, own[: bins * size], first, size, after)
            size_of = np.abs(own - own.mean())
            at = int(np.argmax(size_of))
            if size_of[at] > channel.largest:
                channel.largest, channel.loudest = float(size_of[at]), first + at
        # the last windows of a block need samples of the next one, and are carried
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
    """Add the onsets of a block, the first of each interval."""
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
    """Update the peak of a channel's last onset by the samples of a block."""
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
    # relative to the mean: the squares of a large offset would cost the digits
    middle = float(bins.mean())
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
    # about the mean before, so that a step of the baseline counts as power
    now = power - 2.0 * mean * shift + mean**2
    # after digital silence any sound is an onset, but not the rounding of the sums
    floor = ROUNDING_SHARE * squares[-1] / bins.size
    ratio = now / np.maximum(before, floor) if floor > 0 else np.zeros_like(now)
    return ratio, mean + middle
