"""Picks of files of samples, and picks as rows of a log.

Each blast of each channel is picked, in batches. A file that cannot be used is reported
and does not stop the others.

Quantities that a record does not identify have no row, and are reported: those that a
note of the pick withholds (`pick.NOTES`), peak and impulse of samples without a scale,
and all of a poor pick. The rows of a pick share its covariance.

A row of a log may also name a record; `picked_log` replaces it by rows of its pick.
"""

from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from jblast.errors import InputError, argument, shown
from jblast.observations import Observations, observed, some_rows
from jblast.observations.grouping import stacked
from jblast.observations.records.formats import Scaling, open_record
from jblast.observations.records.recording import PressureRecord, Recording
from jblast.observations.records.stations import Station, started
from jblast.observations.table import RECORD_QUANTITIES, SAMPLES, RecordCovariance
from jblast.progress import each
from jblast.quantities import CLOCK_TIMES
from jblast.signals.arrays import bangs
from jblast.signals.matched_filter import Detection
from jblast.signals.onsets import LEAST_PEAK_SHARE, Stretches, stretches
from jblast.signals.picks.pick import LEAST_SAMPLES, NOTES, NoteKind
from jblast.signals.picks.record_picks import RecordPick, pick_records

BATCH_SAMPLES = 2**22
"""Samples that are read before they are picked, 32 MB in double precision: a folder of
any size needs bounded memory."""
MAX_PRESSURE_PA = 1e9
"""Largest range of a record's samples [Pa]. The largest pressure of a blast in air is
that of the reflection at the charge: 0.4 to 0.7 GPa, where the curves of Kingery and
Bulmash begin (Z = 0.067 m/kg^(1/3)). A sensitivity given as its reciprocal is off by
more than a factor of a million."""
_, PEAK, DURATION, IMPULSE = RECORD_QUANTITIES
Reason = Literal["poor", "uncalibrated", "weaker"] | NoteKind
"""Reasons why quantities have no row: a poor pick, samples without a scale, a weaker
one than another pick of the same event at the same sensor, or a note."""
IN_PASCALS = ("peak_overpressure_pa", "positive_impulse_pa_s", "negative_pressure_pa")
"""Values that samples without a scale do not identify."""


class Gathered(NamedTuple):
    """Picks of files of samples.

    Attributes:
        picks: Picks in the order of files, channels and time.
        orders: Number of each within its channel, from 1.
        silent: Names of channels without a pick.
        quieter: Number of onsets by channel that were skipped, more than 20 dB below
            the loudest.
        refused: Errors of files that could not be read.
        epoch: UTC of time zero of all picks; None if no file states it.
        channels: Number of channels read; segments between gaps are one channel.
    """

    picks: tuple[RecordPick, ...]
    orders: tuple[int, ...]
    silent: tuple[str, ...]
    quieter: dict[str, int]
    refused: tuple[InputError, ...]
    epoch: datetime | None
    channels: int

    def named(self) -> tuple[str, ...]:
        """Return the name of each pick's record; of several in a channel name#order."""
        names = [one.record.name for one in self.picks]
        return tuple(
            name if names.count(name) == 1 else f"{name}#{order}"
            for name, order in zip(names, self.orders, strict=True)
        )


def gathered(
    files: Sequence[Path],
    scaling: Scaling | None = None,
    *,
    high_pass_hz: float | None = None,
    keep_samples: bool = True,
    stations: Mapping[str, Station] | None = None,
) -> Gathered:
    """Read files and pick their blasts.

    Files share the clock of the first one if they, or their stations, state the time of
    day of the first sample.

    Args:
        files: Files of records.
        scaling: Scale of the recorders.
        high_pass_hz: Corner of their first-order high-pass [Hz].
        keep_samples: True to keep the samples in the picks, for figures.
        stations: Stations by name of record, for their `start`.
    """
    reading = _Reading(files, scaling, high_pass_hz, stations or {})
    found: list[RecordPick] = []
    picked: set[str] = set()
    for batch in _batches(reading):
        for one in pick_records(batch):
            if not one.pick.found:
                continue
            picked.add(one.record.name)
            if not keep_samples:
                empty = replace(one.record, samples=np.zeros(0))
                one = replace(one, record=empty)
            found.append(one)
    return Gathered(
        picks=tuple(found),
        orders=_orders([one.record.name for one in found]),
        silent=tuple(name for name in reading.channels if name not in picked),
        quieter=reading.quieter,
        refused=tuple(reading.refused),
        epoch=reading.epoch,
        channels=len(reading.channels),
    )


class _Reading:
    """Iterator over the records of files, with the findings to be reported."""

    def __init__(
        self,
        files: Sequence[Path],
        scaling: Scaling | None,
        high_pass_hz: float | None,
        stations: Mapping[str, Station],
    ):
        self.files, self.scaling, self.high_pass_hz = files, scaling, high_pass_hz
        self.stations = stations
        self.channels: list[str] = []
        self.quieter: dict[str, int] = {}
        self.refused: list[InputError] = []
        self.epoch: datetime | None = None
        # source of the first recording, and whether its clock was set
        self._first: tuple[str, bool] | None = None

    def __iter__(self) -> Iterator[PressureRecord]:
        """Yield intervals with a signal, those of a channel in order of time."""
        seen: set[str] = set()
        for file in each(self.files, "records"):
            try:
                if file.stem in seen:
                    raise InputError(
                        f"{file}: expected records with different names, got "
                        f"{file.stem} twice"
                    )
                recordings = _long_enough(open_record(file, self.scaling))
                begin = min(one.start_s for one in recordings)
                recordings = [
                    self._timed(one, one.start_s - begin) for one in recordings
                ]
                runs = [(one, stretches(one)) for one in recordings]
                for one, channels in runs:
                    _check_scale(one, channels, self.scaling)
            except InputError as error:
                self.refused.append(error)
                continue
            seen.add(file.stem)
            by_channel: dict[str, list[Stretches]] = {}
            for recording, channels in runs:
                for name, channel in zip(recording.names, channels, strict=True):
                    by_channel.setdefault(name, []).append(channel)
            for name, segments in by_channel.items():
                self.channels.append(name)
                records, quieter = _loud(segments)
                if quieter:
                    self.quieter[name] = quieter
                for record in records:
                    # a constant interval is a dead channel, not a quiet one
                    if np.ptp(record.samples) > 0:
                        yield replace(record, high_pass_hz=self.high_pass_hz)

    def _timed(self, recording: Recording, later_s: float) -> Recording:
        """Return a recording on the clock of the first.

        Args:
            recording: The recording.
            later_s: Time from the first sample of the file to that of the recording
                [s].

        Raises:
            InputError: Only one of the two has a time of day, or one was made by a
                clock that was not set and is not that of its station.
        """
        recording = started(recording, self.stations, later_s)
        if self._first is None:
            self.epoch = recording.epoch
            self._first = recording.source, recording.clock_is_set
        first, first_is_set = self._first
        remedy = (
            "add the time of the first sample of each file without one to column "
            "start_utc of the table of stations, or pick the files separately"
        )
        if (self.epoch is None) != (recording.epoch is None):
            one, other = "a time of day", "none"
            if recording.epoch is None:
                one, other = other, one
            unset = "" if recording.clock_is_set else ", as its clock was not set"
            raise InputError(
                f"{recording.source}: expected a start at {other}, as in "
                f"{first}, got {one}{unset}; {remedy}"
            )
        own_clock = all(
            name in self.stations and self.stations[name].clock
            for name in recording.names
        )
        if recording.source != first and not (
            own_clock or (recording.clock_is_set and first_is_set)
        ):
            raise InputError(
                f"{recording.source}: expected a start on the clock of {first}, "
                f"got a clock that was not set; {remedy}, or name the clock of each "
                "recorder in column clock"
            )
        if self.epoch is None or recording.epoch is None:
            return recording
        later = (recording.epoch - self.epoch).total_seconds()
        start = recording.start_s + later
        return replace(recording, epoch=self.epoch, start_s=start)


def _check_scale(
    recording: Recording, channels: Sequence[Stretches], scaling: Scaling | None
) -> None:
    """Raise an error for pressures that no blast has.

    Raises:
        InputError: The range of samples in pascals exceeds `MAX_PRESSURE_PA`.
    """
    if not recording.calibrated:
        return
    largest = max(
        (np.ptp(one.samples) for channel in channels for one in channel.records),
        default=0.0,
    )
    if largest <= MAX_PRESSURE_PA:
        return
    remedy = "check the unit and the scale of the samples"
    if scaling is not None and scaling.sensitivity is not None:
        remedy = (
            f"{argument('sensitivity')} is in pascals per volt or count: write "
            f"{1 / scaling.sensitivity:.6g} if {scaling.sensitivity:g} is in volts or "
            "counts per pascal"
        )
    raise InputError(
        f"{recording.source}: expected pressures below {MAX_PRESSURE_PA / 1e9:g} GPa, "
        f"more than a blast in air has at the charge, got {largest / 1e9:.4g} GPa; "
        f"{remedy}"
    )


def _long_enough(recordings: Sequence[Recording]) -> list[Recording]:
    """Return the recordings that may contain a pulse and the noise before it.

    Short segments of a channel with longer ones are left out.

    Raises:
        InputError: All segments of a channel are too short.
    """
    long = [one for one in recordings if one.length >= LEAST_SAMPLES]
    names = {one.names for one in long}
    for one in recordings:
        if one.names not in names:
            raise InputError(
                f"{one.source}: {one.labels[0]}: expected {LEAST_SAMPLES} samples or "
                f"more, got {one.length}"
            )
    return long


def _loud(segments: Sequence[Stretches]) -> tuple[list[PressureRecord], int]:
    """Return the intervals of a channel to pick, and the number of quieter onsets.

    Each segment between gaps has an interval about its loudest sample, which may be
    noise next to another segment.
    """
    records = [record for one in segments for record in one.records]
    quieter = sum(one.quieter for one in segments)
    if len(segments) == 1:
        return records, quieter
    sizes = [np.abs(one.samples - np.median(one.samples)).max() for one in records]
    loud = [
        record
        for record, size in zip(records, sizes, strict=True)
        if size >= LEAST_PEAK_SHARE * max(sizes)
    ]
    return loud, quieter + len(records) - len(loud)


def _batches(records: _Reading) -> Iterator[list[PressureRecord]]:
    """Yield records in batches of at least `BATCH_SAMPLES` samples."""
    batch, samples = [], 0
    for record in records:
        batch.append(record)
        samples += record.samples.size
        if samples >= BATCH_SAMPLES:
            yield batch
            batch, samples = [], 0
    if batch:
        yield batch


def _orders(names: list[str]) -> tuple[int, ...]:
    """Return the number of each among those of its name, from 1."""
    count: dict[str, int] = {}
    orders = []
    for name in names:
        count[name] = count.get(name, 0) + 1
        orders.append(count[name])
    return tuple(orders)


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
        InputError: A channel has no station.
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
        together = [row.quantity for row in made if not row.is_bound]
        if len(together) > 1:
            try:
                covariances.append(covariance_of(one, names[at], together))
            # not positive definite, as at an optimum at the edge of a sample
            except ValueError:
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
    """Return the shot of each pick, and the picks weaker than another of their shot."""
    if stations is None:
        several = len(set(found.orders)) > 1
        orders = enumerate(found.orders)
        return {at: str(order) if several else "" for at, order in orders}, []
    records = {one.record.name: one.record.source for one in found.picks}
    absent = [name for name in records if name not in stations]
    if absent:
        raise InputError(
            f"{records[absent[0]]}: expected a station for {', '.join(absent)}, got "
            f"{', '.join(stations)}"
        )
    arrivals: dict[str, list[Detection]] = {}
    at_of: dict[tuple[str, Detection], int] = {}
    for at, one in enumerate(found.picks):
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
    several = len(grouped.heard) > 1
    shots = {
        at_of[key]: str(number) if several else ""
        for number, bang in enumerate(grouped.heard, start=1)
        for key in bang.items()
    }
    return dict(sorted(shots.items())), sorted(at_of[key] for key in grouped.left_out)


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
        covariances += (covariance_of(one, observations.records()[row], kept),)
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
        or {one.record.name, one.record.alias} & {sensor, f"{file.stem}.{sensor}"}
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
