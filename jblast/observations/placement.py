"""Positions of a log's sensors from the log and its scene, which must agree.

A position is given by the log, by the scene, or by both within 1 mm; a row may have a
slant range instead. A fireball's radius is measured from the camera of the scene. A
combination for which no law can be evaluated is refused: a sensor at the charge, a row
without a distance, an arrival more than five standard deviations before a fixed origin
time, a wind together with a range that has no direction, and a charge that never
explodes.
"""

from collections.abc import Callable, Collection
from dataclasses import replace

import numpy as np
from jaxtyping import ArrayLike, Bool, Float, Int

from jblast.errors import InputError, argument, shown
from jblast.observations.clocks import check_clocks, clocks_apart
from jblast.observations.table import SAMPLES, Observations
from jblast.parameters import CHARGE_POSITION, CLOCK_OFFSET, PARAMETERS
from jblast.quantities import (
    ARRIVALS,
    BY_CAMERA,
    CLOCK_TIMES,
    DIRECTIONS,
    FEEL_WIND,
    FIREBALL_RADII,
    PLACELESS,
)
from jblast.scene import Charge, Scene

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
"""Largest number of reported faults: a log with more belongs to another scene."""


def resolve_positions(
    observations: Observations,
    scene: Scene,
    beliefs: Collection[str] = (),
    *,
    is_default: bool = False,
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

    Raises:
        InputError: A sensor's position is missing, or given twice and differently, or a
            row cannot be used with this scene.
    """
    found, faults = placed(observations, scene, beliefs, is_default=is_default)
    if faults:
        raise faults[0]
    return found


def placed(
    observations: Observations,
    scene: Scene,
    beliefs: Collection[str] = (),
    *,
    is_default: bool = False,
) -> tuple[Observations, list[InputError]]:
    """Return a log with the positions of the scene, and a fault of each faulty row.

    Args:
        observations: As in `resolve_positions`, likewise all others.
        scene: The scene.
        beliefs: Names of the scene's parameters that are not fixed.
        is_default: True if no scene was given.

    Raises:
        InputError: The log as a whole cannot be used with this scene.
    """
    log, faults = observations, _Faults(observations)
    shots = _shots(log, scene, faults)
    check_clocks(log, scene, beliefs, faults.add)
    nowhere = np.full(3, np.nan)
    # a scene may describe a sensor without its position
    sensors = {sensor.name: np.asarray(sensor.position_m) for sensor in scene.sensors}
    known = np.array([sensors.get(name, nowhere) for name in log.sensor], float)
    known = known.reshape(-1, 3)
    position = log.position.copy()
    again = "" if log.frame is None else PLACE_ADVICE
    # degrees are converted with rounding, so positions need not be equal
    faults.add(
        np.linalg.norm(position - known, axis=1) > POSITION_TOLERANCE,
        lambda row: (
            f"sensor {shown(log.sensor[row])} stands at {metres(position[row])}; "
            f"expected {metres(known[row])} as in the scene{again}"
        ),
    )
    missing = np.isnan(position).any(axis=1)
    position[missing] = known[missing]
    for row in np.flatnonzero(np.isin(log.quantity, BY_CAMERA)).tolist():
        try:
            who = f"sensor {shown(log.sensor[row])}"
            position[row] = camera_place(scene, position[row], who)
        except InputError as fault:
            faults.add_row(row, str(fault))
    for shot, charge in enumerate(scene.charges):
        here = shots == shot
        label = scene.label(charge)
        free = {base for base in PARAMETERS if base + label in beliefs}
        named = f"of {shown(charge.name)}" if charge.name else "of a charge"
        faults.add(
            here & bool(charge.never),
            lambda _, named=named: (
                f"got a row {named}, which never happens in the scene: its time is "
                "inf; expected a finite time"
            ),
        )
        _check_ranges(faults, position, charge, here, free)
        # the slant range replaces the position
        position[here & ~np.isnan(log.slant_range)] = np.nan
        _check_distances(faults, position, charge, here)
        if not free & set(CHARGE_POSITION) and charge.range_m is None:
            at = np.array(charge.position_m, float)
            # the default scene assumes the origin, which the user can free instead
            advice = ", where the charge is; expected a distance from it"
            if is_default and (to_free := _to_free(log, beliefs)):
                advice = (
                    "; no scene given: the charge is assumed at the origin; add "
                    f"{argument('freed')} {','.join(to_free)}"
                )
            faults.add(
                here & (np.linalg.norm(position - at, axis=1) == 0),
                lambda row, advice=advice: (
                    f"sensor {shown(log.sensor[row])} stands at "
                    f"{metres(position[row])}{advice}"
                ),
            )
        if "origin_time_s" not in free:
            _check_times(faults, scene, charge, here, beliefs)
    ranged = any(charge.range_m is not None for charge in scene.charges)
    lost = np.isnan(position).any(axis=1) | ranged
    got = "got a range alone, which has no direction"
    faults.add(
        lost & np.isin(log.quantity, tuple(DIRECTIONS)),
        lambda row: (
            f"expected east_m, north_m, up_m for {log.quantity[row]}, and [charge] "
            f"position_m; {got}"
        ),
    )
    free_wind = {"wind_east_m_s", "wind_north_m_s"} & set(beliefs)
    windy = free_wind or float(scene.air.wind_east) or float(scene.air.wind_north)
    faults.add(
        lost & np.isin(log.quantity, FEEL_WIND) & bool(windy),
        lambda _: (
            "expected east_m, north_m, up_m, since the scene has "
            f"{'a free' if free_wind else 'a'} wind; {got}"
        ),
    )
    return replace(log, position=position), list(faults.found.values())


class _Faults:
    """Faults of a log with a scene, the first of each row.

    Attributes:
        log: The log.
        found: Faults by row, in the order of the checks.
    """

    def __init__(self, log: Observations):
        self.log = log
        self.found: dict[int, InputError] = {}

    def add(
        self,
        bad: Bool[np.ndarray, " row"],
        message: Callable[[int], str],
        column: str = "",
    ) -> None:
        """Add a fault for each bad row."""
        for row in np.flatnonzero(bad).tolist():
            if len(self.found) < MAX_FAULTS:
                self.add_row(row, message(row), column)

    def add_row(self, row: int, message: str, column: str = "") -> None:
        """Add the fault of a row, if it has none."""
        self.found.setdefault(row, self.log.fault(row, message, column))


def _to_free(observations: Observations, beliefs: Collection[str]) -> tuple[str, ...]:
    """Return the place and time of the default scene that a log could fit instead."""
    timed = set(CLOCK_TIMES) & set(observations.quantity)
    names = (*CHARGE_POSITION[:2], *(("origin_time_s",) if timed else ()))
    return tuple(name for name in names if name not in beliefs)


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


def _shots(log: Observations, scene: Scene, faults: _Faults) -> Int[np.ndarray, " row"]:
    """Return the index of the charge of each row."""
    faults.add(
        np.isin(log.quantity, SAMPLES),
        lambda row: (
            f"expected readings, got the samples of {shown(log.records()[row])}; pick "
            "them first"
        ),
        "quantity",
    )
    if scene.others:
        names = [charge.name for charge in scene.charges]
        shots = [names.index(n) if n in names else -1 for n in log.shot]
        faults.add(
            np.array(shots) < 0,
            lambda row: (
                "expected one of the scene's charges, "
                f"{', '.join(map(shown, names))}; got "
                f"{shown(log.shot[row]) if log.shot[row] else 'nothing'}"
            ),
            "shot",
        )
        return np.array(shots)
    faults.add(
        np.array([shot != log.shot[0] for shot in log.shot], bool),
        lambda row: (
            f"expected {shown(log.shot[0])} as in the rows before, got "
            f"{shown(log.shot[row])}: several shots in a log need a scene with a "
            "[[charge]] named for each"
        ),
        "shot",
    )
    return np.zeros(len(log), int)


def _check_ranges(
    faults: _Faults,
    position: np.ndarray,
    charge: Charge,
    here: Bool[np.ndarray, " row"],
    free: Collection[str],
) -> None:
    """Refuse a slant range beside a free place, or one the scene contradicts."""
    given = faults.log.slant_range
    here = here & ~np.isnan(given)
    for name in CHARGE_POSITION[:2]:
        faults.add(
            here & (name in free),
            lambda row, name=name: (
                f"a range cannot place a charge: {name} is not fixed, so expected "
                f"east_m, north_m, up_m; got range_m = {given[row]:g}"
            ),
            "range_m",
        )
    faults.add(
        here & ("charge_range_m" in free),
        lambda row: (
            f"got {given[row]:g}, but [charge] range_m of the scene is not fixed; "
            "expected one of the two"
        ),
        "range_m",
    )
    stated = np.full(len(given), np.nan)
    if charge.range_m is not None:
        stated[:] = float(charge.range_m)
    # both positions are fixed, so the range follows from them
    elif "charge_up_m" not in free:
        stated = np.linalg.norm(position - np.array(charge.position_m, float), axis=1)
    faults.add(
        here & (np.abs(given - stated) > POSITION_TOLERANCE),
        lambda row: (
            f"got {float(given[row])!r}; expected {float(stated[row])!r} as in the "
            "scene"
        ),
        "range_m",
    )


def _check_distances(
    faults: _Faults,
    position: np.ndarray,
    charge: Charge,
    here: Bool[np.ndarray, " row"],
) -> None:
    """Refuse rows without a distance from the charge.

    Raises:
        InputError: The scene has the distance to one sensor, and the log several.
    """
    log = faults.log
    # some quantities, as the time of the flash, do not depend on the distance
    needs = here & ~np.isin(log.quantity, PLACELESS)
    if charge.range_m is not None:
        names = list(dict.fromkeys(np.array(log.sensor, dtype=object)[needs]))
        if len(names) > 1:
            raise InputError(
                f"{log.source or 'observations'}: [charge] range_m of the scene is the "
                "distance to one sensor; got the sensors "
                f"{', '.join(map(shown, names[:5]))}"
            )
        return
    faults.add(
        needs & np.isnan(position).any(axis=1) & np.isnan(log.slant_range),
        lambda row: (
            "expected east_m, north_m, up_m or range_m, here or in a [[sensor]] of the "
            f"scene named {shown(log.sensor[row])}; got neither"
        ),
    )


def _check_times(
    faults: _Faults,
    scene: Scene,
    charge: Charge,
    here: Bool[np.ndarray, " row"],
    beliefs: Collection[str],
) -> None:
    """Refuse readings from before a fixed origin time.

    Errors of arrivals are allowed for, up to `EARLY_SIGMAS` standard deviations.
    """
    log, clocks = faults.log, faults.log.clocks()
    offsets = {name: float(offset) for name, offset in scene.clock_offsets().items()}
    start = float(charge.time_s) + np.array([offsets.get(name, 0.0) for name in clocks])
    # an unknown offset may move any reading behind the origin time
    unset = {name for name in clocks if f"{CLOCK_OFFSET}.{name}" in beliefs}
    here = here & ~np.isin(clocks, list(unset))
    apart = clocks_apart(log)
    faults.add(
        here & np.isin(log.quantity, tuple(FIREBALL_RADII)) & (log.time <= start),
        lambda row: (
            f"{log.quantity[row]} at {log.time[row]:g} s; expected a time after the "
            f"origin time, {start[row]:g} s on this clock (correct it, or free "
            "origin_time_s)"
        ),
        "time_s",
    )
    latest = log.value + EARLY_SIGMAS * np.nan_to_num(log.sigma)
    faults.add(
        here & np.isin(log.quantity, tuple(ARRIVALS)) & (latest <= start),
        lambda row: (
            f"{log.quantity[row]} is {log.value[row]:g} s; expected it after the "
            f"origin time, {start[row]:g} s on this clock (correct it, or free "
            "origin_time_s"
            + (f" or {CLOCK_OFFSET}.{clocks[row]})" if clocks[row] in apart else ")")
        ),
    )


def metres(position: np.ndarray) -> str:
    """Return a position as text for a message."""
    return "[" + ", ".join(f"{x:.10g}" for x in position.tolist()) + "] m"
