"""Picks as rows of a log.

Quantities that a record does not identify have no row, and are reported: those that a
note of the pick withholds (`pick.NOTES`), peak and impulse of samples without a scale,
and all of a poor pick. The rows of a pick share its covariance.

A row of a log may also name a record; `picked_log` replaces it by rows of its pick.
"""

from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from jblast.errors import InputError, argument, shown
from jblast.observations import Observations, observed, some_rows
from jblast.observations.records.formats import Scaling
from jblast.observations.records.stations import Station
from jblast.observations.table import (
    RECORD_QUANTITIES,
    SAMPLES,
    RecordCovariance,
    stacked,
)
from jblast.progress import each
from jblast.quantities import CLOCK_TIMES
from jblast.signals.arrays import bangs
from jblast.signals.matched_filter import Detection
from jblast.signals.picks.gathered import Gathered, gathered
from jblast.signals.picks.pick import NOTES, NoteKind
from jblast.signals.picks.record_picks import RecordPick

_, PEAK, DURATION, IMPULSE = RECORD_QUANTITIES
Reason = Literal["poor", "uncalibrated", "weaker"] | NoteKind
"""Reasons why quantities have no row: a poor pick, samples without a scale, a weaker
one than another pick of the same event at the same sensor, or a note."""
IN_PASCALS = ("peak_overpressure_pa", "positive_impulse_pa_s", "negative_pressure_pa")
"""Values that samples without a scale do not identify."""


@dataclass(frozen=True)
class LeftOut:
    """Quantities of a pick that have no row.

    Attributes:
        record: Name of the pick's record.
        quantities: Quantities without a row.
        reason: Reason.
    """

    record: str
    quantities: tuple[str, ...]
    reason: Reason


class PickLog(NamedTuple):
    """Rows of a log.

    Attributes:
        observations: The rows.
        left_out: Quantities without a row.
        bangs: Number of events.
        independent: Records whose errors are taken as independent, because their
            covariance is not positive definite.
    """

    observations: Observations
    left_out: tuple[LeftOut, ...]
    bangs: int
    independent: tuple[str, ...] = ()


class _Row(NamedTuple):
    sensor: str
    quantity: str
    value: float
    sigma: float
    is_bound: bool
    shot: str
    record: str


def log_of(
    found: Gathered,
    stations: Mapping[str, Station] | None = None,
    comments: Sequence[str] = (),
) -> PickLog:
    """Return the rows of a log.

    Picks at several stations belong to one event if their time differences are at most
    the travel time of sound between the stations; of several at one station the loudest
    does. Without stations the events of a channel are numbered in order.

    Args:
        found: Picks.
        stations: Stations by name of the sensor.
        comments: Provenance.

    Raises:
        InputError: Files without a time of day did not begin together.
    """
    names = found.named()
    shots, weaker = _shots(found, stations)
    rows: list[_Row] = []
    covariances: list[RecordCovariance] = []
    independent: list[str] = []
    left_out = [LeftOut(names[at], RECORD_QUANTITIES, "weaker") for at in weaker]
    for at, shot in shots.items():
        one = found.picks[at]
        kept, gone = kept_quantities(one)
        left_out += [LeftOut(names[at], lost, reason) for reason, lost in gone.items()]
        made = [_row(one, quantity, shot, names[at]) for quantity in kept]
        rows += made
        shared = _covariances(one, names[at], kept)
        covariances += shared
        if not shared and sum(not row.is_bound for row in made) > 1:
            independent.append(names[at])
    count = len(set(shots.values()))
    observations = _observations(rows, found, stations, comments)
    observations = replace(observations, covariances=tuple(covariances))
    return PickLog(observations, tuple(left_out), count, tuple(independent))


def kept_quantities(
    one: RecordPick,
) -> tuple[tuple[str, ...], dict[Reason, tuple[str, ...]]]:
    """Return the quantities of a pick that a log gets, and the others by reason."""
    withheld: dict[Reason, Set[str]] = {}
    if one.quality == "poor":
        withheld["poor"] = frozenset(RECORD_QUANTITIES)
    if not one.record.calibrated:
        withheld["uncalibrated"] = frozenset({PEAK, DURATION, IMPULSE})
    withheld |= {kind: NOTES[kind].withheld for kind in one.notes}
    kept, gone = RECORD_QUANTITIES, {}
    for reason, lost in withheld.items():
        if mine := tuple(quantity for quantity in kept if quantity in lost):
            gone[reason] = mine
            kept = tuple(quantity for quantity in kept if quantity not in mine)
    return kept, gone


def _row(one: RecordPick, quantity: str, shot: str, record: str) -> _Row:
    """Return the row of one quantity of a pick."""
    value, sigma = log_value(one, quantity)
    is_bound = quantity == PEAK and one.pick.lower_bound
    return _Row(one.record.name, quantity, value, sigma, is_bound, shot, record)


def _shots(
    found: Gathered, stations: Mapping[str, Station] | None
) -> tuple[dict[int, str], list[int]]:
    """Return the shot of each pick, and the picks weaker than another of their shot.

    Raises:
        InputError: Files without a time of day did not begin together.
    """
    shots: dict[int, str] = {}
    weaker: list[int] = []
    for folder in dict.fromkeys(one.record.shot for one in found.picks):
        at_all = [n for n, one in enumerate(found.picks) if one.record.shot == folder]
        if stations is None:
            numbers = {at: found.orders[at] for at in at_all}
        else:
            numbers, left = _grouped(found, at_all, stations)
            weaker += left
        several = len(set(numbers.values())) > 1
        for at, number in numbers.items():
            parts = [folder] * bool(folder) + [str(number)] * several
            shots[at] = ".".join(parts)
    return dict(sorted(shots.items())), sorted(weaker)


def _grouped(
    found: Gathered, at_all: list[int], stations: Mapping[str, Station]
) -> tuple[dict[int, int], list[int]]:
    """Return the number of the event of each pick, and the weaker picks."""
    arrivals: dict[str, list[Detection]] = {}
    at_of: dict[tuple[str, Detection], int] = {}
    for at in at_all:
        one = found.picks[at]
        name = one.record.name
        when, peak = one.pick.air_arrival_s, one.pick.peak_overpressure_pa
        # an onset alone has no peak: zero makes it weaker than any pulse
        arrival = Detection(float(when), 0.0, 0.0, float(np.nan_to_num(peak)))
        arrivals.setdefault(name, []).append(arrival)
        at_of[name, arrival] = at
    positions = {name: stations[name].position for name in arrivals}
    # recorders with clocks of their own have no common times to group by
    one_bang = len({stations[name].clock for name in arrivals}) > 1
    grouped = bangs(arrivals, positions, one=one_bang)
    sources = [
        {found.picks[at_of[key]].record.source for key in bang.items()}
        for bang in grouped.heard
    ]
    undated = found.epoch is None and not found.triggered
    if undated and len(sources) > 1 and all(len(of) == 1 for of in sources):
        files = sorted(set[str]().union(*sources))
        if len(files) > 1:
            raise InputError(
                f"{', '.join(files[:2])}: expected arrivals of one blast, got times "
                "further apart than sound travels between the sensors; the files do "
                "not state when they begin: add the time of the first sample of each "
                "to column start_utc of the table of stations, or give each recorder "
                "a name in column clock, or pick the files separately"
            )
    numbers = {
        at_of[key]: number
        for number, bang in enumerate(grouped.heard, start=1)
        for key in bang.items()
    }
    return numbers, [at_of[key] for key in grouped.left_out]


def _observations(
    rows: Sequence[_Row],
    found: Gathered,
    stations: Mapping[str, Station] | None,
    comments: Sequence[str],
) -> Observations:
    unplaced = Station((np.nan, np.nan, np.nan), "")
    placed = [(stations or {}).get(row.sensor, unplaced) for row in rows]
    positions = np.array([station.position for station in placed])
    return observed(
        [row.sensor for row in rows],
        [row.quantity for row in rows],
        [row.value for row in rows],
        [row.sigma for row in rows],
        position=positions.reshape(len(rows), 3),
        shot=tuple(row.shot for row in rows),
        clock=tuple(station.clock for station in placed),
        comments=tuple(comments),
        lower_bound=np.array([row.is_bound for row in rows], bool),
        frame=next((s.frame for s in placed if s.frame is not None), None),
        epoch=found.epoch,
        record=tuple(row.record for row in rows),
    )


def picked_log(
    observations: Observations,
    scaling: Scaling | None = None,
    *,
    high_pass_hz: float | None = None,
    faults: list[InputError] | None = None,
) -> Observations:
    """Pick the records that a log names; a log without any is returned unchanged.

    Args:
        observations: The log.
        scaling: Scale of the recorders.
        high_pass_hz: Corner of their first-order high-pass [Hz].
        faults: If given, a row with a fault is left out and its error appended here.

    Raises:
        InputError: A row names no file or one that another row names, or the file
            cannot be read, contains no blast, or is not in pascals.
    """
    sampled = np.flatnonzero(np.isin(observations.quantity, SAMPLES))
    if not sampled.size:
        return observations
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
    others = np.setdiff1d(np.arange(len(observations)), sampled)
    # `stacked` needs at least one part, so a log without rows has an empty one
    parts = [some_rows(observations, others)] if others.size or not rows else []
    covariances = observations.covariances
    for row, one in zip(rows, picks, strict=True):
        kept, _ = kept_quantities(one)
        parts.append(_rows(observations, row, one, kept))
        covariances += _covariances(one, observations.records()[row], kept)
    return replace(_joined(observations, parts), covariances=covariances, epoch=epoch)


def _pick(
    observations: Observations,
    row: int,
    scaling: Scaling | None,
    high_pass_hz: float | None,
) -> RecordPick:
    """Return the loudest blast of a row's file, on the clock of the log."""
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
        if len(channels) == 1
        or {one.record.name, *one.record.aliases} & {sensor, f"{file.stem}.{sensor}"}
    ]
    if not mine:
        got = f"channels {', '.join(sorted(channels))}" if channels else "no blast"
        raise InputError(f"{where}: expected a blast of {shown(sensor)}, got {got}")
    fitted = [one for one in mine if "onset_alone" not in one.notes]
    if all(one.quality == "poor" for one in fitted):
        raise InputError(
            f"{where}: expected a record of a blast pulse, got {shown(name)}, whose "
            "pick is poor; remove the row"
        )
    one = max(fitted, key=lambda one: float(one.pick.peak_overpressure_pa))
    if not one.record.calibrated:
        raise InputError(
            f"{where}: expected samples in pascals, got {shown(name)} without a unit; "
            f"add {argument('full_scale_pa')} for WAV and FLAC, "
            f"{argument('sensitivity')} for counts"
        )
    return one


def _on_one_clock(
    observations: Observations, picks: list[RecordPick]
) -> tuple[datetime | None, list[RecordPick]]:
    """Return the UTC of the log's time zero, and picks whose times count from it.

    Raises:
        InputError: Only some of the files have a time of day.
    """
    epochs = [one.record.epoch for one in picks if one.record.epoch is not None]
    if not epochs:
        return observations.epoch, picks
    undated = [one.record.source for one in picks if one.record.epoch is None]
    if not undated and observations.epoch is None:
        timed = set(observations.quantity) & set(CLOCK_TIMES)
        undated = [f"{observations.source or 'observations'}, column value"] * bool(
            timed
        )
    if undated:
        raise InputError(
            f"{undated[0]}: expected times of day, as in the records of the log; got "
            "seconds only"
        )
    # the log's own epoch, since its other readings count from it
    zero = observations.epoch or min(epochs)
    moved = []
    for one in picks:
        later = ((one.record.epoch or zero) - zero).total_seconds()
        record = replace(one.record, epoch=zero, start_s=one.record.start_s + later)
        arrival = one.pick.air_arrival_s + later
        pick = replace(one.pick, air_arrival_s=arrival)
        moved.append(RecordPick(record, pick))
    return zero, moved


def _rows(
    observations: Observations, row: int, one: RecordPick, kept: Sequence[str]
) -> Observations:
    """Return the rows of a record's readings, with the position of its row."""
    same = some_rows(observations, np.full(len(kept), row))
    bound = one.pick.lower_bound
    value, sigma = zip(*(log_value(one, name) for name in kept), strict=True)
    return replace(
        same,
        quantity=tuple(kept),
        value=np.array(value),
        sigma=np.array(sigma),
        lower_bound=np.array([bound and name == PEAK for name in kept]),
    )


def _joined(observations: Observations, parts: Sequence[Observations]) -> Observations:
    """Return a log with the rows of several parts of it."""
    columns = stacked(parts)
    if not columns["lower_bound"].any():
        columns["lower_bound"] = None
    return replace(observations, **columns)


def log_value(one: RecordPick, quantity: str) -> tuple[float, float]:
    """Return value and sigma; for a clipped peak the clipping level and the noise."""
    if quantity == PEAK and one.pick.lower_bound:
        return one.pick.clipped_at_pa - one.pick.baseline_pa, one.pick.noise_pa
    return getattr(one.pick, quantity), one.pick.sd(quantity)


def _covariances(
    one: RecordPick, record: str, kept: Sequence[str]
) -> tuple[RecordCovariance, ...]:
    """Return the covariance of a pick's rows, if they have one."""
    if len(kept) - (one.pick.lower_bound and PEAK in kept) < 2:
        return ()
    try:
        return (covariance_of(one, record, kept),)
    except ValueError:  # not positive definite
        return ()


def covariance_of(
    one: RecordPick, record: str, quantities: Sequence[str]
) -> RecordCovariance:
    """Return the covariance of the errors of a pick's rows.

    A peak that is a lower bound is left out: its error is the noise of one sample.

    Args:
        one: The pick.
        record: Name of its record in the log.
        quantities: Quantities of its rows.

    Raises:
        ValueError: The covariance is not positive definite.
    """
    bound = one.pick.lower_bound
    names = tuple(
        name
        for name in RECORD_QUANTITIES
        if name in quantities and not (bound and name == "peak_overpressure_pa")
    )
    at = [RECORD_QUANTITIES.index(name) for name in names]
    matrix = one.pick.covariance[np.ix_(at, at)]
    return RecordCovariance(record, names, 0.5 * (matrix + matrix.T))


class PickEstimate(NamedTuple):
    """A value and its standard deviation, in its unit."""

    value: float
    sd: float


def pick_estimate(one: RecordPick, name: str) -> PickEstimate | None:
    """Return a value of a pick with its standard deviation.

    The result is None for pressures and impulses of samples without a scale, and for
    values other than the arrival if only the onset was picked.

    Args:
        one: The pick of one record.
        name: One of `NAMES`.
    """
    if name in IN_PASCALS and not one.record.calibrated:
        return None
    value = getattr(one.pick, name)
    return None if np.isnan(value) else PickEstimate(value, one.pick.sd(name))
