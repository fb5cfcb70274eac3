"""All that is odd about a log: what needs no physics, and what no blast explains."""

from collections.abc import Mapping

import numpy as np

from jblast.inference.sanity.consensus import Agreement
from jblast.inference.sanity.magnitudes import (
    magnitudes_doubted,
    radii_doubted,
    rising_peaks,
)
from jblast.inference.sanity.readings import Readings, readings_of
from jblast.inference.sanity.scaled_laws import ScaledLaws, scaled_laws
from jblast.inference.sanity.slips import (
    slip_of_clock,
    slip_of_quantity,
    slip_of_sensor,
    slip_of_value,
)
from jblast.inference.sanity.speeds import slow_between, speeds_doubted
from jblast.inference.sanity.supposed import supposed_blast
from jblast.observations import Observations, some_rows
from jblast.observations.check import (
    Doubt,
    clocks_doubted,
    degrees_swapped,
    places_doubted,
    sigmas_doubted,
)
from jblast.observations.scenes import for_log
from jblast.scene import Charge, UncertainScene


def doubts(observations: Observations, uncertain: UncertainScene) -> list[Doubt]:
    """Return what is odd about a log: nothing that stops a fit, all worth a look.

    Rows are held against blasts of any mass, where the scene has the charge; without a
    scene, or where its place is free, from anywhere. A row is doubted once.

    Args:
        observations: The log; its places filled in from the scene (`resolve_positions`)
            if they can be.
        uncertain: The scene.

    Returns:
        Doubts in the order of the log's lines.
    """
    with np.errstate(all="ignore"):  # past all numbers is far off, and nothing else
        found = [
            *degrees_swapped(observations),
            *clocks_doubted(observations),
            *_physical(observations, uncertain),
            *places_doubted(observations),
            *sigmas_doubted(observations),
            *radii_doubted(observations),
        ]
    return sorted(_once(found), key=lambda doubt: doubt.rows[0])


def _physical(observations: Observations, uncertain: UncertainScene) -> list[Doubt]:
    """Return what no blast explains, shot by shot."""
    doubted = []
    laws = scaled_laws(uncertain.scene)
    for rows, charge, label in _shots(observations, uncertain):
        its = for_log(uncertain, some_rows(observations, rows))
        readings = readings_of(observations, its.scene, rows, its.beliefs)
        if len(readings.row):
            doubted += _of_shot(observations, readings, laws, charge, its, label)
    return doubted


def _shots(observations: Observations, uncertain: UncertainScene):
    """Yield the rows of each shot, its charge, and what names of the scene end in."""
    scene = uncertain.scene
    named = {charge.name: charge for charge in scene.charges}
    shots = np.array(observations.shot)
    for shot in dict.fromkeys(observations.shot):
        charge = named.get(shot, scene.charge) if scene.others else scene.charge
        yield np.flatnonzero(shots == shot), charge, scene.label(charge)


def _of_shot(
    observations: Observations,
    readings: Readings,
    laws: ScaledLaws,
    charge: Charge,
    uncertain: UncertainScene,
    label: str,
) -> list[Doubt]:
    """Return what is odd about the rows of one shot."""
    supposed = supposed_blast(readings, laws, charge, uncertain, label)
    readings, found = supposed.readings, supposed.found
    if supposed.said is not None:
        column = slip_of_quantity(readings, laws, supposed.said, supposed.said_origin)
        if column is not None:
            return [column, *slow_between(readings)]
    doubted = [supposed.doubt] if supposed.doubt else []
    if found is not None and found.holds():
        doubted += _named(observations, readings, laws, found)
    elif found is not None and not doubted:
        doubted += _divided(readings, found)
    return [
        *doubted,
        *speeds_doubted(readings, laws, supposed.distance, supposed.origin),
        *magnitudes_doubted(readings, laws, supposed.distance),
        *rising_peaks(readings, supposed.distance),
        *slow_between(readings),
    ]


def _named(
    observations: Observations, readings: Readings, laws: ScaledLaws, found: Agreement
) -> list[Doubt]:
    """Name the slip of each row that is off, or say that it is off."""
    off = np.flatnonzero(found.off & found.checkable)
    doubted, done = [], set()
    by_sensor: dict[str, list[int]] = {}
    for i, row in enumerate(readings.row):
        by_sensor.setdefault(observations.sensor[row], []).append(i)
    for i in off:
        sensor = observations.sensor[readings.row[i]]
        its = by_sensor[sensor]
        if i in done:
            continue
        bad = [j for j in its if found.off[j] and found.checkable[j]]
        rows = tuple(int(readings.row[j]) for j in bad)
        late = slip_of_clock(readings, found, its)
        if late:
            timed = [j for j in bad if readings.timed[j]]
            of = tuple(int(readings.row[j]) for j in timed)
            doubted.append(
                Doubt("clock_of_another_zone", of, {"late_s": late}, (sensor,))
            )
            done.update(timed)
            if i in done:
                continue
        moved = slip_of_sensor(readings, laws, found, its)
        if moved is not None and len(bad) == len(its):
            kind, east, north = moved
            doubted.append(
                Doubt(kind, rows, {"east_m": east, "north_m": north}, (sensor,))
            )
            done.update(bad)
            continue
        doubted.append(_off(readings, laws, found, int(i)))
    return doubted


def _off(readings: Readings, laws: ScaledLaws, found: Agreement, i: int) -> Doubt:
    """Name the unit of one row, or say how far it is off."""
    row, quantity = (int(readings.row[i]),), readings.quantity[i]
    slip = slip_of_value(readings, laws, found, i)
    numbers = {"mass_kg": found.mass}
    if slip is not None:
        name, factor = slip
        return Doubt("unit_slip", row, numbers | {"factor": factor}, (quantity, name))
    residual = float(found.residual[i])
    if readings.timed[i]:
        return Doubt("off_in_time", row, numbers | {"late_s": residual}, (quantity,))
    ratio = {"ratio": float(np.exp(residual))}
    return Doubt("off_by_factor", row, numbers | ratio, (quantity,))


def _divided(readings: Readings, found: Agreement) -> list[Doubt]:
    """Say that the rows of a shot are of no one blast, where none can be blamed."""
    checkable = int(found.checkable.sum())
    agree = int((found.checkable & ~found.off).sum())
    if checkable < 2 or agree == checkable:
        return []
    off = np.flatnonzero(found.off & found.checkable)
    rows = tuple(int(readings.row[i]) for i in off)
    return [
        Doubt(
            "of_no_one_blast", rows, {"agree": float(agree), "rows": float(checkable)}
        )
    ]


def _once(found: list[Doubt]) -> list[Doubt]:
    """Keep one doubt a row, the first, which names most; none by a doubted row."""
    seen: set[int] = set()
    kept = []
    for doubt in found:
        if doubt.kind in OF_ALL:
            kept.append(doubt)
        elif not seen & set(doubt.rows):
            kept.append(doubt)
            seen.update(doubt.rows if doubt.kind not in TWO_SIDED else doubt.rows[:1])
    return kept


OF_ALL = ("not_at_the_origin", "not_at_time_0", "clock_of_one_row")
"""Doubts that say nothing against a row."""


TWO_SIDED: Mapping[str, str] = {
    "too_slow_between": "the other arrival",
    "peak_rises": "the nearer peak",
    "two_sensors_at_one_place": "the other sensor",
    "sensor_at_two_places": "its first place",
    "radius_shrinks": "the radius before",
}
"""Doubts about one row by another one, which is not doubted itself."""
