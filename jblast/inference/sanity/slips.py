"""Which slip of the pen explains a row that no blast does: named, never mended."""

from collections.abc import Iterator

import numpy as np
from jaxtyping import Bool, Float

from jblast.inference.sanity.consensus import Agreement, at_place
from jblast.inference.sanity.readings import Readings
from jblast.inference.sanity.scaled_laws import ScaledLaws
from jblast.observations.check import Doubt
from jblast.quantities import QUANTITIES

POUND_FORCE_PER_INCH2 = 6894.757
"""A psi in pascals: NIST SP 811 (2008), appendix B."""
FOOT = 0.3048
"""In metres, exact: NIST SP 811 (2008), appendix B."""
HALF_HOUR = 1800.0
"""Zones of time differ by whole quarters of an hour, nearly all by halves."""
LATEST = 26 * 3600.0
"""The largest difference of two zones (UTC-12 and UTC+14) [s]."""

PRICE = 3
"""Of a slip, in numbers that are found from the rows: that of a row that is off."""

_MILLI = {"a thousand times": 1e3, "a thousandth of": 1e-3}
_PSI = {
    "psi written as kPa": 1e3 / POUND_FORCE_PER_INCH2,
    "kPa written as psi": POUND_FORCE_PER_INCH2 / 1e3,
    "psi written as Pa": 1 / POUND_FORCE_PER_INCH2,
    "Pa written as psi": POUND_FORCE_PER_INCH2,
}
_PRESSURE = {"mbar written as Pa": 1e-2, "Pa written as mbar": 1e2}
_BAR = {"bar written as Pa": 1e-5, "Pa written as bar": 1e5}
_TIME = {"minutes written as seconds": 1 / 60, "seconds written as minutes": 60.0}
FACTORS: dict[str, dict[str, float]] = {
    "pressure": {**_MILLI, **_PSI, **_PRESSURE, **_BAR},
    "impulse": {**_MILLI, **_PSI},
    "duration": {**_MILLI, **_TIME},
    "arrival": {**_MILLI, **_TIME},
}
"""By kind of quantity: what a value with the wrong unit is to the right one."""
NEAR = 0.6
"""What a slip may leave, as a share of what is allowed: a psi is 6.9 kPa."""


def slip_of_sensor(
    readings: Readings, laws: ScaledLaws, found: Agreement, sensor: list[int]
) -> tuple[str, float, float] | None:
    """Name the slip of a sensor's place that makes all its rows agree.

    Args:
        readings: The rows of the shot.
        laws: Of a kilogram.
        found: The blast that the others agree on.
        sensor: Which readings are the sensor's.

    Returns:
        The kind of slip, east and north as they would be [m]; None if there is none.
    """
    at = readings.position[sensor[0]]
    if np.isnan(at).any() or not found.off[sensor].any():
        return None
    others = {
        "east_north_swapped": at[[1, 0, 2]],
        "place_in_feet": at * FOOT,
        "place_in_km": at * 1e3,
        "sign_of_east": at * [-1, 1, 1],
        "sign_of_north": at * [1, -1, 1],
    }
    for kind, place in others.items():
        if np.linalg.norm(place - at) < 1.0:
            continue
        its = readings.only(np.array(sensor))
        its = its.but(position=np.broadcast_to(place, its.position.shape))
        score = _scores(its, laws, found, found.offset[sensor])
        if (np.abs(score) <= NEAR).all():
            return kind, float(place[0]), float(place[1])
    return None


def slip_of_clock(readings: Readings, found: Agreement, rows: list[int]) -> float:
    """Return by how many seconds a sensor's clock is off, if that is a zone's; or 0."""
    off = [i for i in rows if readings.timed[i] and found.off[i]]
    if not off:
        return 0.0
    late = found.residual[off]
    steps = np.round(late / HALF_HOUR)
    same = (steps == steps[0]).all() and 0 < abs(steps[0]) * HALF_HOUR <= LATEST
    travel = np.abs(late - steps * HALF_HOUR)
    return float(steps[0] * HALF_HOUR) if same and (travel < 60.0).all() else 0.0


def slip_of_value(
    readings: Readings, laws: ScaledLaws, found: Agreement, i: int
) -> tuple[str, float] | None:
    """Name the unit in which a reading would agree, and its factor; None if in none."""
    its = readings.only(np.array([i]))
    best: tuple[float, str, float] | None = None
    for name, factor in FACTORS.get(QUANTITIES[its.quantity[0]].kind, {}).items():
        changed = _rescaled(its, np.array([True]), factor)
        left = abs(float(_scores(changed, laws, found, found.offset[[i]])[0]))
        if left <= NEAR and (best is None or left < best[0]):
            best = left, name, factor
    return best[1:] if best else None


def slip_of_quantity(
    readings: Readings,
    laws: ScaledLaws,
    before: Agreement,
    origin: float | None,
) -> Doubt | None:
    """Name the unit in which all rows of one quantity would agree with the others."""
    kinds = [q for q in dict.fromkeys(readings.quantity) if q != "flash_time_s"]
    if len(kinds) < 2 or not before.off.any():
        return None
    for quantity, name, factor in _columns(kinds):
        here = np.array([q == quantity for q in readings.quantity])
        if here.sum() < 2:
            continue
        changed = _rescaled(readings, here, factor)
        after = at_place(changed, laws, before.place, origin)
        if after.all_agree() and after.price() + PRICE < before.price():
            rows = tuple(int(row) for row in readings.row[here])
            numbers = {"factor": factor}
            return Doubt("units_of_a_quantity", rows, numbers, (quantity, name))
    return None


def _columns(kinds: list[str]) -> Iterator[tuple[str, str, float]]:
    for quantity in kinds:
        for name, factor in FACTORS.get(QUANTITIES[quantity].kind, {}).items():
            yield quantity, name, factor


def _rescaled(
    readings: Readings, here: Bool[np.ndarray, " n"], factor: float
) -> Readings:
    value = readings.value.copy()
    timed = readings.timed & here
    value[timed] /= factor
    value[here & ~timed] -= np.log(factor)
    return readings.but(value=value)


def _scores(
    readings: Readings,
    laws: ScaledLaws,
    found: Agreement,
    offset: Float[np.ndarray, " n"],
) -> Float[np.ndarray, " n"]:
    """Hold changed readings against the blast that was found, its clocks kept."""
    place, mass = found.place[None], np.array([found.mass])
    distance = readings.distances(place)
    travelled = readings.travelled(laws, distance, mass)
    allowed = readings.allowed(np.where(readings.timed, travelled, 0.0), distance)
    return ((readings.value - travelled - offset) / allowed)[0]
