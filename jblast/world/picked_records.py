"""Readings of a world that are picked from the records of its sensors.

A microphone or pressure sensor with sampling options (`rate_hz`, noise, bits) has its
arrivals and peaks picked from its record, as by `jblast pick`, with their errors. The
true arrival times are used only for the search interval of each blast, which extends up
to midway to the previous and next blasts.

A sample is the mean over its interval, which begins at its stamp. A pick assigns it to
the stamp, so half a sampling interval is added to an arrival. The position of a steep
front within its interval is unknown: 1/12 of the squared interval is added
to the variance of an arrival, and to that of a peak the corresponding decay of the
pulse.
"""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from jblast.observations import Observations, observed
from jblast.observations.grouping import stacked
from jblast.observations.records.recording import PressureRecord, Recording
from jblast.scene import Sensor
from jblast.scene.sensor_kinds import SENSOR_KINDS
from jblast.signals.picks import RecordPick, pick_records
from jblast.signals.picks.pick import LEAST_SAMPLES
from jblast.signals.picks.pick_log import log_value, omitted_quantities
from jblast.world.drawn import DrawnWorld
from jblast.world.perceived import Arrivals, interval_about

AIR, PEAK = PICKED_QUANTITIES = ("air_arrival_s", "peak_overpressure_pa")
"""Quantities of a pick that are used."""


class PickedReadings(NamedTuple):
    """Readings picked from the records of a world.

    Attributes:
        readings: The rows; None: no sensor has a row.
        missed: Number of air shocks without a pick, or with a poor one.
    """

    readings: Observations | None
    missed: int


def picked_readings(
    world: DrawnWorld,
    arrivals: Arrivals,
    recordings: Mapping[str, Recording],
    seconds: float,
) -> PickedReadings:
    """Pick the records of the sensors of a world that have sampling options.

    Args:
        world: The world.
        arrivals: Times and places of arrivals.
        recordings: By sensor.
        seconds: Duration of the records.
    """
    records: list[PressureRecord] = []
    of: list[tuple[Sensor, int]] = []
    for sensor in sampled_sensors(world):
        own = arrivals.times_s[AIR][arrivals.entities.index(sensor.name)]
        comes = own + float(sensor.clock_offset_s)
        for shot in np.flatnonzero(comes < seconds).tolist():
            recording = recordings[sensor.name]
            records.append(_interval_record(recording, sensor, comes, shot))
            of.append((sensor, shot))
    rows: list[tuple[str, str, float, float, str, bool]] = []
    places: list[np.ndarray] = []
    missed = 0
    for (sensor, shot), one in zip(of, pick_records(records), strict=True):
        lost = [quantity for _, gone in omitted_quantities(one) for quantity in gone]
        kept = [q for q in PICKED_QUANTITIES if one.pick.found and q not in lost]
        missed += not kept
        for quantity in kept:
            value, sigma = _value(one, quantity)
            bound = quantity == PEAK and bool(one.pick.lower_bound)
            name = world.scene.charges[shot].name
            rows.append((sensor.name, quantity, value, sigma, name, bound))
            row = arrivals.entities.index(sensor.name)
            places.append(arrivals.places_m[AIR][row, shot])
    if not rows:
        return PickedReadings(None, missed)
    names, quantities, values, sigmas, shots, bounds = zip(*rows, strict=True)
    readings = observed(
        names,
        quantities,
        values,
        sigmas,
        position=np.stack(places),
        shot=shots,
        lower_bound=np.array(bounds),
        comments=("air shocks at sensors with sampling options are picked",),
    )
    return PickedReadings(readings, missed)


def sampled_sensors(world: DrawnWorld) -> tuple[Sensor, ...]:
    """Return the sensors whose readings are picked: those with sampling options."""
    return tuple(
        sensor
        for sensor in world.scene.sensors
        if sensor.instrument is not None
        and sensor.kind
        and SENSOR_KINDS[sensor.kind].is_picked
    )


def joined(one: Observations | None, other: Observations | None) -> Observations | None:
    """Return both logs concatenated."""
    logs = [log for log in (one, other) if log is not None]
    if len(logs) < 2:
        return logs[0] if logs else None
    comments = tuple(line for log in logs for line in log.comments)
    return Observations(**stacked(logs), comments=comments)


def _interval_record(
    recording: Recording, sensor: Sensor, comes_s: np.ndarray, shot: int
) -> PressureRecord:
    """Return the interval of a record about one blast."""
    first, last = interval_about(comes_s, shot)
    start, stop = (round(recording.rate_hz * t) for t in (max(first, 0.0), last))
    # The picker needs a minimum of samples, also at the end of a recording.
    stop = min(max(stop, start + LEAST_SAMPLES), recording.length)
    record = recording.record(0, min(start, stop - LEAST_SAMPLES), stop)
    instrument = sensor.instrument
    if instrument is None or instrument.high_pass is None:
        return record
    # A known high-pass filter lets the pick correct its droop of the positive phase.
    return replace(record, high_pass_hz=float(instrument.high_pass))


def _value(one: RecordPick, quantity: str) -> tuple[float, float]:
    """Return a quantity of a pick and its sigma, both for means over samples."""
    value, sigma = log_value(one, quantity)
    step = 1.0 / one.record.rate_hz
    unknown = step / math.sqrt(12.0)
    if quantity == AIR:
        return value + 0.5 * step, math.hypot(sigma, unknown)
    # Slope of Friedlander's pulse at its peak, relative to the peak: (1 + b) / t_d.
    fall = (1.0 + float(one.pick.decay)) / float(one.pick.positive_duration_s)
    return value, math.hypot(sigma, value * fall * unknown)
