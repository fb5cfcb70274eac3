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
readings of a quantity. One that brings the rows into agreement is named in the warning.
The log is not changed.
"""

from collections.abc import Iterator, Mapping
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float
from scipy.special import stdtrit

from jblast.constants import (
    AIR_HEAT_CAPACITY_RATIO,
    DRY_AIR_GAS_CONSTANT,
    FOOT,
    PSI,
)
from jblast.inference.consensus import (
    CLOCK_STEP,
    MAX_MASS,
    MIN_MASS,
    PRICE,
    SIGMAS,
    STRATOSPHERE_RANGE,
    WITH_MASS,
    Agreement,
    Readings,
    ScaledLaws,
    at_place,
    readings_of,
    scaled_laws,
    supposed_blast,
)
from jblast.observations import Observations, some_rows
from jblast.observations.check import (
    Doubt,
    clocks_doubted,
    degrees_swapped,
    places_doubted,
    sigmas_doubted,
)
from jblast.observations.scenes import for_log
from jblast.quantities import QUANTITIES
from jblast.scene import Charge, UncertainScene
from jblast.waves.fireball import LARGEST_RADIUS
from jblast.waves.propagation import sound_speed_of

OF_ALL = ("not_at_the_origin", "not_at_time_0", "clock_of_one_row")
"""Warnings about the whole log."""
FREE = {"not_at_the_origin": "charge_east_m", "not_at_time_0": "origin_time_s"}
"""Parameter that a fit has to free: no warning where it does so without a scene."""
TWO_SIDED: Mapping[str, str] = {
    "too_slow_between": "the other arrival",
    "peak_rises": "the nearer peak",
    "two_sensors_at_one_place": "the other sensor",
    "sensor_at_two_places": "its first place",
    "radius_shrinks": "the radius before",
}
"""Warnings about one row by comparison with another, which is not suspect itself."""
MAX_REFLECTION = 8.0
"""Largest ratio of a reflected to an incident peak: a strong shock in an ideal gas with
a heat capacity ratio of 1.4."""
BESIDE_A_RISE = ("place_in_feet", "off_by_factor")
"""Warnings that do not suppress that of a rise up to `MAX_REFLECTION`. A distance in
feet changes a peak by a factor of 3 to 6, so one peak cannot decide between them."""
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
COLDEST = 222.15
"""Severe cold [K]: -51 C, climatic category C3 of MIL-STD-810."""
GALE = 20.7
"""Largest wind in which blasts are measured [m/s]: upper limit of Beaufort 8 (WMO)."""
SLOWEST = float(
    np.sqrt(AIR_HEAT_CAPACITY_RATIO * DRY_AIR_GAS_CONSTANT * COLDEST) - GALE
)
"""Lowest speed of a wave in air near the ground [m/s]: 278."""
SLOWEST_THERMOSPHERE = 180.0
"""Lowest celerity of infrasound through the thermosphere [m/s], beyond
`STRATOSPHERE_RANGE` (Negraru et al., J. Geophys. Res. 115, D15110, 2010; read
second-hand)."""
TRAVEL_SCATTER = 0.01
"""Scatter of travel times about a law, of a shot and of a path, as laws declare it."""
SURE_SPEED_SD = 3.0
"""Standard deviations by which the speed of all arrivals has to be below that of sound:
1 in 700 by chance."""
OWN_FAULT_SD = 4.0
"""Residual from the common speed, in standard deviations, of an arrival with an error
of its own: 1 in 16,000 by chance."""
MAX_MEASURED = 1e9
"""Largest time [s] and distance [m] that are used: larger ones belong to no blast, and
their squares may overflow."""
SINGULAR = 1e14
"""Condition of normal equations above which rounding determines the solution."""
SPARE_ARRIVALS = 2
"""Arrivals beyond the unknowns of a common speed: one wrong clock is then noticed."""
MAX_COMPARED = 1000
"""Largest number of arrivals that are compared in pairs: 8 MB for each array."""
HALF_HOUR = 1800.0
"""Step of time zones [s]: they differ by quarters of an hour, nearly all by halves."""
LATEST = 26 * 3600.0
"""The largest difference of two zones (UTC-12 and UTC+14) [s]."""
LEFT_BY_A_ZONE = 60.0
"""Largest residual after the difference of zones [s]: sound over 20 km."""
LEAST_MOVE = 1.0
"""Smallest correction of a position [m]. Sound takes 3 ms for it, which is within the
tolerance of an arrival from 10 m on (`CLOCK_STEP`, and 7 % of the travel time)."""
# Ratios of a wrong to the right value, by the mistake; the key is part of the warning.
_MILLI = {"a thousand times": 1e3, "a thousandth of": 1e-3}
_PSI = {
    "psi written as kPa": 1e3 / PSI,
    "kPa written as psi": PSI / 1e3,
    "psi written as Pa": 1 / PSI,
    "Pa written as psi": PSI,
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
"""Ratio of a value with the wrong unit to the right one, by kind of quantity."""
MISTAKE_MARGIN = 0.6
"""Largest residual after the correction of a mistake, relative to the tolerance. Below
1 it separates neighbouring factors: a psi is 6.9 kPa, and a factor of 3 is
tolerated."""


def doubts(observations: Observations, uncertain: UncertainScene) -> list[Doubt]:
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
    return sorted(_once(found), key=lambda doubt: doubt.rows[0])


def _physical(observations: Observations, uncertain: UncertainScene) -> list[Doubt]:
    """Return the warnings by comparison with blasts, shot by shot."""
    doubted = []
    laws = scaled_laws(uncertain.scene)
    for rows, charge, label in _shots(observations, uncertain):
        its = for_log(uncertain, some_rows(observations, rows))
        # first at the origin at time 0, as in logs with ranges: it decides most
        on_earth = observations.frame is not None or observations.epoch is not None
        there = its if on_earth else uncertain
        readings = readings_of(observations, there.scene, rows, there.beliefs)
        if len(readings.row):
            found = _of_shot(observations, readings, laws, charge, there, label)
            doubted += [one for one in found if FREE.get(one.kind) not in its.beliefs]
    return doubted


def _shots(observations: Observations, uncertain: UncertainScene):
    """Yield the rows of each shot, its charge, and the suffix of its names."""
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
    """Return the warnings about the rows of one shot."""
    supposed = supposed_blast(readings, laws, charge, uncertain, label)
    readings, found = supposed.readings, supposed.found
    if supposed.stated is not None:
        column = slip_of_quantity(
            readings, laws, supposed.stated, supposed.stated_origin
        )
        if column is not None:
            return [column, *slow_between(readings)]
    doubted = [supposed.doubt] if supposed.doubt else []
    # with a known origin and known distances each arrival has its own speed instead
    if supposed.origin is None or np.isnan(supposed.distance).any():
        start = np.zeros(3) if found is None else found.place
        slowest = SLOWEST
        if not {"air_sound_speed_m_s", "air_temperature_k"} & set(uncertain.beliefs):
            slowest = float(sound_speed_of(uncertain.scene.air)) - GALE
        doubted += slow_together(readings, supposed.distance, start, slowest)
    divided = []
    if found is not None and found.holds():
        doubted += _named(observations, readings, laws, found)
    elif found is not None and not doubted:
        divided = _divided(readings, found)
    return [
        *doubted,
        *speeds_doubted(readings, laws, supposed.distance, supposed.origin),
        *magnitudes_doubted(readings, laws, supposed.distance),
        *rising_peaks(readings, supposed.distance),
        *slow_between(readings),
        *divided,  # last: used for rows without a more specific warning
    ]


def _named(
    observations: Observations, readings: Readings, laws: ScaledLaws, found: Agreement
) -> list[Doubt]:
    """Return a warning for each row that disagrees, with its mistake if identified."""
    off = np.flatnonzero(found.off & found.checkable)
    doubted, done = [], set()
    # by sensor: a wrong position or clock affects all of its rows
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
    """Return the mistaken unit of one row, or its deviation."""
    row, quantity = (int(readings.row[i]),), readings.quantity[i]
    its = readings.only(np.array([i]))
    # the unit in which the reading would agree best
    best: tuple[float, str, float] | None = None
    for name, factor in FACTORS.get(QUANTITIES[quantity].kind, {}).items():
        changed = _rescaled(its, np.array([True]), factor)
        left = abs(float(_scores(changed, laws, found, found.offset[[i]])[0]))
        if left <= MISTAKE_MARGIN and (best is None or left < best[0]):
            best = left, name, factor
    numbers = {"mass_kg": found.mass}
    if best is not None:
        _, name, factor = best
        return Doubt("unit_slip", row, numbers | {"factor": factor}, (quantity, name))
    residual = float(found.residual[i])
    if readings.timed[i]:
        return Doubt("off_in_time", row, numbers | {"late_s": residual}, (quantity,))
    ratio = {"ratio": float(np.exp(residual))}
    return Doubt("off_by_factor", row, numbers | ratio, (quantity,))


def _divided(readings: Readings, found: Agreement) -> list[Doubt]:
    """Return a warning that the rows of a shot fit no single blast."""
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
    """Return one warning per row, the first, which is the most specific.

    Warnings by comparison with a suspect row are dropped. The warning that no blast
    explains a shot is kept if it concerns a further row. A rise of peaks is kept if the
    warning about its larger peak does not explain it better (`BESIDE_A_RISE`).
    """
    seen: dict[int, str] = {}
    kept = []
    for doubt in found:
        rows = set(doubt.rows)
        is_new = bool(rows - {*seen}) if doubt.kind == "of_no_one_blast" else False
        if doubt.kind == "peak_rises" and seen.get(doubt.rows[0]) in BESIDE_A_RISE:
            ratio = doubt.numbers["value"] / doubt.numbers["nearer"]
            is_new = doubt.rows[1] not in seen and ratio <= MAX_REFLECTION
        if doubt.kind in OF_ALL:
            kept.append(doubt)
        elif is_new or not {*seen} & rows:
            kept.append(doubt)
            its = doubt.rows if doubt.kind not in TWO_SIDED else doubt.rows[:1]
            seen |= dict.fromkeys(its, doubt.kind)
    return kept


def magnitudes_doubted(
    readings: Readings, laws: ScaledLaws, distance: Float[np.ndarray, " n"]
) -> list[Doubt]:
    """Return readings that require an impossible charge, or a gauge inside it.

    Args:
        readings: The rows of a shot.
        laws: Laws of 1 kg.
        distance: Distance of each from the charge [m]; NaN where unknown.
    """
    found, timed = [], readings.timed
    for i, quantity in enumerate(readings.quantity):
        if timed[i] or readings.bound[i]:
            continue
        at, value = float(distance[i]), float(np.exp(readings.value[i]))
        row = (int(readings.row[i]),)
        # without a distance the limit is the value 1 m from the charge, for quantities
        # that do not grow with its mass
        if not at > 0:
            if quantity not in WITH_MASS and value > laws.largest(quantity, 1.0):
                numbers = {"value": value, "largest": laws.largest(quantity, 1.0)}
                found.append(Doubt("no_mass_gives_it", row, numbers, (quantity,)))
            continue
        # the smallest mass that gives the reading is the most favourable one
        masses = laws.masses(quantity, value, at)
        numbers = {"value": value, "distance_m": at}
        if not masses.size:
            numbers["largest"] = laws.largest(quantity, at)
            found.append(Doubt("no_mass_gives_it", row, numbers, (quantity,)))
            continue
        mass = float(masses.min())
        reach = LARGEST_RADIUS * float(np.cbrt(mass))
        numbers |= {"mass_kg": mass, "fireball_m": reach}
        if mass > MAX_MASS or masses.max() < MIN_MASS:
            found.append(Doubt("mass_of_no_blast", row, numbers, (quantity,)))
        elif reach > at and mass > FIREBALL_MASS:
            found.append(Doubt("in_the_fireball", row, numbers, (quantity,)))
    return found


def rising_peaks(readings: Readings, distance: Float[np.ndarray, " n"]) -> list[Doubt]:
    """Return peaks larger than one nearer to the charge, one for each quantity.

    A peak falls at least as 1/R, as sound does; a shock falls faster. So scatter has to
    explain the rise of peak times distance. A reflected reading is 2 to 8 times an
    incident one.
    """
    found = []
    for quantity in ("peak_overpressure_pa", "reflected_pressure_pa"):
        kind = np.array([q == quantity for q in readings.quantity], bool)
        here = np.flatnonzero(kind & ~readings.bound & ~np.isnan(distance))
        here = here[np.argsort(distance[here], kind="stable")]
        if not here.size:
            continue
        far, value, error = distance[here], readings.value[here], readings.error[here]
        spread = value + np.log(np.maximum(far, np.finfo(float).tiny))
        least = np.minimum.accumulate(spread)  # of all that are nearer, and its place
        at = np.maximum.accumulate(np.where(spread == least, np.arange(len(here)), 0))
        nearer = np.searchsorted(far, far, side="left") - 1
        low = at[np.maximum(nearer, 0)]
        # With heavy tails one reading makes the rise. Any of them may, on either side:
        # Bonferroni over twice their number.
        quantile = -float(stdtrit(4, BY_CHANCE / (2 * len(here))))
        stated = np.hypot(error, error[low]) / SIGMAS  # independent of the scatter
        allowed = quantile * np.hypot(SCATTER, stated)
        rises = (value > value[low]) & (spread - spread[low] > allowed)
        rising = np.flatnonzero((nearer >= 0) & rises)
        if rising.size:
            j, i = int(rising[0]), int(low[rising[0]])
            numbers = {
                "value": float(np.exp(value[j])),
                "distance_m": float(far[j]),
                "nearer": float(np.exp(value[i])),
                "nearer_m": float(far[i]),
            }
            rows = int(readings.row[here[j]]), int(readings.row[here[i]])
            found.append(Doubt("peak_rises", rows, numbers, (quantity,)))
    return found


def radii_doubted(observations: Observations) -> list[Doubt]:
    """Return radii of one sensor that shrink with time."""
    found = []
    rows: dict[tuple[str, str], list[int]] = {}
    for row, quantity in enumerate(observations.quantity):
        if quantity == "shock_radius_m":
            key = observations.sensor[row], observations.shot[row]
            rows.setdefault(key, []).append(row)
    for its in rows.values():
        its.sort(key=lambda row: observations.time[row])
        for early, late in pairwise(its):
            if SHRINKS * observations.value[late] < observations.value[early]:
                numbers = {
                    "value": float(observations.value[late]),
                    "before": float(observations.value[early]),
                }
                found.append(Doubt("radius_shrinks", (late, early), numbers))
                break
    return found


def slow_between(readings: Readings) -> list[Doubt]:
    """Return arrivals that are too far apart in time for their positions.

    The arrival with the most contradictions is reported and removed, until none is
    left.
    """
    air = np.array([q == "air_arrival_s" for q in readings.quantity], bool)
    here = np.flatnonzero(air & ~np.isnan(readings.position).any(axis=1))[:MAX_COMPARED]
    if len(here) < 2:
        return []
    place, time = readings.position[here], readings.value[here]
    apart = np.linalg.norm(place[:, None] - place[None], axis=-1)
    late = np.abs(time[:, None] - time[None])
    error = np.hypot(readings.error[here][:, None], readings.error[here][None])
    slowest = np.where(apart > STRATOSPHERE_RANGE, SLOWEST_THERMOSPHERE, SLOWEST)
    bad = late > apart / slowest + error + CLOCK_STEP
    bad &= readings.clock[here][:, None] == readings.clock[here][None]
    found = []
    while bad.any():
        worst = int(np.argmax(bad.sum(axis=1)))
        # with equal numbers of contradictions the first in the log is reported
        partners = np.flatnonzero(bad[worst])
        other = int(partners[np.argmax(late[worst, partners])])
        rows = int(readings.row[here[worst]]), int(readings.row[here[other]])
        numbers = {
            "late_s": float(late[worst, other]),
            "apart_m": float(apart[worst, other]),
            "slowest_m_s": float(slowest[worst, other]),
        }
        found.append(Doubt("too_slow_between", rows, numbers))
        bad[worst] = bad[:, worst] = False
    return found


def slow_together(
    readings: Readings,
    distance: Float[np.ndarray, " n"],
    start: Float[np.ndarray, "3"],
    slowest: float,
) -> list[Doubt]:
    """Return the arrivals of a clock that together imply a speed below that of sound.

    The times are fitted by an origin time plus slowness times distance. If all agree
    with a low speed, no single arrival is wrong.

    Args:
        readings: The rows of a shot.
        distance: Distance of each from the charge [m]; NaN to fit its position as well.
        start: Start of the search for the position: east, north, up [m]; up is fixed.
        slowest: Speed of sound against the wind [m/s].
    """
    air = np.array([q == "air_arrival_s" for q in readings.quantity], bool)
    air &= ~readings.bound
    its_clock = readings.clock[air]
    if not its_clock.size:
        return []
    here = np.flatnonzero(air & (readings.clock == np.bincount(its_clock).argmax()))
    here = here[:MAX_COMPARED]
    at, time, known = readings.position[here], readings.value[here], distance[here]
    placed = not np.isnan(known).any()
    unknowns = 2 if placed else 4
    if len(here) < unknowns + SPARE_ARRIVALS:
        return []
    measured = np.column_stack([time, known if placed else at])
    if not (np.abs(measured) < MAX_MEASURED).all():  # a NaN is not, either
        return []
    # imported here: logs without such arrivals do not need it
    from scipy.optimize import least_squares

    def apart(x: np.ndarray) -> np.ndarray:
        if placed:
            return known
        return np.linalg.norm(at - np.array([x[2], x[3], start[2]]), axis=1)

    middle = np.zeros(2) if placed else at[:, :2].mean(axis=0)
    found = []
    # two starts: a fit of the position may have several minima
    for place in (start[:2], middle):
        travel = apart(np.array([0.0, 0.0, *place])) / slowest
        sd = np.hypot(readings.error[here] / SIGMAS, TRAVEL_SCATTER * travel)
        sd = np.hypot(sd, CLOCK_STEP)

        def misfit(x: np.ndarray, sd: np.ndarray = sd) -> np.ndarray:
            return (x[0] + x[1] * apart(x) - time) / sd

        begin = np.array([float(np.mean(time - travel)), 1.0 / slowest, *place])
        scale = np.array([float(travel.max()), 1.0 / slowest, *([slowest] * 2)])
        found.append(
            least_squares(misfit, begin[:unknowns], x_scale=scale[:unknowns] + 1e-12)
        )
    best = min(found, key=lambda one: one.cost)
    square = best.jac.T @ best.jac
    determined = np.linalg.cond(square) < SINGULAR
    if not (best.success and determined and best.x[1] > 0.0):
        return []
    own = float(np.sqrt(np.linalg.inv(square)[1, 1])) / best.x[1]
    speed, share = 1.0 / best.x[1], float(np.hypot(own, TRAVEL_SCATTER))
    far = float(apart(best.x).max()) > STRATOSPHERE_RANGE
    slowest = min(slowest, SLOWEST_THERMOSPHERE) if far else slowest
    too_fast = speed * (1.0 + SURE_SPEED_SD * share) >= slowest
    if too_fast or np.abs(best.fun).max() > OWN_FAULT_SD:
        return []
    rows = tuple(int(row) for row in readings.row[here])
    numbers = {"speed_m_s": float(speed), "slowest_m_s": slowest}
    return [Doubt("slow_together", rows, numbers)]


def speeds_doubted(
    readings: Readings,
    laws: ScaledLaws,
    distance: Float[np.ndarray, " n"],
    origin: float | None,
) -> list[Doubt]:
    """Return arrivals that are too late or too early for their distances.

    Args:
        readings: The rows of a shot.
        laws: Laws of 1 kg.
        distance: Distance of each from the charge [m].
        origin: Time of the shot on the common clock [s], for clocks without a flash;
            None if unknown.
    """
    seen = {
        int(readings.clock[i]): float(readings.value[i])
        for i, quantity in enumerate(readings.quantity)
        if quantity == "flash_time_s"
    }
    start = seen if origin is None else {0: origin} | seen
    fastest = laws.fastest()
    found: list[Doubt] = []
    for i, quantity in enumerate(readings.quantity):
        begun = start.get(int(readings.clock[i]))
        if quantity != "air_arrival_s" or begun is None or not distance[i] > 0:
            continue
        if seen.get(int(readings.clock[i]), -np.inf) > readings.value[i]:
            continue  # an arrival before the flash is reported by `clocks_doubted`
        took, error = readings.value[i] - begun, readings.error[i] + CLOCK_STEP
        slowest = SLOWEST_THERMOSPHERE if distance[i] > STRATOSPHERE_RANGE else SLOWEST
        kind = ""
        if took - error > distance[i] / slowest:
            kind = "too_slow"
        elif took + error < distance[i] / fastest:
            kind = "too_fast"
        if kind:
            numbers = {
                "took_s": float(took),
                "distance_m": float(distance[i]),
                "slowest_m_s": slowest,
                "fastest_m_s": fastest,
            }
            found.append(Doubt(kind, (int(readings.row[i]),), numbers))
    return found


def slip_of_sensor(
    readings: Readings, laws: ScaledLaws, found: Agreement, sensor: list[int]
) -> tuple[str, float, float] | None:
    """Return the mistake in a sensor's position that makes all its rows agree.

    Args:
        readings: The rows of the shot.
        laws: Laws of 1 kg.
        found: The blast on which the other rows agree.
        sensor: Indices of the sensor's readings.

    Returns:
        The kind of mistake, corrected east and north [m]; None without one.
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
        if np.linalg.norm(place - at) < LEAST_MOVE:
            continue
        its = readings.only(np.array(sensor))
        its = its.but(position=np.broadcast_to(place, its.position.shape))
        score = _scores(its, laws, found, found.offset[sensor])
        if (np.abs(score) <= MISTAKE_MARGIN).all():
            return kind, float(place[0]), float(place[1])
    return None


def slip_of_clock(readings: Readings, found: Agreement, rows: list[int]) -> float:
    """Return the offset of a sensor's clock [s] if it is that of a zone, else 0."""
    off = [i for i in rows if readings.timed[i] and found.off[i]]
    if not off:
        return 0.0
    late = found.residual[off]
    # all arrivals of the sensor have to be late by the same number of steps
    steps = np.round(late / HALF_HOUR)
    same = (steps == steps[0]).all() and 0 < abs(steps[0]) * HALF_HOUR <= LATEST
    travel = np.abs(late - steps * HALF_HOUR)
    return (
        float(steps[0] * HALF_HOUR) if same and (travel < LEFT_BY_A_ZONE).all() else 0.0
    )


def slip_of_quantity(
    readings: Readings,
    laws: ScaledLaws,
    before: Agreement,
    origin: float | None,
) -> Doubt | None:
    """Return the unit in which all rows of a quantity would agree with the others."""
    kinds = [q for q in dict.fromkeys(readings.quantity) if q != "flash_time_s"]
    if len(kinds) < 2 or not before.off.any():
        return None
    for quantity, name, factor in _columns(kinds):
        here = np.array([q == quantity for q in readings.quantity])
        if here.sum() < 2:
            continue
        changed = _rescaled(readings, here, factor)
        after = at_place(changed, laws, before.place, origin)
        # the mistake itself costs as much as one row that disagrees
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
    """Return residuals of readings relative to tolerances, for a given blast."""
    place, mass = found.place[None], np.array([found.mass])
    distance = readings.distances(place)
    travelled = readings.travelled(laws, distance, mass)
    allowed = readings.allowed(np.where(readings.timed, travelled, 0.0), distance)
    return ((readings.value - travelled - offset) / allowed)[0]
