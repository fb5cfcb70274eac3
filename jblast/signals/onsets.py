"""Onsets in a recording of any length: intervals that may contain a blast.

An onset is a large ratio of the power of a few milliseconds to that of the half second
before them (STA/LTA, Allen 1978), about the mean of that half second. Samples are read
block by block, and four numbers of each bin are stored. The result is an interval of
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
ROUNDING_SHARE = 1e-10
"""Share of a channel's mean power below which differences of running sums can be
rounding: of an hour, 4e-11."""
MAX_ONSETS = 16
"""Largest number of onsets of a channel, of which the loudest are kept: bounds the time
spent on a channel of continuous impulsive noise."""


class Onset(NamedTuple):
    """A sudden rise of the power of a channel.

    Attributes:
        sample: First sample, to the precision of a bin.
        peak: Largest deviation of a sample from the mean before, in the interval after.
    """

    sample: int
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
        channels = range(len(recording.names))
        return tuple(Stretches((recording.record(one),), 0) for one in channels)
    bins = [_Bins(recording.rate_hz) for _ in recording.names]
    for _, block in recording.blocks():
        for channel, samples in zip(bins, block, strict=True):
            channel.add(samples)
    return tuple(
        _stretches(recording, channel, *found.onsets(after))
        for channel, found in enumerate(bins)
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


class _Bins:
    """Sum, sum of squares, smallest and largest sample of each bin of a channel.

    Sums are about the first sample: the squares of a large offset would cost digits.
    """

    def __init__(self, rate_hz: float):
        self._size = max(BIN_SAMPLES, round(BIN_S * rate_hz))
        self._parts: list[np.ndarray] = []
        self._left = np.zeros(0)
        self._middle: float | None = None

    def add(self, samples: Float[np.ndarray, " sample"]) -> None:
        """Add the next samples; an incomplete bin waits for its end."""
        if self._middle is None:
            self._middle = float(samples[0])
        row = np.concatenate([self._left, samples - self._middle])
        whole = row.size - row.size % self._size
        bins, self._left = row[:whole].reshape(-1, self._size), row[whole:]
        parts = bins.sum(axis=1), (bins**2).sum(axis=1), bins.min(axis=1)
        self._parts.append(np.array([*parts, bins.max(axis=1)]))

    def onsets(self, after: int) -> tuple[list[Onset], int]:
        """Return the onsets, at least `after` samples apart, and the loudest sample."""
        sums, squares, low, high = np.concatenate(self._parts, axis=1)
        middle = sums.sum() / (sums.size * self._size)
        loudest = int(np.argmax(np.maximum(high - middle, middle - low))) * self._size
        total, power = (np.append(0.0, np.cumsum(row)) for row in (sums, squares))
        ends = np.arange(LONG_BINS, sums.size - SHORT_BINS + 1)
        if not ends.size or not power[-1] > 0:
            return [], loudest
        n_before, n_after = LONG_BINS * self._size, SHORT_BINS * self._size
        mean = (total[ends] - total[ends - LONG_BINS]) / n_before
        quiet = (power[ends] - power[ends - LONG_BINS]) / n_before - mean**2
        loud = (power[ends + SHORT_BINS] - power[ends]) / n_after
        shift = (total[ends + SHORT_BINS] - total[ends]) / n_after
        # about the mean before, so that a step of the baseline counts as power
        now = loud - 2.0 * mean * shift + mean**2
        # after digital silence any sound is an onset, but not the rounding of the sums
        floor = ROUNDING_SHARE * power[-1] / (sums.size * self._size)
        ratio = now / np.maximum(quiet, floor)
        found: list[Onset] = []
        for nth in np.flatnonzero(ratio > ON):
            at = int(ends[nth])
            if found and at * self._size < found[-1].sample + after:
                continue
            since = slice(at, at + -(-after // self._size))
            peak = max(high[since].max() - mean[nth], mean[nth] - low[since].min())
            found.append(Onset(at * self._size, float(peak)))
        return found, loudest
