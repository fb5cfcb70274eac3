"""Picks of files of samples, and picks as rows of a log.

Each blast of each channel is picked, in batches. A file that cannot be used is reported
and does not stop the others.

Quantities that a record does not identify have no row, and are reported: peak and
impulse of samples without a scale; duration and impulse behind an unknown high-pass,
over a baseline that bends, or of a record that ends too early; all of a poor pick. (The
tail of a pulse and a bend of the baseline differ by their form alone: the durations of
textbook pulses with a long tail were off by 6 to 30 of their standard deviations.) The
rows of a pick share its covariance.

A row of a log may also name a record; `picked_log` replaces it by rows of its pick.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Literal, NamedTuple

import equinox as eqx
import numpy as np

from jblast.errors import InputError, argument, shown
from jblast.observations import Observations, observed, some_rows
from jblast.observations.grouping import stacked
from jblast.observations.records.formats import Scaling, open_record
from jblast.observations.records.recording import PressureRecord, Recording
from jblast.observations.records.stations import Station, started
from jblast.observations.table import OF_SAMPLES, SAMPLES, RecordCovariance
from jblast.progress import each
from jblast.quantities import ADDITIVE, CLOCK_TIMES
from jblast.signals.arrays import bangs
from jblast.signals.matched_filter import Detection
from jblast.signals.onsets import stretches
from jblast.signals.picks.pick import LEAST_SAMPLES, NAMES
from jblast.signals.picks.record_picks import RecordPick, pick_records

BATCH = 2**22
"""Samples that are held before they are picked: 32 megabytes."""
TOLD = OF_SAMPLES
"""Quantities in the order of a pick's covariance."""
_, PEAK, DURATION, IMPULSE = TOLD
Reason = Literal[
    "poor",
    "onset_alone",
    "uncalibrated",
    "high_passed",
    "curved_baseline",
    "cut_short",
    "zero_shift",
    "front_alone",
    "weaker",
]
"""Why something stands in no row; weaker: than another of its bang at its sensor."""
SPREAD_IN_UNIT = ("air_arrival_s", "decay")
"""Their spread is in their own unit; that of the others is of their logarithm."""
IN_PASCALS = ("peak_overpressure_pa", "positive_impulse_pa_s", "negative_pressure_pa")
"""Values that samples without a scale do not identify."""


class Gathered(NamedTuple):
    """Picks of files of samples.

    Attributes:
        picks: Those that were found, in the order of files, channels and time.
        orders: Which bang of its channel each is, from 1.
        silent: Names of channels in which nothing was found.
        quieter: How many onsets were not looked at, by channel: 20 dB below its
            loudest.
        refused: Why files could not be read, a message each.
        epoch: UTC of time zero of all picks; None where no file states it.
        channels: How many channels were read.
    """

    picks: tuple[RecordPick, ...]
    orders: tuple[int, ...]
    silent: tuple[str, ...]
    quieter: dict[str, int]
    refused: tuple[InputError, ...]
    epoch: datetime | None
    channels: int

    def named(self) -> tuple[str, ...]:
        """Name each pick's record: name#order where a channel has several bangs."""
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
    """Read files and pick their bangs.

    Files with the time of day of their first sample, or whose stations have it, share
    one clock, that of the first.

    Args:
        files: Records.
        scaling: What the user says of the recorders' scale.
        high_pass_hz: Corner of their first-order high-pass [Hz].
        keep_samples: Whether picks keep their samples, to be drawn.
        stations: By name of record; their `start` is looked at.
    """
    reading = _Reading(files, scaling, high_pass_hz, stations or {})
    found: list[RecordPick] = []
    heard: set[str] = set()
    for batch in _batches(reading):
        for one in pick_records(batch):
            if not one.pick.found:
                continue
            heard.add(one.record.name)
            if not keep_samples:
                empty = replace(one.record, samples=np.zeros(0))
                one = replace(one, record=empty)
            found.append(one)
    return Gathered(
        picks=tuple(found),
        orders=_orders([one.record.name for one in found]),
        silent=tuple(name for name in reading.channels if name not in heard),
        quieter=reading.quieter,
        refused=tuple(reading.refused),
        epoch=reading.epoch,
        channels=len(reading.channels),
    )


class _Reading:
    """Goes through files, and keeps what is to be reported of them."""

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
        self._first: Path | None = None

    def __iter__(self) -> Iterator[PressureRecord]:
        """Give stretches, those of a channel in order of time."""
        seen: set[str] = set()
        for file in each(self.files, "records"):
            try:
                if file.stem in seen:
                    raise InputError(
                        f"{file}: expected records of names that differ, got "
                        f"{file.stem} twice"
                    )
                recordings = open_record(file, self.scaling)
                _check_lengths(recordings)
                runs = [(one, stretches(self._timed(one))) for one in recordings]
            except InputError as error:
                self.refused.append(error)
                continue
            seen.add(file.stem)
            for recording, channels in runs:
                for name, channel in zip(recording.names, channels, strict=True):
                    self.channels.append(name)
                    if channel.quieter:
                        self.quieter[name] = channel.quieter
                    for record in channel.records:
                        if np.ptp(record.samples) > 0:
                            yield replace(record, high_pass_hz=self.high_pass_hz)

    def _timed(self, recording: Recording) -> Recording:
        """Return a recording on the clock of the first.

        Raises:
            InputError: Of it and the first one alone has a time of day.
        """
        recording = started(recording, self.stations)
        if self._first is None:
            self._first, self.epoch = Path(recording.source), recording.epoch
        if (self.epoch is None) != (recording.epoch is None):
            one, other = "a time of day", "none"
            if recording.epoch is None:
                one, other = other, one
            raise InputError(
                f"{recording.source}: expected to begin at {other}, as {self._first} "
                f"does, got {one}; say when the first sample of each file without one "
                "was, in the column start_utc of the table of stations, or pick them "
                "apart from each other"
            )
        if self.epoch is None or recording.epoch is None:
            return recording
        later = (recording.epoch - self.epoch).total_seconds()
        start = recording.start_s + later
        return replace(recording, epoch=self.epoch, start_s=start)


def _check_lengths(recordings: Sequence[Recording]) -> None:
    """Refuse what has too few samples for a pulse and the noise before it."""
    for one in recordings:
        if one.length < LEAST_SAMPLES:
            raise InputError(
                f"{one.source}: {one.labels[0]}: expected {LEAST_SAMPLES} samples or "
                f"more, got {one.length}"
            )


def _batches(records: _Reading) -> Iterator[list[PressureRecord]]:
    """Put records together until they hold so many samples."""
    batch, samples = [], 0
    for record in records:
        batch.append(record)
        samples += record.samples.size
        if samples >= BATCH:
            yield batch
            batch, samples = [], 0
    if batch:
        yield batch


def _orders(names: list[str]) -> tuple[int, ...]:
    """Return which of its name each is, from 1."""
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
        record: Which pick.
        quantities: What.
        reason: Why.
    """

    record: str
    quantities: tuple[str, ...]
    reason: Reason


class PickLog(NamedTuple):
    """Rows of a log.

    Attributes:
        observations: The rows.
        left_out: What stands in none.
        bangs: How many bangs the rows are of.
        independent: Records whose errors are taken as independent, because their
            covariance is no such matrix.
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

    Picks at several places are of one bang if no more lies between them than sound
    takes from the first place to the last; of several at one place the loudest is.
    Without places the bangs of a channel are distinguished by their order.

    Args:
        found: Picks.
        stations: Where the sensors stood, by their names.
        comments: Provenance.

    Raises:
        InputError: A channel has no station.
    """
    names = found.named()
    shots, weaker = _shots(found, stations)
    rows: list[_Row] = []
    covariances: list[RecordCovariance] = []
    independent: list[str] = []
    left_out = [LeftOut(names[at], TOLD, "weaker") for at in weaker]
    for at, shot in shots.items():
        one = found.picks[at]
        kept = list(TOLD)
        for reason, lost in untold(one):
            gone = tuple(quantity for quantity in kept if quantity in lost)
            if gone:
                left_out.append(LeftOut(names[at], gone, reason))
                kept = [quantity for quantity in kept if quantity not in gone]
        made = [_row(one, quantity, shot, names[at]) for quantity in kept]
        rows += made
        together = [row.quantity for row in made if not row.is_bound]
        if len(together) > 1:
            try:
                covariances.append(covariance_of(one, names[at], together))
            except ValueError:  # not positive definite: an optimum at an edge
                independent.append(names[at])
    count = len(set(shots.values()))
    observations = _observations(rows, found, stations, comments)
    observations = replace(observations, covariances=tuple(covariances))
    return PickLog(observations, tuple(left_out), count, tuple(independent))


def untold(one: RecordPick) -> Iterator[tuple[Reason, tuple[str, ...]]]:
    """Yield the reasons why quantities of a pick have no row, and the quantities."""
    if one.quality == "poor":
        yield "poor", TOLD
    if "onset_alone" in one.notes:
        yield "onset_alone", (PEAK, DURATION, IMPULSE)
    if not one.record.calibrated:
        yield "uncalibrated", (PEAK, DURATION, IMPULSE)
    if one.pick.high_passed:
        yield "high_passed", (DURATION, IMPULSE)
    if one.pick.curving:
        yield "curved_baseline", (DURATION, IMPULSE)
    if one.pick.cut_short:
        yield "cut_short", (DURATION, IMPULSE)
    if one.pick.shifted:
        yield "zero_shift", (DURATION, IMPULSE)
    if one.pick.front_alone:
        yield "front_alone", (DURATION, IMPULSE)


def _row(one: RecordPick, quantity: str, shot: str, record: str) -> _Row:
    """Return a pick's row of a quantity."""
    value, sigma = log_value(one, quantity)
    is_bound = quantity == PEAK and bool(one.pick.lower_bound)
    return _Row(one.record.name, quantity, value, sigma, is_bound, shot, record)


def _shots(
    found: Gathered, stations: Mapping[str, Station] | None
) -> tuple[dict[int, str], list[int]]:
    """Return the shot of each pick, and those that are weaker than one of it."""
    if stations is None:
        several = len(set(found.orders)) > 1
        orders = enumerate(found.orders)
        return {at: str(order) if several else "" for at, order in orders}, []
    heard: dict[str, list[Detection]] = {}
    at_of: dict[tuple[str, Detection], int] = {}
    for at, one in enumerate(found.picks):
        name = one.record.name
        if name not in stations:
            raise InputError(
                f"{one.record.source}: expected a station for {name}, got "
                f"{', '.join(stations)}"
            )
        when, peak = one.pick.air_arrival_s, one.pick.peak_overpressure_pa
        # an onset alone has no peak, and is weaker than any pulse
        arrival = Detection(float(when), 0.0, 0.0, float(np.nan_to_num(peak)))
        heard.setdefault(name, []).append(arrival)
        at_of[name, arrival] = at
    positions = {name: stations[name].position for name in heard}
    one_bang = len({stations[name].clock for name in heard}) > 1
    grouped = bangs(heard, positions, one=one_bang)
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
    nowhere = Station((np.nan, np.nan, np.nan), "")
    stood = [(stations or {}).get(row.sensor, nowhere) for row in rows]
    places = np.array([station.position for station in stood])
    return observed(
        [row.sensor for row in rows],
        [row.quantity for row in rows],
        [row.value for row in rows],
        [row.sigma for row in rows],
        position=places.reshape(len(rows), 3),
        shot=tuple(row.shot for row in rows),
        clock=tuple(station.clock for station in stood),
        comments=tuple(comments),
        lower_bound=np.array([row.is_bound for row in rows], bool),
        frame=next((s.frame for s in stood if s.frame is not None), None),
        epoch=found.epoch,
        record=tuple(row.record for row in rows),
    )


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
            f"nobody said: {argument('full_scale_pa')} of WAV and FLAC, "
            f"{argument('sensitivity')} of counts"
        )
    return one


def _on_one_clock(
    observations: Observations, picks: list[RecordPick]
) -> tuple[datetime | None, list[RecordPick]]:
    """Return picks whose times count from the log's time zero, and when that was.

    Raises:
        InputError: Some files have a time of day, and others have none.
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


def log_value(one: RecordPick, quantity: str) -> tuple[float, float]:
    """Return value and sigma; of a clipped peak where it clips, at least."""
    if quantity == "peak_overpressure_pa" and bool(one.pick.lower_bound):
        level = float(one.pick.clipped_at_pa - one.pick.baseline_pa)
        return level, float(one.pick.noise_pa)
    at = TOLD.index(quantity)
    value = float(getattr(one.pick, quantity))
    sd = float(np.sqrt(one.pick.covariance[at, at]))
    return value, sd if quantity in ADDITIVE else sd * value


def covariance_of(
    one: RecordPick, record: str, quantities: Sequence[str]
) -> RecordCovariance:
    """Return how the errors of a pick's rows go together.

    A peak that is a lower bound has an error of its own, that of a reading.

    Args:
        one: The pick.
        record: What the log calls it.
        quantities: Of its rows.

    Raises:
        ValueError: They go together as no errors can.
    """
    bound = bool(one.pick.lower_bound)
    names = tuple(
        name
        for name in TOLD
        if name in quantities and not (bound and name == "peak_overpressure_pa")
    )
    at = [TOLD.index(name) for name in names]
    matrix = np.asarray(one.pick.covariance, float)[np.ix_(at, at)]
    return RecordCovariance(record, names, 0.5 * (matrix + matrix.T))


class PickEstimate(NamedTuple):
    """A value and its standard deviation, in its unit."""

    value: float
    sd: float


def pick_estimate(one: RecordPick, name: str) -> PickEstimate | None:
    """Return a value of a pick; None where samples are no pascals and it is in them.

    None, too, where only the onset was picked.

    Args:
        one: The pick of one record.
        name: One of `NAMES`.
    """
    if name in IN_PASCALS and not one.record.calibrated:
        return None
    value, spread = float(getattr(one.pick, name)), one.pick.spread[NAMES.index(name)]
    if np.isnan(value):
        return None
    return PickEstimate(
        value, float(spread) * (1.0 if name in SPREAD_IN_UNIT else abs(value))
    )
