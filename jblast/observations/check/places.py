"""Doubts about where sensors stand: two at one place, one at two, one copied."""

from itertools import combinations

import numpy as np
from jaxtyping import Bool

from jblast.observations.check.doubt import Doubt
from jblast.observations.table import Observations
from jblast.quantities import BY_CAMERA, CLOCK_TIMES, PLACELESS

SAME_PLACE = 1e-3
"""Sensors this close stand at one place [m], as near as places are compared."""
APART = 6.0
"""Readings at one place this many sigmas apart are not of one wave."""
FAR_OFF = 10.0
"""A sensor this many times as far off as the others, by the median, is not of them."""
FACTOR = 2.0
"""Likewise without a sigma: a pressure this much larger could be a reflection's."""


def places_doubted(observations: Observations) -> list[Doubt]:
    """Return what is odd about the places of a log's sensors."""
    return [*_moved(observations), *_together(observations)]


def degrees_swapped(observations: Observations) -> list[Doubt]:
    """Return sensors far from all others that would be among them with axes swapped.

    Of a log in degrees, whose frame says which they were.
    """
    frame = observations.frame
    first: dict[str, list[int]] = {}
    for row in np.flatnonzero(_placed(observations)):
        first.setdefault(observations.sensor[row], []).append(int(row))
    if frame is None or len(first) < 3:
        return []
    at = observations.position[[rows[0] for rows in first.values()]]
    middle = np.median(at, axis=0)
    apart = np.linalg.norm(at - middle, axis=1)
    spread = float(np.median(apart))
    found = []
    for (sensor, rows), place, far in zip(first.items(), at, apart, strict=True):
        if far < FAR_OFF * max(spread, 1.0):
            continue
        lat, lon, alt = frame.to_geodetic(place).tolist()
        swapped = frame.to_enu(lon, lat, alt) if abs(lon) <= 90.0 else None
        if swapped is None or np.linalg.norm(swapped - middle) > far / FAR_OFF:
            continue
        numbers = {"lat_deg": lat, "lon_deg": lon, "apart_m": float(far)}
        found.append(Doubt("lat_lon_swapped", tuple(rows), numbers, (sensor,)))
    return found


def _moved(observations: Observations) -> list[Doubt]:
    """Find sensors that the log puts at several places within one shot."""
    found = []
    placed = _placed(observations)
    rows: dict[tuple[str, str], list[int]] = {}
    for row in np.flatnonzero(placed):
        key = observations.sensor[row], observations.shot[row]
        rows.setdefault(key, []).append(int(row))
    for (sensor, _), its in rows.items():
        at = observations.position[its]
        apart = np.linalg.norm(at - at[0], axis=1)
        if (apart > SAME_PLACE).any():
            other = int(np.argmax(apart))
            found.append(
                Doubt(
                    "sensor_at_two_places",
                    (its[other], its[0]),
                    {"apart_m": float(apart[other])},
                    (sensor,),
                )
            )
    return found


def _together(observations: Observations) -> list[Doubt]:
    """Find sensors at one place that read alike to the digit, or differently."""
    first: dict[tuple[str, str], int] = {}
    ranged = ~np.isnan(observations.slant_range)
    for row in np.flatnonzero(_placed(observations) | ranged):
        key = observations.shot[row], observations.sensor[row]
        first.setdefault(key, int(row))
    by_cell: dict[tuple[object, ...], list[str]] = {}
    for (shot, sensor), row in first.items():
        placed = [*observations.position[row], observations.slant_range[row]]
        cell = np.round(np.nan_to_num(placed, nan=-1.0) / SAME_PLACE).tolist()
        by_cell.setdefault((shot, *cell), []).append(sensor)
    found = []
    for (shot, *_), sensors in by_cell.items():
        for one, other in combinations(sensors[:10], 2):
            doubts = _compared(observations, str(shot), one, other)
            here = _placed(observations)[first[str(shot), one]]
            # at one range two sensors may well read differently
            found += [
                doubt for doubt in doubts if here or doubt.kind == "sensor_copied"
            ]
    return found


def _compared(
    observations: Observations, shot: str, one: str, other: str
) -> list[Doubt]:
    """Compare what two sensors at one place read of one shot."""
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
    if all(observations.value[i] == observations.value[j] for i, j in pairs):
        rows = tuple(row for pair in pairs for row in reversed(pair))
        return [Doubt("sensor_copied", rows, {}, (one, other))]
    for i, j in pairs:
        if _clocks_differ(observations, i, j):
            continue
        apart, allowed = _difference(observations, i, j)
        if apart > allowed:
            return [
                Doubt(
                    "two_sensors_at_one_place",
                    (j, i),
                    {
                        "value": float(observations.value[j]),
                        "other": float(observations.value[i]),
                    },
                    (other, one),
                )
            ]
    return []


def _difference(observations: Observations, i: int, j: int) -> tuple[float, float]:
    """Return how far two readings are apart, and how far they may be."""
    pair = [i, j]
    value, scale = observations.value[pair], observations.error_scale()[pair]
    error = APART * float(np.sqrt(np.nansum(scale**2)))
    if observations.quantity[i] in CLOCK_TIMES:
        return float(abs(value[1] - value[0])), max(error, 1e-3)
    if (value <= 0).any():  # angles and differences
        return float(abs(value[1] - value[0])), error or float("inf")
    return float(abs(np.log(value[1] / value[0]))), max(error, float(np.log(FACTOR)))


def _clocks_differ(observations: Observations, i: int, j: int) -> bool:
    timed = observations.quantity[i] in CLOCK_TIMES
    return timed and observations.clock[i] != observations.clock[j]


def _placed(observations: Observations) -> Bool[np.ndarray, " row"]:
    return np.asarray(~np.isnan(observations.position).any(axis=1))
