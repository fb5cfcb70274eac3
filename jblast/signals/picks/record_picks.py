r"""Picks of recordings of any length and rate, with quality and notes.

Quality and notes are findings of the fit; their sentences are in `report`.

Walls, trees, or a microphone's own filter and gain control may distort a blast so that
no pulse fits it, but its onset can be picked. The samples up to the largest are divided
into two intervals of noise, each with its own variance; the most probable division is
the onset (Maeda 1985, a picker by Akaike's criterion):

$$\mathrm{AIC}(k) = k \ln s^2_{[0, k)} + (n - k) \ln s^2_{[k, n)}$$

and $e^{-\mathrm{AIC}/2}$ is the probability of a division there. This holds for
independent samples. Those of a record are correlated, so the standard deviation is at
least half of the time from the onset to half of the largest size.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from jblast.observations.records.recording import PressureRecord
from jblast.results import Note, warning
from jblast.signals.picks.evidence import UNEXPLAINED
from jblast.signals.picks.pick import (
    NoteKind,
    Pick,
    Quality,
    check_samples,
    picked,
)
from jblast.signals.picks.preparation import LONGEST

SHARE_BEFORE_LARGEST = 0.25
"""Share of the picked samples before the largest one, in a record longer than
`LONGEST`: enough for the noise, with most left for the tail and a possible
high-pass."""
NO_PULSE = {"misfit", "front_alone"}
"""Notes of records that are not the form of a pulse."""
EARLIER_SD = 1.0
"""Lead of an onset over a front, in their standard deviations, from which on the signal
began before the front; that of an onset is rather too large."""
QUIET_SAMPLES = 32
"""Smallest number of samples before an onset: their variance then has a relative error
of 25 %, small against the ratios below."""
ONSET_SNR = 10.0
"""Smallest ratio of the largest sample to the standard deviation of the quiet ones.
Noise does not reach it; gusts and bumps of a stand may, hence the next one."""
ONSET_ROUGHNESS = 3.0
"""Smallest ratio of the rms difference of neighbouring samples behind an onset to that
before it: a drift grows large without becoming rougher."""


@dataclass(frozen=True)
class RecordPick:
    """The pick of a recording.

    Attributes:
        record: The recording.
        pick: Its pulse, on the recorder's clock.
    """

    record: PressureRecord
    pick: Pick

    @property
    def quality(self) -> Quality:
        """Good, doubtful or poor."""
        return self.pick.quality

    @property
    def notes(self) -> tuple[NoteKind, ...]:
        """Kinds of the reasons of the quality and of other findings."""
        return self.pick.notes

    @property
    def findings(self) -> tuple[Note, ...]:
        """The same with their numbers, as warnings."""
        pick, has_scale = self.pick, self.record.calibrated
        numbers = {
            "clipped_at_pa": pick.clipped_at_pa,
            "resonance_hz": pick.resonance_hz,
            "misfit": pick.misfit,
            "later_arrival_s": pick.later_arrival_s,
        }
        without = {} if has_scale else {"clipped": "clipped_uncalibrated"}
        return tuple(warning(without.get(k, k), **numbers) for k in self.notes)


def pick_records(records: Sequence[PressureRecord]) -> list[RecordPick]:
    """Return the pick of each recording.

    Without a scale in pascals, peak and impulse are in the samples' own unit, and only
    times are meaningful. Records of mostly negative pressure are picked with reversed
    sign, too. If no pulse fits a record that becomes loud suddenly, the arrival is its
    onset (`onset_of`) and all other values are NaN.

    Args:
        records: The recordings.

    Raises:
        InputError: One of them has too few samples, or one that is not finite.
    """
    for record in records:
        check_samples(f"{record.source or record.name}: {record.name}", record.samples)
    return [RecordPick(record, _pick(record)) for record in records]


def _pick(record: PressureRecord) -> Pick:
    """Return the pick of the samples about the largest, of either sign."""
    begin = _stretch_begin(record)
    samples = np.asarray(record.samples[begin : begin + LONGEST], float)
    start_s = record.start_s + begin / record.rate_hz
    pick = _of_sign(record, samples, start_s, turned=False)
    apart = samples - np.median(samples)
    if pick.quality == "good" or -apart.min() <= apart.max():
        return pick
    # a sensor of reversed polarity records a blast as a fall of the pressure; a step or
    # a drift that falls is none, and no pulse explains it
    other = _of_sign(record, -samples, start_s, turned=True)
    if other.pulse is None or other.quality == "poor" or other.misfit > UNEXPLAINED:
        return pick
    fits = pick.quality != "poor" and pick.pulse is not None
    if fits and pick.misfit <= other.misfit:
        return pick
    return replace(other, notes=(*other.notes, "reversed_polarity"))


def _of_sign(
    record: PressureRecord,
    samples: Float[np.ndarray, " sample"],
    start_s: float,
    turned: bool,
) -> Pick:
    """Return the pick of samples; of those that are no pulse the onset alone."""
    step_s = 1.0 / record.rate_hz
    pick = picked(
        samples,
        start_s,
        step_s,
        full_scale=record.full_scale,
        high_pass_hz=record.high_pass_hz,
    )
    if pick.quality != "poor" and not (turned or NO_PULSE & set(pick.notes)):
        return pick
    onset = onset_of(samples)
    if onset is None:
        return pick
    # the front of a record that is no pulse is its arrival if nothing came before
    before = pick.air_arrival_s - (start_s + step_s * onset.sample)
    apart = EARLIER_SD * np.hypot(pick.sds[0], step_s * onset.sigma)
    if pick.quality != "poor" and before < apart:
        return pick
    alone = Pick(
        ("onset_alone",),
        pick.noise_pa,
        baseline_pa=float(samples[: int(onset.sample)].mean()),
        air_arrival_s=start_s + step_s * onset.sample,
    )
    alone.sds[0] = step_s * onset.sigma
    alone.covariance[0, 0] = alone.sds[0] ** 2
    return alone


def _stretch_begin(record: PressureRecord) -> int:
    """Return the first sample of the interval that is picked."""
    spare = record.samples.size - LONGEST
    if spare <= 0:
        return 0
    largest = int(np.argmax(np.abs(record.samples - np.median(record.samples))))
    return int(np.clip(largest - int(SHARE_BEFORE_LARGEST * LONGEST), 0, spare))


class Onset(NamedTuple):
    """Onset of a record, in samples.

    Attributes:
        sample: First sample of the louder interval.
        sigma: Its standard deviation [samples].
    """

    sample: float
    sigma: float


def onset_of(samples: Float[np.ndarray, " sample"]) -> Onset | None:
    """Return the onset of a sudden loud signal; None without one.

    Args:
        samples: Samples in any unit, finite.
    """
    apart = np.abs(samples - np.median(samples))
    largest = int(np.argmax(apart))
    if largest < 2 * QUIET_SAMPLES or apart[largest] == 0.0:
        return None
    split, sigma = _most_probable_split(samples[: largest + 1] / apart[largest])
    before = samples[:split]
    half = split + int(np.argmax(apart[split : largest + 1] >= 0.5 * apart[largest]))
    rough = np.sqrt(np.mean(np.square(np.diff(before))))
    rougher = np.sqrt(
        np.mean(np.square(np.diff(samples[split - 1 : 2 * half - split + 2])))
    )
    # the quiet mean, not the median, is zero: a loud record moves its median
    size = np.max(np.abs(samples[split : largest + 1] - before.mean()))
    if size < ONSET_SNR * before.std() or rougher < ONSET_ROUGHNESS * rough:
        return None
    # correlated samples make the probability too narrow: at least half of the time up
    # to half of the largest size; 0.3 samples is 1/sqrt(12), a uniform density
    return Onset(float(split), float(np.hypot(sigma, max(0.5 * (half - split), 0.3))))


def _most_probable_split(x: Float[np.ndarray, " sample"]) -> tuple[int, float]:
    """Return the most probable first sample of the second interval, and its error."""
    n = x.size
    k = np.arange(QUIET_SAMPLES, n - 1)
    sums, squares = np.cumsum(x), np.cumsum(np.square(x))
    # a silent interval has no variance, whose logarithm must be finite
    least = np.finfo(x.dtype).eps
    first = squares[k - 1] / k - np.square(sums[k - 1] / k)
    rest = n - k
    second = (squares[-1] - squares[k - 1]) / rest - np.square(
        (sums[-1] - sums[k - 1]) / rest
    )
    aic = k * np.log(np.maximum(first, least)) + rest * np.log(
        np.maximum(second, least)
    )
    # relative to the minimum, as exp of thousands underflows
    weight = np.exp(-0.5 * (aic - aic.min()))
    mean = np.average(k, weights=weight)
    spread = np.sqrt(np.average(np.square(k - mean), weights=weight))
    return int(k[np.argmin(aic)]), float(spread)
