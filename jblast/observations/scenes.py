"""Scenes for a log: the default scene, and a starter scene to edit.

The default scene has a charge at the origin at time zero, the convention of logs with
ranges. In a log with positions or dates the position, the origin time and the offsets
of clocks that recorded a flash and an arrival are free if the log can identify them,
and in a log in degrees the air is the standard atmosphere at the height of the sensors.

The starter scene is a commented TOML file with what the log contains: sensors, their
errors, clocks and the origin, and the same free parameters (`names_to_free`). A log can
still leave a free parameter unidentified; that is decided by the fit.
"""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np

from jblast.observations.clocks import clocks_apart, has_common_clock
from jblast.observations.table import (
    RECORD_QUANTITIES,
    SAMPLES,
    Observations,
    rows_by,
    some_rows,
)
from jblast.parameters import CHARGE_POSITION, CLOCK_OFFSET, PARAMETERS
from jblast.quantities import (
    ADDITIVE,
    BY_CAMERA,
    CLOCK_TIMES,
    PLACELESS,
    TIMED,
    made_with,
)
from jblast.scene import UncertainScene, freed, with_values
from jblast.scene.uncertain import NO_SCENE
from jblast.scene.values import share_text
from jblast.waves.propagation import standard_atmosphere

PLACE = CHARGE_POSITION[:2]
"""Free without a position of the charge; its height is the ground's unless stated."""
LEAST_EXTENT = 100.0
"""Extent that a smaller layout counts as [m]: one sensor may be 10 km from a charge at
the origin."""
MAP_FACTOR = 100.0
"""Distance of the sensors from the origin, in their extents, from which on positions
are map coordinates."""
ONE_CLOCK_SD = 5.0
"""Difference of flash times from which on they are of different clocks [standard
deviations]: errors alone exceed it in one of a million pairs."""
_SEEN_AND_HEARD = {"flash_time_s", "air_arrival_s", "bearing_rad"}
_OF_GROUND = set(made_with("ground_arrival_s"))
_HEAD = """\
# A starter scene{made_for}: fill in known values.
# SI units, metres east, north, up. A number may be fixed (15.0), "free", or a prior:
# {{ lognormal = [median, factor] }}, {{ normal = [mean, sd] }},
# {{ uniform = [lo, hi] }}, {{ loguniform = [lo, hi] }}.
schema = 1
"""
_AIR = """\
[air]
{mark}temperature_k = 288.15
{mark}pressure_pa = 101325.0
relative_humidity = 0.5
{altitude}  # instead of the temperature and pressure above
# sound_speed_m_s = "free"  # only if it was measured, or to fit it
wind_m_s = [0.0, 0.0]  # towards east, north; each may be free
# wind_m_s = [{{ normal = [0, 5] }}, {{ normal = [0, 5] }}]  # if unknown
"""
_CHARGE = """\
{head}
mass_kg = "free"  # of the explosive; or a value, or a prior
explosive = "TNT"  # or "C4", "ANFO", ...; or tnt_factor = 1.1
{position}
{time}
# burst = "surface"  # or "free-air"; without it, the height decides
"""
_PLACE = """\
{mark}[place]  # where east, north, up are zero; for an answer in degrees
{mark}lat_deg = {lat}
{mark}lon_deg = {lon}
{mark}alt_m = {alt}
"""
_CAMERA = """\
# [camera]  # required for fireball_radius_px, and not in the log
# position_m = [EAST, NORTH, UP]
# look_at_m = [0.0, 0.0, 0.0]
# width = 1280
# height = 720
# focal_px = 1000.0
"""
_GROUND = """\
[ground]
p_speed_m_s = 5660.0  # granite; "free" or a prior if it was not measured
# path = "thesis"  # to a raised sensor: along the ground, then up as the air shock
"""
_LAW = """\
# [law]
# air_arrival_s = "kingery_bulmash"  # one line a quantity; "auto" chooses
# scatter = true  # false: the laws are exact
"""


def for_log(uncertain: UncertainScene, observations: Observations) -> UncertainScene:
    """Return the default scene adapted to a log with positions or dates.

    A charge at the origin at time 0 is a convention of logs with ranges. In other logs
    the position, the origin time and clocks are free if the log can identify them
    (`names_to_free`). In a log in degrees the air is the standard atmosphere at the
    height of the sensors. In one of map coordinates the charge is at the height of the
    lowest sensor.

    Args:
        uncertain: A scene; only the default scene is changed.
        observations: The log.
    """
    frame = observations.frame
    placed = not np.isnan(observations.position).any()
    # a scene written by the user is used as it is
    if uncertain.source != NO_SCENE or not (placed or frame or observations.epoch):
        return uncertain
    known = set(uncertain.beliefs)
    if "charge_range_m" in known:  # it replaces the position
        known |= set(PLACE)
    names = [n for n in names_to_free(observations) if n not in known]
    uncertain = freed(uncertain, names)
    if far_from_origin(observations.position):
        ground = float(observations.position[:, 2].min())
        scene = with_values(uncertain.scene, {CHARGE_POSITION[2]: ground})
        # its height counts from the sea, not from the ground
        charge = replace(scene.charge, burst="surface")
        uncertain = replace(uncertain, scene=replace(scene, charges=(charge,)))
    if (
        frame is None
        or not frame.alt_m
        or not PARAMETERS["air_altitude_m"].bounds.allows(frame.alt_m)
    ):
        return uncertain
    temperature, pressure = standard_atmosphere(frame.alt_m)
    air = {"air_temperature_k": temperature, "air_pressure_pa": pressure}
    stated = {name: value for name, value in air.items() if name not in known}
    return replace(uncertain, scene=with_values(uncertain.scene, stated))


def names_to_free(observations: Observations) -> list[str]:
    """Return position, origin time and clocks that the log of one shot can identify.

    The position needs at least three sensors that are not in a line and four rows, or a
    bearing, a flash and an arrival; in a log in degrees it is always free. The origin
    time is free if the position is and three rows are clock readings, with a flash, and
    in a log in degrees or with dates.

    Args:
        observations: The log.
    """
    observations = _readings(observations)
    quantities = observations.quantity
    # slant ranges need no position, and do not identify one
    ranged = not np.isnan(observations.slant_range).all()
    at = observations.position[~np.isin(quantities, PLACELESS) & (not ranged)]
    places = set(map(tuple, at[~np.isnan(at).any(axis=1)].tolist()))
    # mass, two coordinates and a time are four unknowns
    free = len(quantities) >= 4 and _in_no_line(places)
    seen = set(quantities) >= _SEEN_AND_HEARD
    on_earth = observations.frame is not None or far_from_origin(at)
    names: list[str] = list(PLACE) if places and (free or seen or on_earth) else []
    clocks = np.isin(quantities, CLOCK_TIMES).sum()
    dated = clocks > 0 and (on_earth or observations.epoch is not None)
    if (free and clocks >= 3) or "flash_time_s" in quantities or dated:
        names.append("origin_time_s")
    return names + [f"{CLOCK_OFFSET}.{name}" for name in clocks_to_free(observations)]


def far_from_origin(position: np.ndarray) -> bool:
    """Return True for map coordinates, such as UTM: no charge is at their origin."""
    at = position[~np.isnan(position).any(axis=1), :2]
    if not len(at):
        return False
    extent = max(np.linalg.norm(np.ptp(at, axis=0)), LEAST_EXTENT)
    return bool(np.linalg.norm(at.mean(axis=0)) > MAP_FACTOR * extent)


def clocks_to_free(observations: Observations) -> list[str]:
    """Return the clocks with unknown offsets that a log identifies.

    The difference of a flash and an arrival on one clock identifies its offset.
    Recorders with different names in the column `clock` have different clocks. Beside
    such a difference an arrival alone identifies the offset of its clock, too. Without
    that column sensors share one clock, unless their times of the flash differ.

    Args:
        observations: The log. The clock of its first row is the common one, or that of
            the rows whose `clock` is empty beside others.
    """
    timed = np.isin(observations.quantity, CLOCK_TIMES)
    rows = rows_by(observations.clocks(), timed).items()
    read = {clock: {observations.quantity[row] for row in its} for clock, its in rows}
    # a flash and an arrival of one clock differ by the travel time, whatever its offset
    tied = [clock for clock, quantities in read.items() if len(quantities) > 1]
    if not any(observations.clock):
        return tied[1:] if _flashes_disagree(observations) else []
    apart = clocks_apart(observations) if tied else []
    return [c for c in apart if read.get(c, set()) - {"flash_time_s"}]


def _flashes_disagree(observations: Observations) -> bool:
    """Return True if the times of the flash differ; the travel time is negligible."""
    rows = np.isin(observations.quantity, "flash_time_s")
    if rows.sum() < 2:
        return False
    value, sigma = observations.value[rows], np.nan_to_num(observations.sigma[rows])
    first, last = np.argmin(value), np.argmax(value)
    allowed = ONE_CLOCK_SD * np.hypot(sigma[first], sigma[last])
    return bool(value[last] - value[first] > allowed)


def starter_scene(observations: Observations) -> str:
    """Return a commented scene file for a log.

    Free are the mass and what the log can identify (`names_to_free`).

    Args:
        observations: The log.
    """
    log, frame = _readings(observations), observations.frame
    sampled = rows_by(observations.sensor, np.isin(observations.quantity, SAMPLES))
    source = Path(log.source).name
    made_for = f" for {json.dumps(source)}" if source else ""
    air = {"mark": "", "altitude": "# altitude_m = 1500"}
    place = {"mark": "# ", "lat": "LATITUDE", "lon": "LONGITUDE", "alt": "0.0"}
    if frame is not None:
        lat, lon, alt = map(repr, (frame.lat_deg, frame.lon_deg, frame.alt_m))
        place = {"mark": "", "lat": lat, "lon": lon, "alt": alt}
        # a height replaces temperature and pressure, which stay as an example
        if frame.alt_m and PARAMETERS["air_altitude_m"].bounds.allows(frame.alt_m):
            air = {"mark": "# ", "altitude": f"altitude_m = {alt}"}
    sensors = [
        _sensor(some_rows(log, np.array(rows)), is_sampled=name in sampled)
        for name, rows in rows_by(log.sensor).items()
    ]
    parts = [
        _HEAD.format(made_for=made_for),
        *(_charge(log, rows) for rows in rows_by(log.shot).values()),
        _AIR.format(**air),
        *([_CAMERA] if set(BY_CAMERA) & set(log.quantity) else []),
        *([_GROUND] if _OF_GROUND & set(log.quantity) else []),
        *sensors,
        *_clocks(log),
        _PLACE.format(**place),
        _LAW,
    ]
    return "\n".join(parts)


def _charge(observations: Observations, rows: list[int]) -> str:
    log = some_rows(observations, np.array(rows))
    needs = ~np.isin(log.quantity, PLACELESS)
    placed = (needs & ~np.isnan(log.position).any(axis=1)).any()
    ranges = rows_by(log.slant_range.tolist(), needs & ~np.isnan(log.slant_range))
    one_sensor, free = len(rows_by(log.sensor, needs)) == 1, names_to_free(log)
    position = (
        "position_m = [0.0, 0.0, 0.0]  # not identified by the log\n"
        '# position_m = ["free", "free", 0.0]  # or a prior of each'
    )
    if PLACE[0] in free:
        position = 'position_m = ["free", "free", 0.0]  # or its known position'
    elif one_sensor and len(ranges) == 1:
        position = f"range_m = {next(iter(ranges))!r}  # as in the log"
    elif one_sensor and not ranges and not placed:
        position = 'range_m = "free"  # slant range to the one sensor'
    since = f", in seconds since {log.epoch:%Y-%m-%dT%H:%M:%SZ}" if log.epoch else ""
    time = f'time_s = "free"  # on the clock of the sensors{since}'
    if "origin_time_s" not in free:
        time = 'time_s = 0.0  # on the clock of the sensors; or "free"'
    head = "[charge]"
    if len(set(observations.shot)) > 1:
        head = f"[[charge]]\nname = {toml_text(log.shot[0])}  # as the log's shot"
    return _CHARGE.format(head=head, position=position, time=time)


def _sensor(log: Observations, *, is_sampled: bool) -> str:
    lines = ["[[sensor]]", f"name = {toml_text(log.sensor[0])}"]
    needs = ~np.isin(log.quantity, PLACELESS)
    placed = log.position[~np.isnan(log.position).any(axis=1)]
    places = list(dict.fromkeys(map(tuple, placed.tolist())))
    if len(places) == 1:
        lines.append(f"position_m = [{', '.join(map(repr, places[0]))}]")
    elif places:
        lines.append("# it moves; its positions are in the log")
    elif needs.any() and np.isnan(log.slant_range).all():
        lines.append("# position_m = [EAST, NORTH, UP]  # not in the log")
    # a sigma that overflows to infinity counts as missing
    with np.errstate(over="ignore"):
        scale = log.error_scale()
    known = rows_by(log.quantity, np.isfinite(scale))
    records = []
    for quantity, rows in known.items():
        sigma = float(np.median(scale[rows]))
        text = f"{sigma:.3g}" if quantity in ADDITIVE else share_text(sigma)
        records.append(f"{quantity} = {text}")
    if records:
        lines.append(
            f"records = {{ {', '.join(records)} }}  # sigma: s for times, rad for "
            "directions, else relative"
        )
    if set(TIMED) & set(known):
        times = np.unique(log.time[np.isin(log.quantity, TIMED)]).tolist()
        lines.append(f"times_s = {times}  # of radii, by its clock")
    if is_sampled:
        lines.append("# it recorded samples; its errors are estimated from them")
    estimated = RECORD_QUANTITIES if is_sampled else ()
    if missing := [q for q in rows_by(log.quantity) if q not in (*known, *estimated)]:
        lines.append(f"# the log has no sigma for {', '.join(missing)}")
    return "\n".join(lines) + "\n"


def _clocks(log: Observations) -> list[str]:
    """Return a table [[clock]] for each clock but the common one.

    Clocks that the log identifies (`clocks_to_free`) are free, others commented out.
    """
    names = list(rows_by(log.clocks(), np.isin(log.quantity, CLOCK_TIMES)))
    named = [clock for clock in log.clock if clock]
    set_by, whose = "", "the common clock"
    if has_common_clock(log):
        names = [name for name in names if name in named]
    elif names:
        set_by = (named or names)[0]
        whose = toml_text(set_by)
    free, tables = clocks_to_free(log), []
    for name in names:
        mark = "" if name in free else "# "
        why = "set by its flash and bang" if name in free else "if it does not agree"
        if name != set_by:
            tables.append(
                f"{mark}[[clock]]  # {why}\n{mark}name = {toml_text(name)}\n"
                f'{mark}offset_s = "free"  # its time minus that of {whose}; or a '
                "number, or { normal = [0, 2] }\n"
            )
    return tables


def _in_no_line(places: set[tuple[float, ...]]) -> bool:
    """Return True if at least three places span a plane, seen from above."""
    if len(places) < 3:
        return False
    # singular values: extents along and across the best line; 1 : 1000 is a line
    plan = np.array(sorted(places))[:, :2]
    spread = np.linalg.svd(plan - plan.mean(axis=0), compute_uv=False)
    return bool(spread[1] > 1e-3 * spread[0])


def _readings(observations: Observations) -> Observations:
    """Return a log with the readings of records of samples in place of the records."""
    pairs = [
        (row, name)
        for row, quantity in enumerate(observations.quantity)
        for name in (RECORD_QUANTITIES if quantity == SAMPLES else (quantity,))
    ]
    rows, quantities = zip(*pairs, strict=True) if pairs else ((), ())
    rows = some_rows(observations, np.array(rows, int))
    return replace(rows, quantity=tuple(quantities))


def toml_text(text: str) -> str:
    """Return text as a TOML string: JSON's escapes, and one that JSON leaves out."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
