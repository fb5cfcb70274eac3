"""Warnings about a log: implausible rows, and mistakes that would explain them.

A warning never stops a fit. Checks of clocks, positions and errors need no physics.
Three checks compare rows with blasts of any mass:

- magnitudes: a reading that no mass gives at its distance, a peak that rises with
  distance, a shock radius that shrinks;
- speeds: the front runs at the speed of sound or faster. So a wave from anywhere
  reaches two positions at most $d / (c - w)$ apart in time, $d$ their distance, $c$ the
  speed of sound in the coldest air and $w$ a wind against the wave. From a known charge
  it takes no longer than that, and no less than a law gives next to the charge. All
  arrivals together give a speed from wherever they agree best;
- consensus: a row that disagrees with the blast on which most rows of its shot agree
  (see `consensus`).

For rows that disagree, common mistakes are tried: exchanged coordinates, a wrong sign
or unit of a position, a clock in another time zone, another unit of a reading or of all
readings of a quantity. The readings are corrected and compared with the blast again. Of
the mistakes that bring their rows into agreement, the one that explains most rows is
named in the warning. The log is not changed.
"""

import warnings
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
from jaxtyping import Float, Int
from scipy.special import stdtrit

from jblast.constants import AIR_HEAT_CAPACITY_RATIO, DRY_AIR_GAS_CONSTANT, FOOT
from jblast.inference.consensus import (
    CLOCK_STEP,
    FACTORS,
    MAX_MASS,
    MIN_MASS,
    SIGMAS,
    STRATOSPHERE_RANGE,
    WITH_MASS,
    Blast,
    Readings,
    ScaledLaws,
    blast_of,
    readings_of,
    scaled_laws,
)
from jblast.observations import Observations, some_rows
from jblast.observations.check import (
    clocks_doubted,
    degrees_swapped,
    doubt,
    places_doubted,
    sigmas_doubted,
)
from jblast.observations.scenes import far_from_origin, for_log
from jblast.quantities import QUANTITIES
from jblast.results import Note, warning
from jblast.scene import Charge, UncertainScene
from jblast.waves.fireballs import LARGEST_RADIUS
from jblast.waves.propagation import sound_speed_of

FREE = {"not_at_the_origin": "charge_east_m", "not_at_time_0": "origin_time_s"}
"""Parameter that a fit has to free: no warning where it does so without a scene."""
OF_ALL = (*FREE, "clock_of_one_row")
"""Warnings about the whole log."""
TWO_SIDED = (
    *("too_slow_between", "peak_rises", "radius_shrinks"),
    *("two_sensors_at_one_place", "sensor_at_two_places"),
)
"""Warnings about one row by comparison with another, which is not suspect itself."""
BESIDE_A_RISE = ("place_in_feet", "off_by_factor")
"""Warnings about one row that do not suppress that of a rising peak. A distance in feet
changes a peak by a factor of 3 to 6, a reflection by 2 to 8: one peak cannot decide."""
FIREBALL_MASS = 1e4
"""Mass above which no gauge is set within the fireball [kg] (declared)."""
SHRINKS = 2.0
"""Ratio of an earlier to a later radius that the scatter of records (10 to 20 %) cannot
explain."""
SCATTER = 0.12
"""Scale of one recorded peak about the level of its shot, up to Z = 200 [ln]: Student-t
with 4 degrees of freedom (`calibration/far_pressure.py`)."""
BY_CHANCE = 0.02
"""Share of logs without a mistake in which scatter gives a rise that is reported.
Simulated with 3 to 100 gauges over a decade of range: 1.2 to 4.0 % of logs."""
COLDEST_SOUND = float(np.sqrt(AIR_HEAT_CAPACITY_RATIO * DRY_AIR_GAS_CONSTANT * 222.15))
"""Speed of sound in severe cold [m/s]: -51 C, climatic category C3 of MIL-STD-810."""
GALE = 20.7
"""Largest wind in which blasts are measured [m/s]: upper limit of Beaufort 8 (WMO)."""
SLOWEST = COLDEST_SOUND - GALE
"""Lowest speed of a wave in air near the ground [m/s]: 278."""
SLOWEST_THERMOSPHERE = 180.0
"""Lowest celerity of infrasound through the thermosphere [m/s], beyond
`STRATOSPHERE_RANGE` (Negraru et al., J. Geophys. Res. 115, D15110, 2010; read
second-hand)."""
TRAVEL_SCATTER = 0.01
"""Scatter of travel times about a law, of a shot and of a path, as laws declare it."""
MAX_COMPARED = 1000
"""Largest number of readings that are compared in pairs: 8 MB for each array."""
HALF_HOUR = 1800.0
"""Step of time zones [s]: they differ by quarters of an hour, nearly all by halves."""
LATEST = 26 * 3600.0
"""Largest difference of two zones [s]: from UTC-12 to UTC+14."""
MISTAKE_MARGIN = 0.6
"""Largest residual after the correction of a mistake, relative to the tolerance. Below
1 it separates neighbouring factors: a psi is 6.9 kPa, and a factor of 3 is
tolerated."""
PLACES = {
    "east_north_swapped": [[0, 1, 0], [1, 0, 0], [0, 0, 1]],
    "place_in_feet": np.eye(3) * FOOT,
    "place_in_km": np.eye(3) * 1e3,
    "sign_of_east": np.diag([-1, 1, 1]),
    "sign_of_north": np.diag([1, -1, 1]),
}
"""Matrix that gives the true position of a sensor, by the mistake in its position."""


def doubts(observations: Observations, uncertain: UncertainScene) -> list[Note]:
    """Return warnings about a log; none of them stops a fit.

    Rows are compared with blasts of any mass at the position of the scene; without a
    scene, or with a free position, at any position. A row has one warning at most.

    Args:
        observations: The log, with positions from the scene (`resolve_positions`) where
            possible.
        uncertain: The scene.

    Returns:
        Warnings in the order of the log's lines.
    """
    # overflow to inf, or NaN: the row disagrees, and is reported as such
    with np.errstate(all="ignore"):
        found = [
            *degrees_swapped(observations),
            *clocks_doubted(observations),
            *_physical(observations, uncertain),
            *places_doubted(observations),
            *sigmas_doubted(observations),
            *radii_doubted(observations),
        ]
    return sorted(_once(found), key=lambda one: one["rows"][0])


def _once(found: list[Note]) -> list[Note]:
    """Return one warning per row, the first, which is the most specific.

    Warnings by comparison with a suspect row are dropped. The warning that no blast
    explains a shot is kept if it concerns a further row. A rise of peaks is kept if the
    warning about its larger peak does not explain it better (`BESIDE_A_RISE`).
    """
    seen: dict[int, Note] = {}
    kept = []
    for note in found:
        known = [seen.get(row) for row in note["rows"]]
        if note.kind == "peak_rises" and known[0] and len(known[0]["rows"]) == 1:
            known = known[known[0].kind in BESIDE_A_RISE :]
        is_new = None in known if note.kind == "of_no_one_blast" else not any(known)
        if is_new or note.kind in OF_ALL:
            kept.append(note)
        if is_new and note.kind not in OF_ALL:
            suspect = note["rows"][: 1 if note.kind in TWO_SIDED else None]
            seen |= dict.fromkeys(suspect, note)
    return kept


def _physical(observations: Observations, uncertain: UncertainScene) -> list[Note]:
    """Return the warnings by comparison with blasts, shot by shot."""
    doubted = []
    laws, scene = scaled_laws(uncertain.scene), uncertain.scene
    named = (
        {charge.name: charge for charge in scene.charges}
        if len(scene.charges) > 1
        else {}
    )
    shots = np.array(observations.shot)
    for shot in dict.fromkeys(observations.shot):
        rows = np.flatnonzero(shots == shot)
        its = for_log(uncertain, some_rows(observations, rows))
        # first at the origin at time 0, as in logs with ranges: it decides most
        on_earth = observations.frame is not None or observations.epoch is not None
        on_map = far_from_origin(observations.position[rows])
        there = its if on_earth or on_map else uncertain
        charge = named.get(shot, there.scene.charge)
        readings = readings_of(observations, there.scene, rows, there.beliefs)
        if len(readings.row):
            found = _of_shot(observations, readings, laws, charge, there)
            doubted += [one for one in found if FREE.get(one.kind) not in its.beliefs]
    return doubted


def _of_shot(
    observations: Observations,
    readings: Readings,
    laws: ScaledLaws,
    charge: Charge,
    uncertain: UncertainScene,
) -> list[Note]:
    """Return the warnings about the rows of one shot, the most specific first."""
    label = uncertain.scene.label(charge)
    blast = blast_of(readings, laws, charge, uncertain, label)
    doubted = [blast.doubt] if blast.doubt else []
    # with a known origin and known distances each arrival has its own speed instead
    if blast.origin is None or np.isnan(blast.distance).any():
        slowest = SLOWEST
        if {"air_sound_speed_m_s", "air_temperature_k"}.isdisjoint(uncertain.beliefs):
            slowest = float(sound_speed_of(uncertain.scene.air)) - GALE
        doubted += slow_together(blast, slowest)
    divided = []
    if blast.holds():
        doubted += _mistakes(observations, blast, laws)
    elif blast.off.any() and blast.checkable > 1 and not doubted:
        rows, counts = blast.readings.row[blast.off], (blast.agree, blast.checkable)
        agree, of = map(int, counts)
        divided = [doubt("of_no_one_blast", rows.tolist(), agree=agree, of=of)]
    return [
        *doubted,
        *speeds_doubted(blast, laws),
        *magnitudes_doubted(blast.readings, laws, blast.distance),
        *rising_peaks(blast.readings, blast.distance),
        *divided,  # last: used for rows without a more specific warning
    ]


def _mistakes(observations: Observations, blast: Blast, laws: ScaledLaws) -> list[Note]:
    """Return the mistakes that explain most of the rows that disagree."""
    readings, doubted = blast.readings, []
    place, mass = blast.place[None], np.array([blast.mass])
    # by sensor: a wrong position or clock affects all of its rows
    by_sensor: dict[str, list[int]] = {}
    for i, row in enumerate(readings.row):
        by_sensor.setdefault(observations.sensor[row], []).append(i)
    for its in map(np.array, by_sensor.values()):
        off = its[blast.off[its]]
        explained = []
        for here, corrected, note in _corrections(blast, its, off):
            offset = blast.offset[here][None]
            residual, allowed, _ = corrected.compared(laws, place, mass, offset=offset)
            if (np.abs(residual) <= MISTAKE_MARGIN * allowed).all():
                explained.append((here, note))
        # the mistake that explains most rows comes first
        explained.sort(key=lambda one: -blast.off[one[0]].sum())
        for i in off:
            kind, numbers = "off_by_factor", {"ratio": float(np.exp(blast.residual[i]))}
            if readings.timed[i]:
                kind, numbers = "off_in_time", {"late_s": float(blast.residual[i])}
            numbers["mass_kg"] = blast.mass
            explained.append((np.array([i]), warning(kind, **numbers)))
        for here, note in explained:
            rows = readings.row[np.intersect1d(here, off)].tolist()
            if rows:
                doubted.append(doubt(note.kind, rows, **note.numbers))
                off = np.setdiff1d(off, here)
    return doubted


def _corrections(
    blast: Blast, its: Int[np.ndarray, " _"], off: Int[np.ndarray, " _"]
) -> Iterator[tuple[Int[np.ndarray, " _"], Readings, Note]]:
    """Yield mistakes of a sensor: the readings concerned, the same corrected, warning.

    Args:
        blast: The blast with which its readings are compared.
        its: Numbers of the sensor's readings.
        off: Numbers of those that disagree: without any there is no mistake.
    """
    if not off.size:
        return
    readings = blast.readings
    timed = off[readings.timed[off]]
    zones = HALF_HOUR * np.round(blast.residual[timed[:1]] / HALF_HOUR)
    for late in zones[np.abs(zones) <= LATEST].tolist():
        own = readings.only(timed)
        corrected = replace(own, value=own.value - late)
        yield timed, corrected, warning("clock_of_another_zone", late_s=late)
    own = readings.only(its)
    for kind, matrix in PLACES.items():
        place = own.position @ matrix
        numbers = {"east_m": float(place[0, 0]), "north_m": float(place[0, 1])}
        yield its, replace(own, position=place), warning(kind, **numbers)
    for i in off:
        here = np.array([i])
        own = readings.only(here)
        for name, factor in FACTORS[QUANTITIES[own.quantity[0]].kind].items():
            note = warning("unit_slip", mass_kg=blast.mass, factor=factor, unit=name)
            yield here, own.rescaled(np.array([True]), factor), note


def speeds_doubted(blast: Blast, laws: ScaledLaws) -> list[Note]:
    """Return arrivals that are too far from each other, or from the shot, in time.

    The arrival with the most contradictions is reported and removed, until none is
    left. With equal numbers of contradictions the first in the log is reported.
    """
    readings = blast.readings
    seen = readings.quantity == "flash_time_s"
    start = {} if blast.origin is None else {0: blast.origin}
    start |= zip(readings.clock[seen].tolist(), readings.value[seen], strict=True)
    here = np.flatnonzero(readings.quantity == "air_arrival_s")[:MAX_COMPARED]
    readings, far = readings.only(here), blast.distance[here]
    time, error, clock = readings.value, readings.error, readings.clock
    took = time - np.array([start.get(c, np.nan) for c in clock.tolist()])
    # a comparison with NaN is False: of other clocks, and of a sensor at the charge
    apart = np.linalg.norm(readings.position[:, None] - readings.position, axis=-1)
    apart[clock[:, None] != clock] = np.nan
    # the last column compares with the shot
    apart = np.column_stack([apart, np.where(far > 0, far, np.nan)])
    late = np.column_stack([np.abs(time[:, None] - time), took])
    error = np.column_stack([np.hypot(error[:, None], error), error]) + CLOCK_STEP
    slowest = np.where(apart > STRATOSPHERE_RANGE, SLOWEST_THERMOSPHERE, SLOWEST)
    too_slow = late > apart / slowest + error
    too_fast = (late + error)[:, -1] < apart[:, -1] / laws.fastest()
    found = [("too_fast", int(i), len(here)) for i in np.flatnonzero(too_fast)]
    while too_slow.any():
        i = int(np.argmax(too_slow.sum(axis=1)))
        other = int(np.argmax(np.where(too_slow[i], late[i], -np.inf)))
        if too_slow[i, -1]:
            found.append(("too_slow", i, len(here)))
        else:
            found.append(("too_slow_between", i, other))
        too_slow[i] = too_slow[:, i] = False
    doubts = []
    for kind, i, other in found:
        numbers = {"late_s": float(late[i, other]), "apart_m": float(apart[i, other])}
        if kind == "too_fast":  # perhaps at time 0, without a mean speed
            numbers["fastest_m_s"] = laws.fastest()
        else:
            numbers["mean_m_s"] = numbers["apart_m"] / numbers["late_s"]
            numbers["slowest_m_s"] = float(slowest[i, other])
        both = [i, other] if other < len(here) else [i]
        doubts.append(doubt(kind, readings.row[both].tolist(), **numbers))
    return doubts


def slow_together(blast: Blast, slowest: float) -> list[Note]:
    """Return the arrivals of a clock that together imply a speed below that of sound.

    The times are fitted by an origin time plus slowness times distance, and the
    position where it is not given. If all agree with a low speed, no single arrival is
    wrong.

    Args:
        blast: The blast on which most rows agree: its position begins the search.
        slowest: Speed of sound against the wind [m/s].
    """
    air = (blast.readings.quantity == "air_arrival_s") & ~blast.readings.bound
    # of the clock with most arrivals
    most = np.bincount(blast.readings.clock[air], minlength=1).argmax()
    arrivals = blast.readings.only(air & (blast.readings.clock == most))
    place = blast.place[:2] if np.isnan(blast.distance).any() else np.zeros(0)

    def apart(*place: float) -> Float[np.ndarray, " n"]:
        at = [*(place or blast.place[:2]), blast.place[2]]
        return arrivals.distances(np.array([at]))[0]

    def arrival(_: Float[np.ndarray, " n"], start: float, slowness: float, *at: float):
        return start + slowness * apart(*at)

    # two more than unknowns: one wrong clock is then noticed
    if len(arrivals.row) < 2 + len(place) + 2:
        return []
    # imported here: logs without such arrivals do not need it
    from scipy.optimize import curve_fit

    time, travel = arrivals.value, apart() / slowest
    sd = np.hypot(arrivals.error / SIGMAS, TRAVEL_SCATTER * travel)
    sd = np.hypot(sd, CLOCK_STEP)
    begin = [float(np.mean(time - travel)), 1.0 / slowest, *place]
    # a search that does not converge, overflows or has no single best gives no speed
    with suppress(RuntimeError, ValueError), warnings.catch_warnings(action="ignore"):
        found: Any = curve_fit(arrival, time, time, begin, sd, absolute_sigma=True)
        best, covariance = found
        if apart(*best[2:]).max() > STRATOSPHERE_RANGE:
            slowest = min(slowest, SLOWEST_THERMOSPHERE)
        error = np.hypot(np.sqrt(covariance[1, 1]), TRAVEL_SCATTER * best[1])
        left = np.abs(arrival(time, *best) - time) / sd
        if best[1] - SIGMAS * error > 1.0 / slowest and left.max() < SIGMAS:
            numbers = {"speed_m_s": float(1.0 / best[1]), "slowest_m_s": slowest}
            return [doubt("slow_together", arrivals.row.tolist(), **numbers)]
    return []


def magnitudes_doubted(
    readings: Readings, laws: ScaledLaws, distance: Float[np.ndarray, " n"]
) -> list[Note]:
    """Return readings that require an impossible charge, or a gauge inside it.

    Args:
        readings: The rows of a shot.
        laws: Laws of 1 kg.
        distance: Distance of each from the charge [m]; NaN where unknown.
    """
    found = []
    for i in np.flatnonzero(~readings.timed & ~readings.bound):
        quantity, at = readings.quantity[i], float(distance[i])
        log_mass, given = laws.by_mass(quantity, at if at > 0 else 1.0)
        given = np.maximum.accumulate(given)  # by this mass or a smaller one
        is_possible = readings.value[i] <= given[-1]
        # without a distance the limit is the value 1 m from the charge, for quantities
        # that do not grow with its mass
        if not at > 0 and (quantity in WITH_MASS or is_possible):
            continue
        kind, numbers = "", {"distance_m": at if at > 0 else None}
        if not is_possible:
            kind, numbers["largest"] = "no_mass_gives_it", float(np.exp(given[-1]))
        else:
            # the smallest mass that gives the reading is the most favourable one
            least = float(np.exp(np.interp(readings.value[i], given, log_mass)))
            reach = LARGEST_RADIUS * float(np.cbrt(least))
            numbers |= {"mass_kg": least, "fireball_m": reach}
            if not MIN_MASS <= least <= MAX_MASS:
                kind = "mass_of_no_blast"
            elif reach > at and least > FIREBALL_MASS:
                kind = "in_the_fireball"
        if kind:
            found.append(doubt(kind, (int(readings.row[i]),), **numbers))
    return found


def rising_peaks(readings: Readings, distance: Float[np.ndarray, " n"]) -> list[Note]:
    """Return peaks larger than one nearer to the charge, one for each quantity.

    A peak falls at least as 1/R, as sound does; a shock falls faster. So scatter has to
    explain the rise of peak times distance. A reflected reading is 2 to 8 times an
    incident one.
    """
    found = []
    for quantity in ("peak_overpressure_pa", "reflected_pressure_pa"):
        here = (readings.quantity == quantity) & ~readings.bound & ~np.isnan(distance)
        here = np.flatnonzero(here)[:MAX_COMPARED]
        if not here.size:
            continue
        far, value, error = distance[here], readings.value[here], readings.error[here]
        spread = value + np.log(np.maximum(far, np.finfo(float).tiny))
        # With heavy tails one reading makes the rise. Any of them may, on either side:
        # Bonferroni over twice their number.
        quantile = -float(stdtrit(4, BY_CHANCE / (2 * len(here))))
        # stated errors are independent of the scatter
        scale = np.hypot(SCATTER, np.hypot(error[:, None], error) / SIGMAS)
        larger = (far[:, None] > far) & (value[:, None] > value)
        rises = np.where(larger, (spread[:, None] - spread) / scale, 0.0)
        j, i = np.unravel_index(np.argmax(rises), rises.shape)
        if rises[j, i] > quantile:
            numbers = {"distance_m": float(far[j]), "nearer_m": float(far[i])}
            rows = readings.row[here[[j, i]]].tolist()
            found.append(doubt("peak_rises", rows, **numbers))
    return found


def radii_doubted(observations: Observations) -> list[Note]:
    """Return radii of one sensor that shrink with time."""

    def order(row: int) -> tuple[str, str, float]:
        sensor, shot = observations.sensor[row], observations.shot[row]
        return sensor, shot, float(observations.time[row])

    rows = np.flatnonzero(np.array(observations.quantity) == "shock_radius_m").tolist()
    found = []
    for early, late in pairwise(sorted(rows, key=order)):
        before, value = observations.value[[early, late]].tolist()
        if order(early)[:2] == order(late)[:2] and SHRINKS * value < before:
            found.append(doubt("radius_shrinks", (late, early)))
    return found
