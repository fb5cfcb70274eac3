"""Checks of a log that need no blast law.

`refusals` lists everything for which a fit would refuse a log with its scene, one fault
a row. The other checks find what a fit would
accept although it is probably a mistake: clock times that are seconds since 1970,
clocks with a single reading, arrivals before the flash, sensors at two positions or
with the readings of another one, exchanged latitude and longitude, and errors smaller
than those of pressure standards or larger than their value.
"""

from contextlib import suppress
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from itertools import combinations

import numpy as np
from jaxtyping import Bool

from jblast.errors import InputError
from jblast.observations.grouping import by_shot, located
from jblast.observations.placement import (
    EARLY_SIGMAS,
    POSITION_TOLERANCE,
    placed,
)
from jblast.observations.scenes import for_log
from jblast.observations.table import SAMPLES, Observations
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
    several = uncertain.scene.others
    # positions and clocks may differ from shot to shot, as between days of a test
    logs = [observations] if several else list(by_shot(observations).values())
    found: dict[str, InputError] = {}
    for log in logs:
        for fault in (*_lawless(log), *_of_log(log, uncertain)):
            # the same fault may be found in the log of every shot, and is reported once
            found.setdefault(str(fault), fault)
    return list(found.values())


def _lawless(log: Observations) -> list[InputError]:
    """Return a fault for each quantity without a law."""
    return [
        log.fault(
            log.quantity.index(quantity), f"no law gives {name}: not supported yet"
        )
        for quantity in dict.fromkeys(log.quantity)
        for name, _ in components(quantity)
        if not names_for(name) and quantity != SAMPLES
    ]


def _of_log(log: Observations, uncertain: UncertainScene) -> list[InputError]:
    """Return the faults of the positions and times of one log with a scene."""
    uncertain = for_log(uncertain, log)
    is_default = uncertain.source == NO_SCENE
    try:
        there = located(log, uncertain)
        scene, beliefs = uncertain.scene, uncertain.beliefs
        return placed(there, scene, beliefs, is_default=is_default)[1]
    except InputError as fault:
        return [fault]


def with_places(observations: Observations, uncertain: UncertainScene) -> Observations:
    """Return a log in the scene's frame, with the sensor positions of the scene."""
    # `refusals` reports a log from another continent
    with suppress(InputError):
        observations = located(observations, uncertain)
    sensors = uncertain.scene.sensors
    known = {sensor.name: np.asarray(sensor.position_m) for sensor in sensors}
    position = observations.position.copy()
    for row in np.flatnonzero(np.isnan(position).any(axis=1)):
        # rows without a position in the log have that of the scene, as in a fit
        position[row] = known.get(observations.sensor[row], position[row])
    return replace(observations, position=position)


@dataclass(frozen=True)
class Doubt:
    """A probable mistake in a log that a fit accepts; worded in `report.check`.

    Attributes:
        kind: A key of `report.check.SENTENCES`.
        rows: Rows of the log that it concerns, the most relevant first.
        numbers: Its evidence in SI units, by name.
        names: Names for its sentence: a clock, a unit, two sensors.
    """

    kind: str
    rows: tuple[int, ...]
    numbers: dict[str, float] = field(default_factory=dict)
    names: tuple[str, ...] = ()


def clocks_doubted(observations: Observations) -> list[Doubt]:
    """Return probable mistakes in the clocks and shots of a log."""
    return [
        *_since_1970(observations),
        *_unheard(observations),
        *_lonely(observations),
        *_before_the_flash(observations),
    ]


def _since_1970(observations: Observations) -> list[Doubt]:
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
            names = unit, f"{when:%Y-%m-%dT%H:%M:%S}.{when.microsecond // 1000:03d}Z"
            found.append(Doubt("since_1970", tuple(rows.tolist()), {}, names))
    return found


def _unheard(observations: Observations) -> list[Doubt]:
    """Find shots with flash times only: they do not constrain a mass."""
    rows: dict[str, list[int]] = {}
    for row, shot in enumerate(observations.shot):
        rows.setdefault(shot, []).append(row)
    return [
        Doubt("shot_unheard", tuple(its), {}, (shot,))
        for shot, its in rows.items()
        if all(QUANTITIES[observations.quantity[row]].kind == "flash" for row in its)
    ]


def _lonely(observations: Observations) -> list[Doubt]:
    """Find clocks with one reading, which a free offset would fit exactly."""
    timed = np.isin(observations.quantity, CLOCK_TIMES)
    rows: dict[str, list[int]] = {}
    for row in np.flatnonzero(timed):
        rows.setdefault(observations.clock[row], []).append(int(row))
    return [
        Doubt("clock_of_one_row", tuple(its), {}, (clock,))
        for clock, its in rows.items()
        if clock and len(its) == 1 and len(rows) > 1
    ]


def _before_the_flash(observations: Observations) -> list[Doubt]:
    """Find arrivals before the flash of their shot, on one clock."""
    found = []
    flash: dict[tuple[str, str], int] = {}
    quantity, value = observations.quantity, observations.value
    sigma = np.nan_to_num(observations.sigma)
    by = [
        (shot, clock or sensor)
        for shot, clock, sensor in zip(
            observations.shot, observations.clock, observations.sensor, strict=True
        )
    ]
    for row, key in enumerate(by):
        if quantity[row] == "flash_time_s":
            flash.setdefault(key, row)
    for row, key in enumerate(by):
        if quantity[row] not in ARRIVALS or key not in flash:
            continue
        seen = flash[key]
        # both readings have errors, and light takes no time
        allowed = EARLY_SIGMAS * float(np.hypot(sigma[row], sigma[seen]))
        if value[row] + allowed < value[seen]:
            early = float(value[seen] - value[row])
            found.append(Doubt("arrival_before_flash", (row, seen), {"early_s": early}))
    return found


def places_doubted(observations: Observations) -> list[Doubt]:
    """Return probable mistakes in the positions of a log's sensors."""
    return [*_moved(observations), *_together(observations)]


def degrees_swapped(observations: Observations) -> list[Doubt]:
    """Return sensors far from the others, but near them with exchanged coordinates.

    The log must be in degrees, since its frame gives the latitudes and longitudes.
    """
    frame = observations.frame
    first: dict[str, list[int]] = {}
    for row in np.flatnonzero(_placed(observations)):
        first.setdefault(observations.sensor[row], []).append(int(row))
    if frame is None or len(first) < 3:
        return []
    at = observations.position[[rows[0] for rows in first.values()]]
    # medians, since one displaced sensor would move a mean by hundreds of kilometres
    middle = np.median(at, axis=0)
    apart = np.linalg.norm(at - middle, axis=1)
    spread = float(np.median(apart))
    found = []
    for rows, place, far in zip(first.values(), at, apart, strict=True):
        # at least 10 m, as sensors at one mast may be centimetres apart
        if far < FAR_RATIO * max(spread, 1.0):
            continue
        lat, lon, alt = frame.to_geodetic(place).tolist()
        # exchanged coordinates must themselves be possible: a latitude is within 90
        # degrees
        swapped = frame.to_enu(lon, lat, alt) if abs(lon) <= 90.0 else None
        if swapped is None or np.linalg.norm(swapped - middle) > far / FAR_RATIO:
            continue
        numbers = {"lat_deg": lat, "lon_deg": lon, "apart_m": float(far)}
        found.append(Doubt("lat_lon_swapped", tuple(rows), numbers))
    return found


def _moved(observations: Observations) -> list[Doubt]:
    """Find sensors with several positions within one shot."""
    found = []
    placed = _placed(observations)
    rows: dict[tuple[str, str], list[int]] = {}
    for row in np.flatnonzero(placed):
        key = observations.sensor[row], observations.shot[row]
        rows.setdefault(key, []).append(int(row))
    for its in rows.values():
        at = observations.position[its]
        apart = np.linalg.norm(at - at[0], axis=1)
        if (apart > POSITION_TOLERANCE).any():
            other = int(np.argmax(apart))
            found.append(
                Doubt(
                    "sensor_at_two_places",
                    (its[other], its[0]),
                    {"apart_m": float(apart[other])},
                )
            )
    return found


def _together(observations: Observations) -> list[Doubt]:
    """Find sensors at one position with identical or with inconsistent readings."""
    first: dict[tuple[str, str], int] = {}
    ranged = ~np.isnan(observations.slant_range)
    for row in np.flatnonzero(_placed(observations) | ranged):
        key = observations.shot[row], observations.sensor[row]
        first.setdefault(key, int(row))
    by_cell: dict[tuple[object, ...], list[str]] = {}
    for (shot, sensor), row in first.items():
        placed = [*observations.position[row], observations.slant_range[row]]
        # positions rounded to the tolerance are keys of a dictionary: no comparison of
        # all pairs
        cell = np.round(np.nan_to_num(placed, nan=-1.0) / POSITION_TOLERANCE).tolist()
        by_cell.setdefault((shot, *cell), []).append(sensor)
    found = []
    for (shot, *_), sensors in by_cell.items():
        # the number of pairs is quadratic, and ten sensors show the mistake
        for one, other in combinations(sensors[:10], 2):
            doubts = _compared(observations, str(shot), one, other)
            here = _placed(observations)[first[str(shot), one]]
            # two sensors at one range may be in different directions
            found += [
                doubt for doubt in doubts if here or doubt.kind == "sensor_copied"
            ]
    return found


def _compared(
    observations: Observations, shot: str, one: str, other: str
) -> list[Doubt]:
    """Compare the readings of two sensors at one position in one shot."""
    own, its = (
        {
            quantity: row
            for row, quantity in enumerate(observations.quantity)
            if (observations.sensor[row], observations.shot[row]) == (name, shot)
            and quantity not in (*PLACELESS, *BY_CAMERA)
        }
        for name in (one, other)
    )
    both = [q for q in own if q in its]
    pairs = [(own[q], its[q]) for q in both]
    if not pairs:
        return []
    # two sensors never read all values alike to the last digit: rows were copied
    if all(observations.value[i] == observations.value[j] for i, j in pairs):
        rows = tuple(row for pair in pairs for row in reversed(pair))
        return [Doubt("sensor_copied", rows, {}, (one, other))]
    for i, j in pairs:
        timed = observations.quantity[i] in CLOCK_TIMES
        # times of different clocks differ by their offset
        if timed and observations.clock[i] != observations.clock[j]:
            continue
        apart, allowed = _difference(observations, i, j)
        if apart > allowed:
            return [Doubt("two_sensors_at_one_place", (j, i))]
    return []


def _difference(observations: Observations, i: int, j: int) -> tuple[float, float]:
    """Return the difference of two readings, and the largest allowed one."""
    pair = [i, j]
    value, scale = observations.value[pair], observations.error_scale()[pair]
    error = ONE_WAVE_SIGMAS * float(np.sqrt(np.nansum(scale**2)))
    if observations.quantity[i] in CLOCK_TIMES:
        # at least 1 ms, since clock times are often written in milliseconds
        return float(abs(value[1] - value[0])), max(error, 1e-3)
    # angles and differences
    if (value <= 0).any():
        return float(abs(value[1] - value[0])), error or float("inf")
    return float(abs(np.log(value[1] / value[0]))), max(
        error, float(np.log(REFLECTION_FACTOR))
    )


def _placed(observations: Observations) -> Bool[np.ndarray, " row"]:
    return np.asarray(~np.isnan(observations.position).any(axis=1))


def sigmas_doubted(observations: Observations) -> list[Doubt]:
    """Return rows with an implausible sigma."""
    value, sigma = observations.value, observations.sigma
    # errors of times and angles have no relation to their size
    in_ln = ~np.isin(observations.quantity, ADDITIVE)
    stated = in_ln & ~np.isnan(sigma) & (value > 0)
    share = np.full(len(value), np.nan)
    share[stated] = sigma[stated] / value[stated]
    found = []
    for kind, odd in (
        ("sigma_too_fine", share < FINEST_SIGMA),
        ("sigma_large", share > 1),
    ):
        for row in np.flatnonzero(odd):
            found.append(Doubt(kind, (int(row),), {"share": float(share[row])}))
    return found
