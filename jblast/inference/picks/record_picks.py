"""Picks of recordings, many at a time, whatever their lengths and rates."""

import dataclasses
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Float

from jblast.errors import InputError
from jblast.inference.picks.in_units import filled_length, picks_of
from jblast.inference.picks.onset import onset_of
from jblast.inference.picks.pick import LEAST_SAMPLES
from jblast.inference.picks.quality import NoteKind, Quality, notes_of, quality_of
from jblast.inference.picks.result import IN_LOG, NAMES, Pick
from jblast.observations.records.recording import PressureRecord

LONGEST = 65536
"""Of a record of more samples the stretch about its largest one is picked."""

BEFORE = 0.25
"""Share of that stretch that lies before the largest sample."""


@dataclass(frozen=True)
class RecordPick:
    """What was picked of a recording.

    Attributes:
        record: The recording.
        pick: Its pulse, on the recorder's clock; every array without a batch.
        quality: How far it may be trusted.
        notes: Why, and what else was seen.
    """

    record: PressureRecord
    pick: Pick
    quality: Quality
    notes: tuple[NoteKind, ...]


def pick_records(
    records: Sequence[PressureRecord], *, turn: bool = True
) -> list[RecordPick]:
    """Return the pick of each recording.

    Where nobody said what a sample is in pascals, peak and impulse are in the samples'
    own unit, and only the times mean something. Of a record that is suddenly loud and
    that no pulse fits, the arrival is its onset (`onset.py`) and all else NaN.

    Args:
        records: The recordings.
        turn: Whether a record whose pressure falls most is picked upside down, too.

    Raises:
        InputError: One of them has too few samples, or one that is not finite.
    """
    groups: dict[tuple[int, bool], list[int]] = defaultdict(list)
    for place, record in enumerate(records):
        _check(record)
        groups[_length(record), record.high_pass_hz is not None].append(place)
    found: dict[int, Pick] = {}
    for (length, passed), places in groups.items():
        found |= _picked([records[i] for i in places], places, length, passed)
    made = [
        RecordPick(record, found[i], quality_of(found[i]), notes_of(found[i]))
        for i, record in enumerate(records)
    ]
    if not turn:
        return made
    # a sensor wired the other way round records a blast as a fall of the pressure
    falls = [k for k, one in enumerate(made) if one.quality != "good" and _falls(one)]
    turned = [
        dataclasses.replace(made[k].record, samples=-made[k].record.samples)
        for k in falls
    ]
    for k, other in zip(falls, pick_records(turned, turn=False), strict=True):
        if _better(other, made[k]):
            notes: tuple[NoteKind, ...] = (*other.notes, "reversed_polarity")
            made[k] = RecordPick(made[k].record, other.pick, "doubtful", notes)
    return made


def _falls(one: RecordPick) -> bool:
    """Return whether the largest deviation of a record is below its median."""
    apart = one.record.samples - np.median(one.record.samples)
    return bool(-apart.min() > apart.max())


def _better(other: RecordPick, one: RecordPick) -> bool:
    """Return whether a pulse fits a record better turned over than as it is."""
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
    """Return the picks of records that are filled up to one length."""
    begins = [_begin(record, length) for record in records]
    cut = [
        record.samples[begin : begin + length]
        for record, begin in zip(records, begins, strict=True)
    ]
    filled = np.stack([_filled(x, length) for x in cut])
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
        np.array([record.full_scale or np.nan for record in records]),
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


def _began(
    pick: Pick, samples: Float[np.ndarray, " sample"], start: float, step: float
) -> Pick:
    """Return the onset of a record that no pulse fits, and nothing else."""
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


def _length(record: PressureRecord) -> int:
    """Return the length that a record is filled up to."""
    return filled_length(min(record.samples.size, LONGEST))


def _begin(record: PressureRecord, length: int) -> int:
    """Return the first sample of the stretch that is picked."""
    spare = record.samples.size - length
    if spare <= 0:
        return 0
    largest = int(np.argmax(np.abs(record.samples - np.median(record.samples))))
    return int(np.clip(largest - int(BEFORE * length), 0, spare))


def _filled(samples: Float[np.ndarray, " sample"], length: int):
    """Return samples and then the last one again."""
    return np.pad(samples, (0, length - samples.size), mode="edge")


def _check(record: PressureRecord) -> None:
    """Refuse what cannot be picked, by name."""
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
