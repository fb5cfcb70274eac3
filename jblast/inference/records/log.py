"""Picks as rows of a log that a fit takes as it stands.

What a record cannot tell stands in no row, and is named: of samples that nobody scaled
the peak and the impulse, of an unknown high-pass, a baseline that bends or a record
that ends too early the duration and the impulse, of a poor pick everything. (The tail
of a pulse and a baseline that bends are told apart by their form alone: textbook pulses
with a long tail had durations off by 6 to 30 of their standard deviations.)
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np

from jblast.detect.array.bangs import bangs
from jblast.detect.peaks import Detection
from jblast.errors import InputError
from jblast.inference.picks import RecordPick
from jblast.inference.records.covariance import TOLD, covariance_of, log_value
from jblast.inference.records.gathered import Gathered
from jblast.observations import Observations, observed
from jblast.observations.records.stations import Station
from jblast.observations.table import RecordCovariance

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


@dataclass(frozen=True)
class LeftOut:
    """What of a pick stands in no row.

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
    Without places the bangs of a channel are told apart by their order.

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
    """Give why a pick does not tell some quantities."""
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
