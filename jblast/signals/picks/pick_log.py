"""Picks as rows of a log.

Quantities that a record does not identify have no row, and are reported: those that a
note of the pick withholds (`pick.NOTES`), peak and impulse of samples without a scale,
and all of a poor pick. The rows of a pick share its covariance.

A row of a log may also name a record; `picked_log` replaces it by rows of its pick.
"""

from collections.abc import Mapping, Sequence, Set
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from datetime import datetime
from itertools import chain
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
from jblast.signals.detection import Detection
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


def log_of(found: Gathered, stations: Mapping[str, Station] | None = None) -> PickLog:
    """Return the rows of a log.

    Picks at several stations belong to one event if their time differences are at most
    the travel time of sound between the stations; of several at one station the loudest
    does. Without stations the events of a channel are numbered in order.

    Args:
        found: Picks.
        stations: Stations by name of the sensor.

    Raises:
        InputError: Files without a time of day did not begin together.
    """
    names = found.named()
    shots, weaker = _shots(found, stations)
    unplaced = Station((np.nan, np.nan, np.nan), "")
    frame, parts, independent = None, [], []
    left_out = [LeftOut(names[at], RECORD_QUANTITIES, "weaker") for at in weaker]
    for at, shot in shots.items():
        one = found.picks[at]
        station = (stations or {}).get(one.record.name, unplaced)
        place = observed(
            [one.record.name],
            [SAMPLES],
            [np.nan],
            [np.nan],
            position=np.array([station.position]),
            shot=(shot,),
            clock=(station.clock,),
            record=(names[at],),
        )
        rows, gone = rows_of(one, place)
        parts.append(rows)
        frame = frame or station.frame
        left_out += [LeftOut(names[at], lost, reason) for reason, lost in gone.items()]
        if not rows.covariances and np.sum(~rows.bounds()) > 1:
            independent.append(names[at])
    log = _joined(observed([], [], [], [], epoch=found.epoch, frame=frame), parts)
    count = len(set(shots.values()))
    return PickLog(log, tuple(left_out), count, tuple(independent))


def rows_of(
    one: RecordPick, place: Observations
) -> tuple[Observations, dict[Reason, tuple[str, ...]]]:
    """Return the rows of a pick with their covariance, and lost quantities by reason.

    Args:
        one: The pick.
        place: One row with the sensor, its place and the name of the record.
    """
    kept, gone = kept_quantities(one)
    values = np.array([log_value(one, quantity) for quantity in kept]).reshape(-1, 2)
    bound = np.array([one.pick.lower_bound and name == PEAK for name in kept], bool)
    covariances = ()
    if np.sum(~bound) > 1:
        with suppress(ValueError):  # not positive definite
            covariances = (covariance_of(one, place.records()[0], kept),)
    rows = replace(
        some_rows(place, np.zeros(len(kept), int)),
        quantity=kept,
        value=values[:, 0],
        sigma=values[:, 1],
        lower_bound=bound,
        covariances=covariances,
    )
    return rows, gone


def _joined(log: Observations, parts: Sequence[Observations]) -> Observations:
    """Return a log with further rows and covariances."""
    columns = stacked([log, *parts])
    if not columns["lower_bound"].any():
        columns["lower_bound"] = None
    covariances = [log.covariances, *(part.covariances for part in parts)]
    return replace(log, covariances=tuple(chain(*covariances)), **columns)


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
    sampled = np.isin(observations.quantity, SAMPLES)
    if not sampled.any():
        return observations
    picks: dict[int, RecordPick] = {}
    placed: dict[int, RecordPick] = {}
    epoch = observations.epoch
    for row in each(np.flatnonzero(sampled).tolist(), "records"):
        with _collected(faults):
            picks[row] = _pick(observations, row, scaling, high_pass_hz)
    with _collected(faults):
        epoch, placed = _on_one_clock(observations, picks)
    parts = [
        rows_of(one, some_rows(observations, np.array([row])))[0]
        for row, one in placed.items()
    ]
    others = some_rows(observations, np.flatnonzero(~sampled))
    return replace(_joined(others, parts), epoch=epoch)


@contextmanager
def _collected(faults: list[InputError] | None):
    """Append an error to a list, if there is one."""
    try:
        yield
    except InputError as fault:
        if faults is None:
            raise
        faults.append(fault)


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
    if all(one.quality == "poor" for one in mine):
        raise InputError(
            f"{where}: expected a record of a blast pulse, got {shown(name)}, whose "
            "pick is poor; remove the row"
        )
    # an onset alone has no peak, which makes it weaker than any pulse
    one = max(mine, key=lambda one: float(np.nan_to_num(one.pick.peak_overpressure_pa)))
    if not one.record.calibrated:
        raise InputError(
            f"{where}: expected samples in pascals, got {shown(name)} without a unit; "
            f"add {argument('full_scale_pa')} for WAV and FLAC, "
            f"{argument('sensitivity')} for counts"
        )
    return one


def _on_one_clock(
    observations: Observations, picks: dict[int, RecordPick]
) -> tuple[datetime | None, dict[int, RecordPick]]:
    """Return the UTC of the log's time zero, and picks whose times count from it.

    Raises:
        InputError: Only some of the files have a time of day.
    """
    records = [one.record for one in picks.values()]
    epochs = [record.epoch for record in records if record.epoch is not None]
    if not epochs:
        return observations.epoch, picks
    undated = [record.source for record in records if record.epoch is None]
    if observations.epoch is None and set(observations.quantity) & set(CLOCK_TIMES):
        undated.append(f"{observations.source or 'observations'}, column value")
    if undated:
        raise InputError(
            f"{undated[0]}: expected times of day, as in the records of the log; got "
            "seconds only"
        )
    # the log's own epoch, since its other readings count from it
    zero = observations.epoch or min(epochs)
    moved = {}
    for (row, one), epoch in zip(picks.items(), epochs, strict=True):
        arrival = one.pick.air_arrival_s + (epoch - zero).total_seconds()
        moved[row] = replace(one, pick=replace(one.pick, air_arrival_s=arrival))
    return zero, moved


def log_value(one: RecordPick, quantity: str) -> tuple[float, float]:
    """Return value and sigma; for a clipped peak the clipping level and the noise."""
    if quantity == PEAK and one.pick.lower_bound:
        return one.pick.clipped_at_pa - one.pick.baseline_pa, one.pick.noise_pa
    return getattr(one.pick, quantity), one.pick.sd(quantity)


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
    bound = {PEAK} if one.pick.lower_bound else set()
    names = tuple(name for name in quantities if name not in bound)
    at = [RECORD_QUANTITIES.index(name) for name in names]
    matrix = one.pick.covariance[np.ix_(at, at)]
    return RecordCovariance(record, names, 0.5 * (matrix + matrix.T))


@dataclass(frozen=True)
class PickedValue:
    """A value and its standard deviation, in its unit.

    Attributes:
        value: The value.
        sd: Its standard deviation.
    """

    value: float
    sd: float


def picked_value(one: RecordPick, name: str) -> PickedValue | None:
    """Return a value of a pick with its standard deviation.

    The result is None for pressures and impulses of samples without a scale, and for
    values other than the arrival if only the onset was picked.

    Args:
        one: The pick of one record.
        name: One of `NAMES`.
    """
    value = getattr(one.pick, name)
    unscaled = name in IN_PASCALS and not one.record.calibrated
    return (
        None if unscaled or np.isnan(value) else PickedValue(value, one.pick.sd(name))
    )
