"""Rows that name a record of samples, in place of them what is read off it."""

from collections.abc import Sequence
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import NamedTuple

import equinox as eqx
import numpy as np

from jblast.errors import InputError, argument, shown
from jblast.inference.picks import RecordPick
from jblast.inference.records.covariance import TOLD, covariance_of, log_value
from jblast.inference.records.gathered import gathered
from jblast.observations import Observations, some_rows
from jblast.observations.grouping import stacked
from jblast.observations.records.formats import Scaling
from jblast.observations.table import CLOCK_TIMES, SAMPLES
from jblast.progress import each


class PickedLog(NamedTuple):
    """A log of readings alone.

    Attributes:
        observations: Four rows in place of each that names a record of samples.
        picks: Of the samples, by what the log calls them.
    """

    observations: Observations
    picks: tuple[tuple[str, RecordPick], ...]


def picked_log(
    observations: Observations,
    scaling: Scaling | None = None,
    *,
    high_pass_hz: float | None = None,
    faults: list[InputError] | None = None,
) -> PickedLog:
    """Pick the records that a log names; one without any is returned as it is.

    Args:
        observations: The log.
        scaling: What the user says of the recorders' scale.
        high_pass_hz: Corner of their first-order high-pass [Hz].
        faults: Where given, a row that is refused is left out and its error put there.

    Raises:
        InputError: A row names no file, one that another row names, or one that cannot
            be read, holds no blast, or is not in pascals.
    """
    sampled = np.flatnonzero(np.isin(observations.quantity, SAMPLES))
    if not sampled.size:
        return PickedLog(observations, ())
    picks: list[RecordPick] = []
    rows: list[int] = []
    for row in each(sampled.tolist(), "records"):
        try:
            picks.append(_pick(observations, row, scaling, high_pass_hz))
        except InputError as fault:
            if faults is None:
                raise
            faults.append(fault)
        else:
            rows.append(row)
    epoch = observations.epoch
    try:
        epoch, picks = _on_one_clock(observations, picks)
    except InputError as fault:
        if faults is None:
            raise
        faults.append(fault)
        picks, rows = [], []
    names = [observations.records()[row] for row in rows]
    others = np.setdiff1d(np.arange(len(observations)), sampled)
    # where nothing is left, a log of no row all the same
    parts = [some_rows(observations, others)] if others.size or not rows else []
    parts += [
        _rows(observations, row, one) for row, one in zip(rows, picks, strict=True)
    ]
    covariances = tuple(
        covariance_of(one, name, TOLD) for name, one in zip(names, picks, strict=True)
    )
    joined = replace(
        _joined(observations, parts),
        covariances=observations.covariances + covariances,
        epoch=epoch,
    )
    return PickedLog(joined, tuple(zip(names, picks, strict=True)))


def _pick(
    observations: Observations,
    row: int,
    scaling: Scaling | None,
    high_pass_hz: float | None,
) -> RecordPick:
    """Return the loudest bang of a row's file, on the clock of the log."""
    where = f"{observations.where(row)}, column record"
    name = observations.records()[row]
    if not name or observations.records().count(name) > 1:
        got = f"{shown(name)} in another row, too" if name else "nothing"
        raise InputError(f"{where}: expected a file of samples of its own, got {got}")
    file = Path(observations.source).parent / name
    found = gathered([file], scaling, high_pass_hz=high_pass_hz)
    if found.refused:
        raise InputError(f"{where}: {found.refused[0]}")
    sensor = observations.sensor[row]
    channels = {one.record.name for one in found.picks}
    mine = [
        one
        for one in found.picks
        if len(channels) == 1 or one.record.name in (sensor, f"{file.stem}.{sensor}")
    ]
    if not mine:
        got = f"channels {', '.join(sorted(channels))}" if channels else "no blast"
        raise InputError(f"{where}: expected a blast of {shown(sensor)}, got {got}")
    fitted = [one for one in mine if "onset_alone" not in one.notes]
    if all(one.quality == "poor" for one in fitted):
        raise InputError(
            f"{where}: expected a record that a pulse fits, got {shown(name)}, whose "
            "pick is poor; take the row out"
        )
    one = max(fitted, key=lambda one: float(one.pick.peak_overpressure_pa))
    if not one.record.calibrated:
        raise InputError(
            f"{where}: expected samples in pascals, got {shown(name)} in a unit that "
            f"nobody said: {argument('full_scale')} of WAV and FLAC, "
            f"{argument('sensitivity')} of counts"
        )
    return one


def _on_one_clock(
    observations: Observations, picks: list[RecordPick]
) -> tuple[datetime | None, list[RecordPick]]:
    """Return picks whose times count from the log's time zero, and when that was.

    Raises:
        InputError: Some files tell the time of day they began at, and others do not.
    """
    epochs = [one.record.epoch for one in picks if one.record.epoch is not None]
    if not epochs:
        return observations.epoch, picks
    silent = [one.record.source for one in picks if one.record.epoch is None]
    if not silent and observations.epoch is None:
        timed = set(observations.quantity) & set(CLOCK_TIMES)
        silent = [f"{observations.source or 'observations'}, column value"] * bool(
            timed
        )
    if silent:
        raise InputError(
            f"{silent[0]}: expected a time of day, as records of the log tell it; got "
            "seconds alone"
        )
    zero = observations.epoch or min(epochs)
    moved = []
    for one in picks:
        later = ((one.record.epoch or zero) - zero).total_seconds()
        record = replace(one.record, epoch=zero, start_s=one.record.start_s + later)
        arrival = one.pick.air_arrival_s + later
        pick = eqx.tree_at(lambda pick: pick.air_arrival_s, one.pick, arrival)
        moved.append(replace(one, record=record, pick=pick))
    return zero, moved


def _rows(observations: Observations, row: int, one: RecordPick) -> Observations:
    """Return the rows that are read off a record, placed as its own."""
    same = some_rows(observations, np.full(len(TOLD), row))
    bound = bool(one.pick.lower_bound)
    value, sigma = zip(*(log_value(one, name) for name in TOLD), strict=True)
    return replace(
        same,
        quantity=TOLD,
        value=np.array(value),
        sigma=np.array(sigma),
        lower_bound=np.array([bound and "peak" in name for name in TOLD]),
    )


def _joined(observations: Observations, parts: Sequence[Observations]) -> Observations:
    """Put rows of one log together again."""
    columns = stacked(parts)
    if not columns["lower_bound"].any():
        columns["lower_bound"] = None
    return replace(observations, **columns)
