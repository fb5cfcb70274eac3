"""Detected arrivals as rows of a log.

Separate microphones have one row `air_arrival_s` each. An array, three to eight
channels of one recorder within `MAX_ARRAY_WIDTH` of each other, has one such row at its
centre, and the angles `bearing_rad` and `elevation_rad` that its layout identifies.
Most of the scatter of a travel time is common to its microphones. Their differences
have the part that neighbouring paths do not share (`arrays.direction`), and the row of
the time has the scatter of its law. The mean and the differences of times have
independent instrument errors, so nothing is counted twice. If the times contradict a
plane wave, the microphones have separate rows.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import chdtrc

from jblast.observations import Observations, observed
from jblast.observations.records.stations import Station
from jblast.signals.arrays import (
    MAX_MICROPHONES,
    MIN_MICROPHONES,
    Direction,
    bangs,
    direction,
    relative_times,
)
from jblast.signals.detection import Detection
from jblast.signals.noise import bin_variances
from jblast.signals.sound_watch import Searched

MAX_ARRAY_WIDTH = 5.0
"""Largest distance between the microphones of an array [m]. Within it a front is plane
and delays are at most 15 ms, so that one window contains the blast at all of them."""
LEAST_PLANE_PROBABILITY = 1e-3
"""Smallest probability of the chi-squared of a plane wave: one array in a thousand is
reported as separate microphones without need, with a wider error."""
SPEED, SPEED_SD = 340.29, 10.0
"""Speed of sound near an array [m/s], and its change by 15 K or 10 m/s of wind."""


class ArrayFinding(NamedTuple):
    """Measurements of one event by an array.

    Attributes:
        array: Name of its recorder.
        bang: Number of the event, from 0.
        direction: Direction of the source; None if delays are missing.
        probability: Probability of a larger chi-squared for a plane wave.
        used: True if its rows are in the log.
    """

    array: str
    bang: int
    direction: Direction | None
    probability: float
    used: bool


class Log(NamedTuple):
    """Rows of a log.

    Attributes:
        observations: The rows.
        arrays: Measurements by arrays.
        left_out: Sensor and arrival of arrivals without a row (`bangs`).
    """

    observations: Observations
    arrays: tuple[ArrayFinding, ...]
    left_out: tuple[tuple[str, Detection], ...]


_Row = tuple[str, str, float, float, Sequence[float], str, str]
"""Sensor, quantity, value, sigma, position, shot and clock."""


def log_of(
    searched: Sequence[Searched],
    stations: Mapping[str, Station],
    comments: Sequence[str] = (),
) -> Log:
    """Return the rows of a log.

    Args:
        searched: Channels, each of a sensor that has a station.
        stations: Stations by name of the sensor.
        comments: Provenance.
    """
    of = {one.channel.sensor: one for one in searched}
    clocks = {stations[name].clock for name in of}
    positions = {name: stations[name].position for name in of}
    found = {name: one.detections for name, one in of.items()}
    grouped = bangs(found, positions, one=len(clocks) > 1)
    rows: list[_Row] = []
    found_arrays: list[ArrayFinding] = []
    arrays = _arrays(searched, stations)
    for number, arrivals in enumerate(grouped.heard):
        shot = str(number + 1) if len(grouped.heard) > 1 else ""
        alone = dict(arrivals)
        for name, members in arrays.items():
            if not all(member.channel.sensor in arrivals for member in members):
                continue
            finding, made = _array_rows(name, members, stations, arrivals, number, shot)
            found_arrays.append(finding)
            rows += made
            for member in members if finding.used else ():
                alone.pop(member.channel.sensor)
        for name, arrival in alone.items():
            when = ("air_arrival_s", arrival.time_s, arrival.sigma_s)
            station = stations[name]
            rows.append((name, *when, station.position, shot, station.clock))
    # all stations of a table have one frame
    frame = next((stations[name].frame for name in of if stations[name].frame), None)
    columns = zip(*rows, strict=True) if rows else [()] * 7
    sensor, quantity, value, sigma, position, shots, row_clocks = map(list, columns)
    log = observed(
        sensor,
        quantity,
        value,
        sigma,
        position=np.reshape(position, (-1, 3)).astype(float),
        shot=tuple(shots),
        clock=tuple(row_clocks),
        comments=tuple(comments),
        frame=frame,
    )
    return Log(log, tuple(found_arrays), grouped.left_out)


def _arrays(
    searched: Sequence[Searched], stations: Mapping[str, Station]
) -> dict[str, list[Searched]]:
    """Return the channels of each recorder whose microphones form an array."""
    records: dict[str, list[Searched]] = {}
    for one in searched:
        records.setdefault(one.channel.record, []).append(one)
    arrays = {}
    for members in records.values():
        names = [member.channel.sensor for member in members]
        where = np.array([stations[name].position for name in names])
        apart = np.linalg.norm(where[:, None] - where[None], axis=-1)
        clocks = {stations[name].clock for name in names}
        if (
            MIN_MICROPHONES < len(members) <= MAX_MICROPHONES
            and apart.max() <= MAX_ARRAY_WIDTH
            and len(clocks) == 1
        ):
            arrays[names[0].rpartition(".")[0]] = members
    return arrays


def _array_rows(
    name: str,
    members: Sequence[Searched],
    stations: Mapping[str, Station],
    arrival_at: Mapping[str, Detection],
    bang: int,
    shot: str,
) -> tuple[ArrayFinding, list[_Row]]:
    """Return the measurements of an event by an array, and its rows."""
    names = [member.channel.sensor for member in members]
    where = np.array([stations[sensor].position for sensor in names])
    apart = np.linalg.norm(where[:, None] - where[None], axis=-1)
    arrivals = [arrival_at[sensor] for sensor in names]
    # the travel time of sound, a fifth for slower air, and two samples
    largest = 1.2 * apart / SPEED + 2 / members[0].channel.rate_hz
    window, variances = _window(members, arrivals, float(largest.max()))
    rate = members[0].channel.rate_hz
    times = relative_times(window, rate, variances, largest)
    if not times.complete or not np.ptp(where, axis=0).any():
        return ArrayFinding(name, bang, None, np.nan, used=False), []
    found = direction(where, times, SPEED, SPEED_SD)
    probability = float(chdtrc(found.dof, found.chi2)) if found.dof else 1.0
    used = probability > LEAST_PLANE_PROBABILITY and len(found.undetermined) < 2
    finding = ArrayFinding(name, bang, found, probability, used=used)
    if not used:
        return finding, []
    # each microphone estimates the time at the centre, with an independent error
    centred = np.array([arrival.time_s for arrival in arrivals]) - times.time
    weight = np.array([arrival.sigma_s for arrival in arrivals]) ** -2.0
    mean, variance = float(np.average(centred, weights=weight)), 1 / weight.sum()
    sd = np.sqrt(np.diag(found.covariance))
    values = {
        "air_arrival_s": (mean, float(np.sqrt(variance))),
        "bearing_rad": (found.bearing, float(sd[0])),
        "elevation_rad": (found.elevation, float(sd[1])),
    }
    middle, clock = tuple(where.mean(axis=0)), stations[names[0]].clock
    return finding, [
        (name, quantity, *measured, middle, shot, clock)
        for quantity, measured in values.items()
        if np.isfinite(measured).all()
    ]


def _window(
    members: Sequence[Searched], arrivals: Sequence[Detection], largest_s: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return samples about an event, and the variance of each bin of their noise."""
    rate = members[0].channel.rate_hz
    times = [arrival.time_s for arrival in arrivals]
    length_s = max(arrival.template_s for arrival in arrivals)
    margin = largest_s + 0.5 * length_s + 0.01
    start = max(int((min(times) - margin) * rate), 0)
    stop = int((max(times) + length_s + margin) * rate)
    stop = min(stop, *(member.channel.samples.size for member in members))
    # an even number, as `arrays.relative_times` needs
    stop -= (stop - start) % 2
    window = np.array([member.channel.samples[start:stop] for member in members])
    # each microphone has noise of its own, which weights its delays
    variances = [bin_variances(m.noise, stop - start, rate) for m in members]
    return window, np.array(variances)
