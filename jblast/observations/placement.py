"""Positions of a log's sensors from the log and its scene, which must agree.

A position is given by the log, by the scene, or by both within 1 mm; a row may have a
slant range instead. A fireball's radius is measured from the camera of the scene. A
combination for which no law can be evaluated is refused: a sensor at the charge, a row
without a distance, an arrival more than five standard deviations before a fixed origin
time, a wind together with a range that has no direction, and a charge that never
explodes.
"""

from collections.abc import Collection
from dataclasses import replace
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from jblast.errors import InputError, argument, shown
from jblast.observations.clocks import check_clocks, clocks_apart
from jblast.observations.table import SAMPLES, Observations, rows_by
from jblast.parameters import CHARGE_POSITION, CLOCK_OFFSET
from jblast.quantities import (
    ARRIVALS,
    BY_CAMERA,
    CLOCK_TIMES,
    DIRECTIONS,
    FEEL_WIND,
    FIREBALL_RADII,
    PLACELESS,
)
from jblast.scene import Scene
from jblast.types import ArrayLike

PLACE_ADVICE = (
    "; both count from its [place]: if that was moved, remove position_m from its "
    "[[sensor]], as the log has the positions"
)
"""Advice where a log in degrees and its scene contradict each other."""
EARLY_SIGMAS = 5.0
"""Sigmas by which errors may place an arrival before its origin or flash: they alone
do so in one of three million readings."""
POSITION_TOLERANCE = 1e-3
"""Largest difference of two positions of one sensor that count as equal [m]: below the
precision of any survey, above rounding of degrees."""
MAX_FAULTS = 200
"""Largest number of reported faults of one kind: a log with more belongs to another
scene."""


def resolve_positions(
    observations: Observations,
    scene: Scene,
    beliefs: Collection[str] = (),
    *,
    is_default: bool = False,
    faults: list[InputError] | None = None,
) -> Observations:
    """Fill in the positions of sensors from the scene, and check that both agree.

    Afterwards each row has a position or a slant range, unless it is `PLACELESS`, or
    the scene gives the charge's range. A `fireball_radius_px` is measured by the
    scene's camera, so its position and ranges are those of the camera.

    Args:
        observations: The log.
        scene: The scene.
        beliefs: Names of the scene's parameters that are not fixed.
        is_default: True if no scene was given, so that the charge's position is
            assumed.
        faults: A fault of each faulty row is appended here; None: the first is raised.

    Raises:
        InputError: A sensor's position is missing, or given twice and differently, or a
            row cannot be used with this scene.
    """
    log, charges = observations, scene.charges
    check_clocks(log, scene, beliefs)
    names = [charge.name for charge in charges]
    shots = np.zeros(len(log), int)
    if len(scene.charges) > 1:
        shots[:] = [names.index(n) if n in names else -1 for n in log.shot]

    def of_charge(values: Any) -> np.ndarray:
        return np.array(values)[shots]

    def is_free(*bases: str) -> Bool[np.ndarray, " row"]:
        labels = map(scene.label, charges)
        return of_charge([any(b + at in beliefs for b in bases) for at in labels])

    known = scene_positions(log, scene)
    position = np.where(_missing(log.position), known, log.position)
    unseen: dict[int, str] = {}
    for row in np.flatnonzero(np.isin(log.quantity, BY_CAMERA)).tolist():
        try:
            who = f"sensor {shown(log.sensor[row])}"
            position[row] = camera_place(scene, position[row], who)
        except InputError as fault:
            unseen[row] = str(fault)
    given, ranges = log.slant_range, [charge.range_m for charge in charges]
    ranged, stated = ~np.isnan(given), of_charge(np.array(ranges, float))
    by_range = ~np.isnan(stated)
    at = of_charge([np.array(charge.position_m, float) for charge in charges])
    away = np.linalg.norm(position - at, axis=1)
    # both positions are fixed, so the range follows from them
    fixed = ~by_range & ~is_free("charge_up_m")
    stated[fixed] = away[fixed]
    # the slant range replaces the position
    there = np.where(ranged[:, None], np.nan, position)
    lost = _missing(there)[:, 0]
    # some quantities, as the time of the flash, do not depend on the distance
    needs = ~np.isin(log.quantity, PLACELESS)
    first = {n: rows[0] for n, rows in rows_by(shots, needs & by_range).items()}
    whose = [log.sensor[first.get(n, 0)] for n in shots]
    ours = {sensor.name: float(sensor.clock_offset_s) for sensor in scene.sensors}
    own = {s for s, by in ours.items() if by or f"{CLOCK_OFFSET}.{s}" in beliefs}
    clocks, apart, records = log.clocks(), clocks_apart(log), log.records()
    offsets = {name: float(offset) for name, offset in scene.clock_offsets().items()}
    start = of_charge([float(charge.time_s) for charge in charges])
    start = start + np.array([offsets.get(name, 0.0) for name in clocks])
    # an unknown offset may move any reading behind the origin time
    unset = [f"{CLOCK_OFFSET}.{name}" in beliefs for name in clocks]
    timed = ~is_free("origin_time_s") & ~np.array(unset, bool)
    latest = log.value + EARLY_SIGMAS * np.nan_to_num(log.sigma)
    free_wind = {"wind_east_m_s", "wind_north_m_s"} & set(beliefs)
    windy = free_wind or float(scene.air.wind_east) or float(scene.air.wind_north)
    wind = f" in {'a free' if free_wind else 'a'} wind" if windy else ""
    directed = np.isin(log.quantity, [*DIRECTIONS, *(FEEL_WIND if windy else ())])
    # the default scene assumes the origin, which the user can free instead
    advice = ", where the charge is; expected a distance from it"
    has_times = set(CLOCK_TIMES) & set(log.quantity)
    place = [*CHARGE_POSITION[:2], *(["origin_time_s"] if has_times else [])]
    to_free = ",".join(name for name in place if name not in beliefs)
    if is_default and to_free:
        advice = (
            "; no scene given: the charge is assumed at the origin; add "
            f"{argument('freed')} {to_free}"
        )
    after = "after the origin time, {start} s on this clock (correct it, or free "
    rules = [
        (
            "quantity",
            np.isin(log.quantity, SAMPLES),
            "expected readings, got the samples of {record}; pick them first",
        ),
        (
            "shot",
            shots < 0,
            "expected one of the scene's charges, {charges}; got {shot}",
        ),
        (
            "shot",
            [len(scene.charges) == 1 and shot != log.shot[0] for shot in log.shot],
            "expected {first_shot} as in the rows before, got {shot}: several shots in "
            "a log need a scene with a [[charge]] named for each",
        ),
        (
            "clock",
            [
                clock not in ("", sensor) and sensor in own
                for clock, sensor in zip(log.clock, log.sensor, strict=True)
            ],
            "got {clock}, but the scene gives sensor {sensor} a clock_offset_s of its "
            "own; expected one of the two",
        ),
        (
            "",
            # degrees are converted with rounding, so positions need not be equal
            np.linalg.norm(log.position - known, axis=1) > POSITION_TOLERANCE,
            "sensor {sensor} stands at {at}; expected {known} as in the scene"
            + ("" if log.frame is None else PLACE_ADVICE),
        ),
        ("", [row in unseen for row in range(len(log))], "{unseen}"),
        (
            "",
            of_charge([bool(charge.never) for charge in charges]),
            "got a row of {charge}, which never happens in the scene: its time is inf; "
            "expected a finite time",
        ),
        (
            "range_m",
            ranged & is_free(*CHARGE_POSITION[:2]),
            "a range cannot place a charge, whose charge_east_m or charge_north_m is "
            "not fixed: expected east_m, north_m, up_m; got range_m = {range:g}",
        ),
        (
            "range_m",
            ranged & is_free("charge_range_m"),
            "got {range:g}, but [charge] range_m of the scene is not fixed; expected "
            "one of the two",
        ),
        (
            "range_m",
            np.abs(given - stated) > POSITION_TOLERANCE,
            "got {range!r}; expected {stated!r} as in the scene",
        ),
        (
            "",
            # false without a reading that needs the distance
            needs & np.isin(shots, list(first)) & (np.array(log.sensor) != whose),
            "[charge] range_m of the scene is the distance to one sensor, {first}; got "
            "{sensor}",
        ),
        (
            "",
            needs & ~by_range & lost & ~ranged,
            "expected east_m, north_m, up_m or range_m, here or in a [[sensor]] of the "
            "scene named {sensor}; got neither",
        ),
        (
            "",
            (away == 0) & ~ranged & ~by_range & ~is_free(*CHARGE_POSITION),
            "sensor {sensor} stands at {at}" + advice,
        ),
        (
            "time_s",
            timed & np.isin(log.quantity, FIREBALL_RADII) & (log.time <= start),
            "{quantity} at {time:g} s; expected a time " + after + "origin_time_s)",
        ),
        (
            "",
            timed & np.isin(log.quantity, ARRIVALS) & (latest <= start),
            "{quantity} is {value:g} s; expected it " + after + "{offset})",
        ),
        (
            "",
            (lost | by_range.any()) & directed,
            "expected east_m, north_m, up_m for {quantity}" + wind + ", and [charge] "
            "position_m; got a range alone, which has no direction",
        ),
    ]

    def facts(row: int) -> dict[str, Any]:
        charge, clock = charges[shots[row]].name, clocks[row]
        offset = f" or {CLOCK_OFFSET}.{clock}" if clock in apart else ""
        return {
            "sensor": shown(log.sensor[row]),
            "quantity": log.quantity[row],
            "value": log.value[row],
            "time": log.time[row],
            "range": float(given[row]),
            "stated": float(stated[row]),
            "record": shown(records[row]),
            "clock": shown(log.clock[row]),
            "shot": shown(log.shot[row]) if log.shot[row] else "nothing",
            "first_shot": shown(log.shot[0]),
            "charge": shown(charge) if charge else "a charge",
            "charges": ", ".join(map(shown, names)),
            "at": metres(position[row]),
            "known": metres(known[row]),
            "unseen": unseen.get(row),
            "first": shown(whose[row]),
            "start": f"{start[row]:g}",
            "offset": f"origin_time_s{offset}",
        }

    found: dict[int, InputError] = {}
    for column, bad, message in rules:
        for row in np.flatnonzero(bad)[:MAX_FAULTS].tolist():
            if row not in found:
                text = message.format_map(facts(row))
                found[row] = log.fault(row, text, column)
    if faults is not None:
        faults += found.values()
    elif found:
        raise next(iter(found.values()))
    return replace(log, position=there)


def scene_positions(log: Observations, scene: Scene) -> Float[np.ndarray, "row 3"]:
    """Return the position of each row's sensor in a scene; NaN without one."""
    sensors = {sensor.name: np.asarray(sensor.position_m) for sensor in scene.sensors}
    at = [sensors.get(name, np.full(3, np.nan)) for name in log.sensor]
    return np.array(at, float).reshape(-1, 3)


def _missing(position: Float[np.ndarray, "row 3"]) -> Bool[np.ndarray, "row 1"]:
    return np.asarray(np.isnan(position).any(axis=1, keepdims=True))


def camera_place(
    scene: Scene, stated: Float[ArrayLike, "3"], who: str
) -> Float[np.ndarray, "3"]:
    """Return the position of the camera that measured a fireball.

    Args:
        scene: Has the camera.
        stated: Its position in the log [m]; NaN if there is none.
        who: Source of the reading, for the messages.

    Raises:
        InputError: The scene has no camera, or the camera is at another position.
    """
    if scene.camera is None:
        raise InputError(
            f"{who}: fireball_radius_px is measured by the camera of the scene; "
            "expected a [camera] with position_m and focal_px, got none"
        )
    # a mounted camera moves with a vehicle, and its position at the reading is unknown
    if scene.camera.mount:
        raise InputError(
            f"{who}: fireball_radius_px is measured by the camera of the scene; "
            f'expected a camera at rest, got mount = "{scene.camera.mount}"'
        )
    at, stated = np.asarray(scene.camera.position), np.asarray(stated)
    # false for NaN, where the log has no position
    if np.linalg.norm(at - stated) > POSITION_TOLERANCE:
        raise InputError(
            f"{who}: fireball_radius_px at {metres(stated)}; expected {metres(at)}, "
            "the position of the [camera] of the scene"
        )
    return at


def metres(position: np.ndarray) -> str:
    """Return a position as text for a message."""
    return "[" + ", ".join(f"{x:.10g}" for x in position.tolist()) + "] m"
