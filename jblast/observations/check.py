"""Checks of a log that need no blast law.

`refusals` lists everything for which a fit would refuse a log with its scene, one fault
a row. The other checks find what a fit would
accept although it is probably a mistake: clock times that are seconds since 1970,
clocks with a single reading, arrivals before the flash, sensors at two positions or
with the readings of another one, exchanged latitude and longitude, and errors smaller
than those of pressure standards or larger than their value.
"""

from collections.abc import Iterable
from contextlib import suppress
from dataclasses import replace
from datetime import UTC, datetime
from itertools import combinations
from typing import Any

import numpy as np
from jaxtyping import Bool

from jblast.errors import InputError
from jblast.observations.grouping import by_shot, located
from jblast.observations.placement import (
    EARLY_SIGMAS,
    POSITION_TOLERANCE,
    resolve_positions,
    scene_positions,
)
from jblast.observations.scenes import for_log
from jblast.observations.table import SAMPLES, Observations, rows_by
from jblast.quantities import (
    ADDITIVE,
    ARRIVALS,
    BY_CAMERA,
    CLOCK_TIMES,
    PLACELESS,
    QUANTITIES,
    components,
)
from jblast.registry import names_for
from jblast.results import Note, warning
from jblast.scene import UncertainScene
from jblast.scene.uncertain import NO_SCENE

FROM_2000, TO_2100 = 946_684_800.0, 4_102_444_800.0
"""Seconds since 1970 at the beginning of 2000 and of 2100: clock times of a recording
started at zero are never that large, and times since 1970 nearly always within."""
COUNTED_IN = {
    "seconds": 1.0,
    "milliseconds": 1e3,
    "microseconds": 1e6,
    "nanoseconds": 1e9,
}
"""Units in which programs count time since 1970, per second."""
ONE_WAVE_SIGMAS = 6.0
"""Largest difference of readings of one wave at one position [sigmas]: errors alone
exceed it in one of 500 million pairs."""
FAR_RATIO = 10.0
"""Distance of a sensor far from the others, over the median distance: exchanged
latitude and longitude displace it by thousands of kilometres."""
REFLECTION_FACTOR = 2.0
"""Largest ratio of two pressures at one position, without a sigma: a gauge that faces a
wall records twice the incident pressure, or more."""
FINEST_SIGMA = 1e-6
"""Smallest plausible relative sigma, that of primary standards of pressure (piston
gauges state about 1e-6 in the key comparisons of the BIPM)."""


def refusals(observations: Observations, uncertain: UncertainScene) -> list[InputError]:
    """Return the faults for which a fit refuses a log with a scene, one a row.

    The shots of a log are checked as separate logs, unless the scene names its charges.
    """
    # a scene that names its charges relates shots to them, so the log stays whole
    several = len(uncertain.scene.charges) > 1
    # positions and clocks may differ from shot to shot, as between days of a test
    logs = [observations] if several else by_shot(observations).values()
    found: list[InputError] = []
    for log in logs:
        for quantity, rows in rows_by(log.quantity).items():
            found += [
                log.fault(rows[0], f"no law gives {name}: not supported yet")
                for name, _ in components(quantity)
                if not names_for(name) and quantity != SAMPLES
            ]
        of = for_log(uncertain, log)
        try:
            there, is_default = located(log, of), of.source == NO_SCENE
            resolve_positions(
                there, of.scene, of.beliefs, is_default=is_default, faults=found
            )
        except InputError as fault:
            found.append(fault)
    # the same fault may be found in the log of every shot, and is reported once
    return list({str(fault): fault for fault in found}.values())


def with_places(observations: Observations, uncertain: UncertainScene) -> Observations:
    """Return a log in the scene's frame, with the sensor positions of the scene."""
    # `refusals` reports a log from another continent
    with suppress(InputError):
        observations = located(observations, uncertain)
    # rows without a position in the log have that of the scene, as in a fit
    known = scene_positions(observations, uncertain.scene)
    missing = ~_placed(observations)[:, None]
    position = np.where(missing, known, observations.position)
    return replace(observations, position=position)


def doubt(kind: str, rows: Iterable[int], **numbers: Any) -> Note:
    """Return a note on a probable mistake in a log that a fit accepts.

    Args:
        kind: Name of its sentence.
        rows: Rows of the log that it concerns, the most relevant first.
        **numbers: Its evidence in SI units, and names.
    """
    return warning(kind, rows=tuple(rows), **numbers)


def clocks_doubted(observations: Observations) -> list[Note]:
    """Return probable mistakes in the clocks and shots of a log."""
    searches = (_since_1970, _unheard, _lonely, _before_the_flash)
    return [found for search in searches for found in search(observations)]


def _since_1970(observations: Observations) -> list[Note]:
    """Find clock times that are times since 1970, not times of a recording."""
    # times with a date are converted to seconds after an epoch, never since 1970
    if observations.epoch is not None:
        return []
    value = observations.value
    timed = np.isin(observations.quantity, CLOCK_TIMES)
    found = []
    for unit, factor in COUNTED_IN.items():
        since = value / factor
        rows = np.flatnonzero(timed & (since > FROM_2000) & (since < TO_2100))
        if rows.size:
            when = datetime.fromtimestamp(float(since[rows[0]]), UTC)
            date = f"{when:%Y-%m-%dT%H:%M:%S}.{when.microsecond // 1000:03d}Z"
            found.append(doubt("since_1970", rows.tolist(), unit=unit, when=date))
    return found


def _unheard(observations: Observations) -> list[Note]:
    """Find shots with flash times only: they do not constrain a mass."""
    return [
        doubt("shot_unheard", rows, shot=shot)
        for shot, rows in rows_by(observations.shot).items()
        if all(QUANTITIES[observations.quantity[row]].kind == "flash" for row in rows)
    ]


def _lonely(observations: Observations) -> list[Note]:
    """Find clocks with one reading, which a free offset would fit exactly."""
    by_clock = rows_by(observations.clock, np.isin(observations.quantity, CLOCK_TIMES))
    return [
        doubt("clock_of_one_row", rows, clock=clock)
        for clock, rows in by_clock.items()
        if clock and len(rows) == 1 and len(by_clock) > 1
    ]


def _before_the_flash(observations: Observations) -> list[Note]:
    """Find arrivals before the flash of their shot, on one clock."""
    found = []
    log, sigma = observations, np.nan_to_num(observations.sigma)
    clocks = list(zip(log.shot, log.clocks(), strict=True))
    flash = rows_by(clocks, np.isin(log.quantity, "flash_time_s"))
    for key, rows in rows_by(clocks, np.isin(log.quantity, ARRIVALS)).items():
        for row in rows if key in flash else ():
            seen = flash[key][0]
            # both readings have errors, and light takes no time
            allowed = EARLY_SIGMAS * float(np.hypot(sigma[row], sigma[seen]))
            early = float(log.value[seen] - log.value[row])
            if early > allowed:
                pair = row, seen
                found.append(doubt("arrival_before_flash", pair, early_s=early))
    return found


def places_doubted(observations: Observations) -> list[Note]:
    """Return probable mistakes in the positions of a log's sensors."""
    return [*_moved(observations), *_together(observations)]


def degrees_swapped(observations: Observations) -> list[Note]:
    """Return sensors far from the others, but near them with exchanged coordinates.

    The log must be in degrees, since its frame gives the latitudes and longitudes.
    """
    frame = observations.frame
    sensors = list(rows_by(observations.sensor, _placed(observations)).values())
    if frame is None or len(sensors) < 3:
        return []
    at = observations.position[[rows[0] for rows in sensors]]
    # medians, since one displaced sensor would move a mean by hundreds of kilometres
    middle = np.median(at, axis=0)
    apart = np.linalg.norm(at - middle, axis=1)
    # at least 10 m, as sensors at one mast may be centimetres apart
    far = FAR_RATIO * max(float(np.median(apart)), 1.0)
    found = []
    for rows, place, away in zip(sensors, at, apart.tolist(), strict=True):
        lat, lon, alt = frame.to_geodetic(place).tolist()
        # exchanged coordinates must themselves be possible: a latitude is within 90
        # degrees
        if away < far or abs(lon) > 90.0:
            continue
        swapped = frame.to_enu(lon, lat, alt)
        if np.linalg.norm(swapped - middle) <= away / FAR_RATIO:
            numbers = {"lat_deg": lat, "lon_deg": lon, "apart_m": away}
            found.append(doubt("lat_lon_swapped", rows, **numbers))
    return found


def _moved(observations: Observations) -> list[Note]:
    """Find sensors with several positions within one shot."""
    found, log = [], observations
    sensors = rows_by(zip(log.sensor, log.shot, strict=True), _placed(log))
    for rows in sensors.values():
        apart = np.linalg.norm(log.position[rows] - log.position[rows[0]], axis=1)
        if (apart > POSITION_TOLERANCE).any():
            other = int(np.argmax(apart))
            pair, away = (rows[other], rows[0]), float(apart[other])
            found.append(doubt("sensor_at_two_places", pair, apart_m=away))
    return found


def _together(observations: Observations) -> list[Note]:
    """Find sensors at one position with identical or with inconsistent readings."""
    log, placed = observations, _placed(observations)
    # positions rounded to the tolerance are keys of a dictionary: no comparison of all
    # pairs
    at = np.column_stack([log.position, log.slant_range]) / POSITION_TOLERANCE
    cells = map(tuple, np.round(np.nan_to_num(at, nan=-1e9)).tolist())
    known = placed | ~np.isnan(log.slant_range)
    known &= ~np.isin(log.quantity, (*PLACELESS, *BY_CAMERA))
    found = []
    for rows in rows_by(zip(log.shot, cells, strict=True), known).values():
        readings: dict[str, dict[str, int]] = {}
        for row in rows:
            readings.setdefault(log.sensor[row], {})[log.quantity[row]] = row
        # the number of pairs is quadratic, and ten sensors show the mistake
        for one, other in combinations(list(readings)[:10], 2):
            own, its = readings[one], readings[other]
            pairs = [(own[q], its[q]) for q in own if q in its]
            # two sensors never read all values alike to the last digit: rows were
            # copied
            if pairs and all(log.value[i] == log.value[j] for i, j in pairs):
                copied = [row for pair in pairs for row in reversed(pair)]
                found.append(doubt("sensor_copied", copied, one=one, other=other))
                continue
            # two sensors at one range may be in different directions
            odd = [(j, i) for i, j in pairs if placed[i] and _disagree(log, i, j)]
            found += [doubt("two_sensors_at_one_place", pair) for pair in odd[:1]]
    return found


def _disagree(log: Observations, i: int, j: int) -> bool:
    """Return True if two readings of one quantity differ by more than their errors."""
    pair, quantity = [i, j], log.quantity[i]
    value, scale = log.value[pair], log.error_scale()[pair]
    allowed = ONE_WAVE_SIGMAS * float(np.sqrt(np.nansum(scale**2)))
    if quantity in CLOCK_TIMES:
        # times of different clocks differ by their offset; at least 1 ms, since clock
        # times are often written in milliseconds
        same = log.clock[i] == log.clock[j]
        return same and bool(abs(value[1] - value[0]) > max(allowed, 1e-3))
    if quantity in ADDITIVE:
        return bool(abs(value[1] - value[0]) > (allowed or np.inf))
    least = float(np.log(REFLECTION_FACTOR))
    return bool(abs(np.log(value[1] / value[0])) > max(allowed, least))


def _placed(observations: Observations) -> Bool[np.ndarray, " row"]:
    return np.asarray(~np.isnan(observations.position).any(axis=1))


def sigmas_doubted(observations: Observations) -> list[Note]:
    """Return rows with an implausible sigma."""
    # errors of times and angles have no relation to their size
    in_ln = ~np.isin(observations.quantity, ADDITIVE)
    share = np.where(in_ln, observations.error_scale(), np.nan)
    return [
        doubt(kind, (row,), share=float(share[row]))
        for kind, odd in (
            ("sigma_too_fine", share < FINEST_SIGMA),
            ("sigma_large", share > 1),
        )
        for row in np.flatnonzero(odd).tolist()
    ]
