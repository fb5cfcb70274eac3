"""Readings picked from the samples that a world's sensors wrote down.

A sensor of kind microphone or pressure that says how it samples (`rate_hz`, noise,
bits) has its arrivals and peaks picked from its file, as `jblast pick` does it, errors
and all. The truth says in which stretch a blast is looked for, up to midway to the one
before and the one after, and nothing else.

A sample is the mean over its time, from its stamp on, and a pick takes it for what was
there at its stamp: so half a sample is added to an arrival. Where in its sample the
front was no pick of so steep a front knows: a twelfth of a sample squared is added to
the variance, and to that of the peak what the pulse falls by meanwhile.
"""

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jblast.inference.picks import RecordPick, pick_records
from jblast.inference.picks.pick import LEAST_SAMPLES
from jblast.inference.records.covariance import log_value
from jblast.inference.records.log import untold
from jblast.observations import Observations, observed
from jblast.observations.grouping import stacked
from jblast.observations.records.formats import Scaling, open_record
from jblast.observations.records.pressure_record import PressureRecord
from jblast.observations.records.recording import Recording
from jblast.scene import Sensor
from jblast.world import Arrivals, DrawnWorld
from jblast.world.perceived import stretch_about

KINDS = ("microphone", "pressure")
AIR, PEAK = TAKEN = ("air_arrival_s", "peak_overpressure_pa")
"""What is taken of a pick."""


class Picked(NamedTuple):
    """What was picked of a world's files.

    Attributes:
        readings: The rows; None: no sensor has a row.
        missed: Air shocks of which nothing was picked, or nothing to be trusted.
    """

    readings: Observations | None
    missed: int

    def words(self) -> list[str]:
        """Return what there is to say of picks that are not among the readings."""
        if not self.missed:
            return []
        return [
            f"air shocks at sensors that sample, {self.missed} of them, were not "
            "picked, or poorly: no reading of them was written"
            if self.missed > 1
            else "an air shock at a sensor that samples was not picked, or poorly: no "
            "reading of it was written"
        ]


def joined(one: Observations | None, other: Observations | None) -> Observations | None:
    """Return both logs as one, the second behind the first."""
    logs = [log for log in (one, other) if log is not None]
    if len(logs) < 2:
        return logs[0] if logs else None
    comments = tuple(line for log in logs for line in log.comments)
    return Observations(**stacked(logs), comments=comments)


def sampled(world: DrawnWorld) -> tuple[Sensor, ...]:
    """Return the sensors whose readings are picked: those that say how they sample."""
    return tuple(
        sensor
        for sensor in world.scene.sensors
        if sensor.kind in KINDS and sensor.instrument is not None
    )


def picked(
    world: DrawnWorld, arrivals: Arrivals, directory: Path, sound: Mapping[str, Any]
) -> Picked:
    """Pick what the sensors of a world wrote.

    Args:
        world: What is there.
        arrivals: When and where waves come to whom.
        directory: Where the files are.
        sound: The document of the records.
    """
    records: list[PressureRecord] = []
    of: list[tuple[Sensor, int]] = []
    for sensor in sampled(world):
        own = arrivals.times_s[AIR][arrivals.entities.index(sensor.name)]
        comes = own + float(sensor.clock_offset_s)
        entry = sound["sensors"][sensor.name]
        scaling = Scaling(entry.get("full_scale_pa"), None)
        (recording,) = open_record(directory / entry["file"], scaling)
        for shot in np.flatnonzero(comes < sound["seconds"]).tolist():
            records.append(_about(recording, sensor, comes, shot))
            of.append((sensor, shot))
    rows: list[tuple[str, str, float, float, str, bool]] = []
    places: list[np.ndarray] = []
    missed = 0
    for (sensor, shot), one in zip(of, pick_records(records), strict=True):
        lost = [quantity for _, gone in untold(one) for quantity in gone]
        kept = [q for q in TAKEN if one.pick.found and q not in lost]
        missed += not kept
        for quantity in kept:
            value, sigma = _value(one, quantity)
            bound = quantity == PEAK and bool(one.pick.lower_bound)
            name = world.scene.charges[shot].name
            rows.append((sensor.name, quantity, value, sigma, name, bound))
            row = arrivals.entities.index(sensor.name)
            places.append(arrivals.places_m[AIR][row, shot])
    if not rows:
        return Picked(None, missed)
    names, quantities, values, sigmas, shots, bounds = zip(*rows, strict=True)
    readings = observed(
        names,
        quantities,
        values,
        sigmas,
        position=np.stack(places),
        shot=shots,
        lower_bound=np.array(bounds),
        comments=("air shocks at sensors that say how they sample are picked",),
    )
    return Picked(readings, missed)


def _about(
    recording: Recording, sensor: Sensor, comes_s: np.ndarray, shot: int
) -> PressureRecord:
    """Return the stretch of a record about one blast."""
    first, last = stretch_about(comes_s, shot)
    start, stop = (round(recording.rate_hz * t) for t in (max(first, 0.0), last))
    stop = min(max(stop, start + LEAST_SAMPLES), recording.length)
    record = recording.record(0, min(start, stop - LEAST_SAMPLES), stop)
    instrument = sensor.instrument
    if instrument is None or instrument.high_pass is None:
        return record
    return replace(record, high_pass_hz=float(instrument.high_pass))


def _value(one: RecordPick, quantity: str) -> tuple[float, float]:
    """Return what a pick tells of a quantity, its sample heeded; and its sigma."""
    value, sigma = log_value(one, quantity)
    step = 1.0 / one.record.rate_hz
    unknown = step / math.sqrt(12.0)
    if quantity == AIR:
        return value + 0.5 * step, math.hypot(sigma, unknown)
    fall = (1.0 + float(one.pick.decay)) / float(one.pick.positive_duration_s)
    return value, math.hypot(sigma, value * fall * unknown)
