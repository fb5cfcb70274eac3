r"""Picks of recordings of any length and rate, with quality and notes.

Quality and notes are findings of the fit; their wording is in `report`.

Walls, trees, or a microphone's own filter and gain control may distort a blast so that
no pulse fits it, but its onset can be picked. The samples up to the largest are divided
into two intervals of noise, each with its own variance; the most probable division is
the onset (Maeda 1985, a picker by Akaike's criterion):

$$\mathrm{AIC}(k) = k \ln s^2_{[0, k)} + (n - k) \ln s^2_{[k, n)}$$

and $e^{-\mathrm{AIC}/2}$ is the probability of a division there. This holds for
independent samples. Those of a record are correlated, so the standard deviation is at
least half of the time from the onset to half of the largest size.
"""

import dataclasses
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Float

from jblast.errors import InputError
from jblast.observations.records.recording import PressureRecord
from jblast.signals.picks.lanes import HOPELESS_MISFIT, MISFIT_AGAIN, SLIGHT_RESIDUAL
from jblast.signals.picks.pick import (
    IN_LOG,
    LEAST_SAMPLES,
    NAMES,
    Pick,
    filled_length,
    picks_of,
)
from jblast.signals.picks.unknowns import CONTINUED

LONGEST_STRETCH = 65536
"""Largest number of samples that are picked; of a longer record, these are about its
largest sample. They cover 1.3 s at 48 kHz, many times the duration of a blast, and
bound the memory and the number of programs (one for each power of two)."""
SHARE_BEFORE_LARGEST = 0.25
"""Share of them before the largest sample: enough for the noise, with most left for the
tail and a possible high-pass."""
Quality = Literal["good", "doubtful", "poor"]
NoteKind = Literal[
    "nothing_found",
    "onset_alone",
    "not_converged",
    "clipped",
    "misfit",
    "few_quiet_samples",
    "under_sampled",
    "sharp_front",
    "cut_short",
    "drifting",
    "curved_baseline",
    "resonating",
    "high_passed",
    "later_arrival",
    "zero_shift",
    "front_alone",
    "reversed_polarity",
    "duration_unsure",
    "faint",
    "continued_decay",
]
"""Kinds of notes on a pick."""
POOR_NOTES = frozenset({"nothing_found", "not_converged"})
HARMLESS_NOTES = frozenset(
    {"sharp_front", "drifting", "later_arrival", "continued_decay"}
)
"""Notes whose effects are within the errors; any other makes a pick doubtful."""
UNSURE_DURATION = 0.2
"""Standard deviation of ln duration from which on a pick is doubtful. A 90 % interval
then spans a factor of 1.9, which hardly constrains a charge."""
FAINT_PEAK_SD = 0.1
"""Standard deviation of ln peak from which on a pulse is noted as faint: a signal to
noise ratio of about ten, where steps of coloured noise may be taken for the front."""
QUIET_SAMPLES = 32
"""Smallest number of samples before an onset: their variance then has a relative error
of 25 %, small against the ratios below."""
ONSET_SNR = 10.0
"""Smallest ratio of the largest sample to the standard deviation of the quiet ones.
Noise does not reach it; gusts and bumps of a stand may, hence the next one."""
ONSET_ROUGHNESS = 3.0
"""Smallest ratio of the rms difference of neighbouring samples behind an onset to that
before it: a drift grows large without becoming rougher."""

FLAT_SAMPLES = 8
"""Smallest number of equal samples in a row at the maximum that are clipped below full
scale. Noise of a few codes makes three or four; a shorter flat top is left to the fit,
which tries a clipped one if no pulse fits (`lanes`)."""
FLAT_RATIO = 4.0
"""Smallest ratio of the number of samples at the maximum to that at the next value: in
a pulse of few codes, as of 8 bits, both are about equal."""


@dataclass(frozen=True)
class RecordPick:
    """The pick of a recording.

    Attributes:
        record: The recording.
        pick: Its pulse, on the recorder's clock; arrays without a batch axis.
        quality: Good, doubtful or poor.
        notes: Reasons of the quality and other findings.
    """

    record: PressureRecord
    pick: Pick
    quality: Quality
    notes: tuple[NoteKind, ...]


def pick_records(
    records: Sequence[PressureRecord], *, turn: bool = True, least_length: int = 0
) -> list[RecordPick]:
    """Return the pick of each recording.

    Without a scale in pascals, peak and impulse are in the samples' own unit, and only
    times are meaningful. If no pulse fits a record that becomes loud suddenly, the
    arrival is its onset (`onset_of`) and all other values are NaN.

    Args:
        records: The recordings.
        turn: True to pick records of mostly negative pressure with reversed sign, too.
        least_length: Smallest length to which records are padded [samples].

    Raises:
        InputError: One of them has too few samples, or one that is not finite.
    """
    groups: dict[tuple[int, bool], list[int]] = defaultdict(list)
    for place, record in enumerate(records):
        _check(record)
        # records of one padded length share a compiled program
        size = max(record.samples.size, least_length)
        length = filled_length(min(size, LONGEST_STRETCH))
        groups[length, record.high_pass_hz is not None].append(place)
    found: dict[int, Pick] = {}
    for (length, passed), places in groups.items():
        found |= _picked([records[i] for i in places], places, length, passed)
    made = [
        RecordPick(record, found[i], quality_of(found[i]), notes_of(found[i]))
        for i, record in enumerate(records)
    ]
    if not turn:
        return made
    # a sensor of reversed polarity records a blast as a fall of the pressure
    falls = [k for k, one in enumerate(made) if one.quality != "good" and _falls(one)]
    turned = [
        dataclasses.replace(made[k].record, samples=-made[k].record.samples)
        for k in falls
    ]
    others = pick_records(turned, turn=False, least_length=least_length)
    for k, other in zip(falls, others, strict=True):
        if _better(other, made[k]):
            notes: tuple[NoteKind, ...] = (*other.notes, "reversed_polarity")
            made[k] = RecordPick(made[k].record, other.pick, "doubtful", notes)
    return made


def _falls(one: RecordPick) -> bool:
    """Return True if the largest deviation of a record is below its median."""
    apart = one.record.samples - np.median(one.record.samples)
    return bool(-apart.min() > apart.max())


def _better(other: RecordPick, one: RecordPick) -> bool:
    """Return True if a pulse fits a record better with reversed polarity."""
    if other.quality == "poor" or not other.pick.found or "onset_alone" in other.notes:
        return False
    if one.quality == "poor" or not one.pick.found or "onset_alone" in one.notes:
        return True
    return float(other.pick.misfit) < float(one.pick.misfit)


def _picked(
    records: list[PressureRecord],
    places: list[int],
    length: int,
    high_passed: bool,
) -> dict[int, Pick]:
    """Return the picks of records that are padded to one length."""
    begins = [stretch_begin(record, length) for record in records]
    cut = [
        record.samples[begin : begin + length]
        for record, begin in zip(records, begins, strict=True)
    ]
    filled = np.stack([np.pad(x, (0, length - x.size), mode="edge") for x in cut])
    corners = (
        np.array([(record.high_pass_hz or 0.0) / record.rate_hz for record in records])
        if high_passed
        else None
    )
    step = np.array([1.0 / record.rate_hz for record in records])
    start = np.array([record.start_s for record in records]) + np.array(begins) * step
    many = picks_of(
        filled.astype(jax.dtypes.canonicalize_dtype(float)),
        np.array([x.size for x in cut]),
        start,
        step,
        np.array([clipping_level(record) for record in records]),
        corners,
    )
    many = jax.tree.map(np.asarray, many)
    picks = [jax.tree.map(lambda x, k=k: x[k], many) for k in range(len(places))]
    return {
        place: pick
        if quality_of(pick) != "poor"
        else _began(pick, samples, float(first), float(each))
        for place, pick, samples, first, each in zip(
            places, picks, cut, start, step, strict=True
        )
    }


def clipping_level(record: PressureRecord) -> float:
    """Return the absolute value at which samples are clipped; NaN if unknown.

    An amplifier may clip below the full scale of the converter.
    """
    if not record.full_scale:
        return np.nan
    samples, top = record.samples, float(record.samples.max())
    flat = samples == top
    if not 0 < top < record.full_scale or flat.all():
        return record.full_scale
    below = samples == samples[~flat].max()
    ends = np.flatnonzero(np.diff(flat, prepend=False, append=False))
    longest = int((ends[1::2] - ends[::2]).max())
    clipped = longest >= FLAT_SAMPLES and flat.sum() > FLAT_RATIO * below.sum()
    return top if clipped else record.full_scale


def _began(
    pick: Pick, samples: Float[np.ndarray, " sample"], start: float, step: float
) -> Pick:
    """Return a pick of the onset alone, for a record that no pulse fits."""
    onset = onset_of(samples)
    if onset is None:
        return pick
    sigma = step * onset.sigma
    spread, covariance = np.full(8, np.nan), np.full((IN_LOG, IN_LOG), np.nan)
    spread[0], covariance[0, 0] = sigma, sigma**2
    known = (
        np.array(start + step * onset.sample),
        *(np.array(np.nan) for _ in NAMES[1:]),
        spread,
        covariance,
        np.array(True),
        np.array(samples[: int(onset.sample)].mean()),
    )
    return eqx.tree_at(
        lambda p: (
            *(getattr(p, name) for name in NAMES),
            p.spread,
            p.covariance,
            p.found,
            p.baseline_pa,
        ),
        pick,
        known,
    )


def stretch_begin(record: PressureRecord, length: int) -> int:
    """Return the first sample of the interval that is picked.

    Args:
        record: The recording.
        length: Samples of the interval; a shorter recording is picked whole.
    """
    spare = record.samples.size - length
    if spare <= 0:
        return 0
    largest = int(np.argmax(np.abs(record.samples - np.median(record.samples))))
    return int(np.clip(largest - int(SHARE_BEFORE_LARGEST * length), 0, spare))


def _check(record: PressureRecord) -> None:
    """Raise an error for a record that is too short or not finite."""
    name = record.source or record.name
    if record.samples.size < LEAST_SAMPLES:
        raise InputError(
            f"{name}: {record.name}: expected {LEAST_SAMPLES} samples or more, got "
            f"{record.samples.size}"
        )
    bad = np.flatnonzero(~np.isfinite(record.samples))
    if bad.size:
        raise InputError(
            f"{name}: {record.name}: expected finite samples, got "
            f"{record.samples[bad[0]]} at sample {bad[0]} and {bad.size - 1} more"
        )


def notes_of(pick: Pick) -> tuple[NoteKind, ...]:
    """Return the notes on the pick of one record."""
    if not bool(pick.found):
        return ("nothing_found",)
    if np.isnan(pick.peak_overpressure_pa):
        return ("onset_alone",)
    spread = np.asarray(pick.spread)
    conditions: dict[NoteKind, bool] = {
        "not_converged": not bool(pick.converged),
        "clipped": bool(np.isfinite(pick.clipped_at_pa)),
        "misfit": float(pick.misfit) > MISFIT_AGAIN,
        "few_quiet_samples": not bool(pick.noise_known),
        "under_sampled": bool(pick.under_sampled),
        "sharp_front": bool(pick.sharp),
        "cut_short": bool(pick.cut_short),
        "drifting": bool(pick.drifting),
        "curved_baseline": bool(pick.curving),
        "resonating": bool(pick.resonating),
        "high_passed": bool(pick.high_passed),
        "later_arrival": bool(np.any(np.isfinite(pick.later_arrivals_s))),
        "zero_shift": bool(pick.shifted),
        "front_alone": bool(pick.front_alone),
        # "not less than" also holds for NaN
        "duration_unsure": not spread[2] < UNSURE_DURATION,
        "faint": not spread[1] < FAINT_PEAK_SD,
        "continued_decay": bool(pick.form.negative == CONTINUED)
        and bool(spread[6] < UNSURE_DURATION),
    }
    return tuple(kind for kind, holds in conditions.items() if holds)


def quality_of(pick: Pick) -> Quality:
    """Return the quality of the pick of one record."""
    notes = set(notes_of(pick))
    if "onset_alone" in notes:
        return "doubtful"
    if notes & POOR_NOTES or hopeless(pick):
        return "poor"
    return "doubtful" if notes - HARMLESS_NOTES else "good"


def hopeless(pick: Pick) -> bool:
    """Return True if the model explains next to nothing of the record."""
    left = np.sqrt(float(pick.misfit)) * float(pick.noise_pa)
    slight = left < SLIGHT_RESIDUAL * abs(float(pick.peak_overpressure_pa))
    return float(pick.misfit) > HOPELESS_MISFIT and not slight


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
