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
    _refuse_samples(observations)
    shots = _shots(observations, scene)
    check_clocks(observations, scene, beliefs)
    position = observations.position.copy()
    sensors = {sensor.name: np.asarray(sensor.position_m) for sensor in scene.sensors}
    # a scene may describe a sensor without its position
    sensors = {name: at for name, at in sensors.items() if not np.isnan(at).any()}
    missing = set(np.flatnonzero(np.isnan(position).any(axis=1)).tolist())
    for row, name in enumerate(observations.sensor):
        known = sensors.get(name)
        if known is None:
            continue
        if row in missing:
            position[row] = known
        # degrees are converted with rounding, so positions need not be equal
        elif np.linalg.norm(position[row] - known) > POSITION_TOLERANCE:
            again = "" if observations.frame is None else PLACE_ADVICE
            raise InputError(
                f"{observations.where(row)}: sensor {shown(name)} stands at "
                f"{metres(position[row])}; expected {metres(known)} as in the scene"
                f"{again}"
            )
    for row, quantity in enumerate(observations.quantity):
        if quantity not in BY_CAMERA:
            continue
        who = f"{observations.where(row)}: sensor {shown(observations.sensor[row])}"
        position[row] = camera_place(scene, position[row], who)
    for shot, charge in enumerate(scene.charges):
        here = shots == shot
        refuse_never(observations, charge, here)
        label = scene.label(charge)
        free = {base for base in PARAMETERS if base + label in beliefs}
        for row in np.flatnonzero(here & ~np.isnan(observations.slant_range)):
            check_range(observations, int(row), position[row], charge, free)
            # the slant range replaces the position
            position[row] = np.nan
        refuse_placeless(observations, position, charge, here)
        if not free & set(CHARGE_POSITION):
            # the default scene assumes the origin, which the user can free instead
            to_free = _to_free(observations, beliefs) if is_default else ()
            refuse_on_charge(observations, position, charge, here, to_free)
        if "origin_time_s" not in free:
            refuse_before_origin(observations, scene, charge, here, beliefs)
    refuse_aimless(observations, position, scene)
    refuse_wind_without_place(observations, position, scene, beliefs)
    return replace(observations, position=position)


def _to_free(observations: Observations, beliefs: Collection[str]) -> tuple[str, ...]:
    """Return the place and time of the default scene that a log could fit instead."""
    timed = set(CLOCK_TIMES) & set(observations.quantity)
    names = (*CHARGE_POSITION[:2], *(("origin_time_s",) if timed else ()))
    return tuple(name for name in names if name not in beliefs)


def _refuse_samples(observations: Observations) -> None:
    """Refuse a record of samples, which has no readings yet."""
    if SAMPLES in observations.quantity:
        row = observations.quantity.index(SAMPLES)
        raise InputError(
            f"{observations.where(row)}, column quantity: expected readings, got the "
            f"samples of {shown(observations.records()[row])}; pick them first"
        )


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


def _shots(observations: Observations, scene: Scene) -> Int[np.ndarray, " row"]:
    """Return the index of the charge of each row."""
    names = [charge.name for charge in scene.charges]
    if scene.others:
        for row, shot in enumerate(observations.shot):
            if shot not in names:
                raise InputError(
                    f"{observations.where(row)}, column shot: expected one of the "
                    f"scene's charges, {', '.join(map(shown, names))}; got "
                    f"{shown(shot) if shot else 'nothing'}"
                )
        return np.array([names.index(shot) for shot in observations.shot])
    distinct = list(dict.fromkeys(observations.shot))
    if len(distinct) > 1:
        row = observations.shot.index(distinct[1])
        raise InputError(
            f"{observations.where(row)}, column shot: expected {shown(distinct[0])} "
            f"as in the rows before, got {shown(distinct[1])}: several shots in a log "
            "need a scene with a [[charge]] named for each"
        )
    return np.zeros(len(observations), int)


def check_range(
    observations: Observations,
    row: int,
    position: np.ndarray,
    charge: Charge,
    free: Collection[str],
) -> None:
    """Refuse a slant range beside a free place, or one the scene contradicts."""
    where = f"{observations.where(row)}, column range_m"
    given = float(observations.slant_range[row])
    for name in CHARGE_POSITION[:2]:
        if name in free:
            raise InputError(
                f"{where}: a range cannot place a charge: {name} is not fixed, so "
                f"expected east_m, north_m, up_m; got range_m = {given:g}"
            )
    if "charge_range_m" in free:
        raise InputError(
            f"{where}: got {given:g}, but [charge] range_m of the scene is not fixed; "
            "expected one of the two"
        )
    stated = None
    if charge.range_m is not None:
        stated = float(charge.range_m)
    # both positions are fixed, so the range follows from them
    elif not np.isnan(position).any() and "charge_up_m" not in free:
        stated = float(np.linalg.norm(position - _place(charge)))
    if stated is not None and abs(given - stated) > POSITION_TOLERANCE:
        raise InputError(f"{where}: got {given!r}; expected {stated!r} as in the scene")


def refuse_placeless(
    observations: Observations,
    position: np.ndarray,
    charge: Charge,
    here: Bool[np.ndarray, " row"],
) -> None:
    """Refuse rows without a distance from the charge."""
    # some quantities, as the time of the flash, do not depend on the distance
    needs = here & ~np.isin(observations.quantity, PLACELESS)
    if charge.range_m is not None:
        names = list(dict.fromkeys(np.array(observations.sensor, dtype=object)[needs]))
        if len(names) > 1:
            raise InputError(
                f"{observations.source or 'observations'}: [charge] range_m of the "
                "scene is the distance to one sensor; got the sensors "
                f"{', '.join(map(shown, names[:5]))}"
            )
        return
    needs &= np.isnan(position).any(axis=1) & np.isnan(observations.slant_range)
    if needs.any():
        row = int(np.argmax(needs))
        name = observations.sensor[row]
        raise InputError(
            f"{observations.where(row)}: expected east_m, north_m, up_m or range_m, "
            f"here or in a [[sensor]] of the scene named {shown(name)}; got neither"
        )


def refuse_aimless(
    observations: Observations, position: np.ndarray, scene: Scene
) -> None:
    """Refuse directions of rows with a range only, which has no direction."""
    ranged = any(charge.range_m is not None for charge in scene.charges)
    lost = np.full(len(observations), ranged) | np.isnan(position).any(axis=1)
    lost &= np.isin(observations.quantity, tuple(DIRECTIONS))
    for row in np.flatnonzero(lost):
        raise InputError(
            f"{observations.where(int(row))}: expected east_m, north_m, up_m for "
            f"{observations.quantity[row]}, and [charge] position_m; got a range "
            "alone, which has no direction"
        )


def refuse_on_charge(
    observations: Observations,
    position: np.ndarray,
    charge: Charge,
    here: Bool[np.ndarray, " row"],
    to_free: Collection[str] = (),
) -> None:
    """Refuse a sensor where the charge is fixed: no law holds at distance zero.

    Args:
        observations: The log.
        position: Of each row [m].
        charge: The charge.
        here: Rows of this charge.
        to_free: Parameters to free where no scene was given and its position assumed.
    """
    if charge.range_m is not None:
        return
    at = _place(charge)
    apart = np.linalg.norm(position - at, axis=1)
    for row in np.flatnonzero(here & (apart == 0)):
        name = shown(observations.sensor[row])
        who = f"{observations.where(int(row))}: sensor {name}"
        if to_free:
            raise InputError(
                f"{who} stands at {metres(at)}; no scene given: the charge is assumed "
                f"at the origin; add {argument('freed')} {','.join(to_free)}"
            )
        raise InputError(
            f"{who} stands at {metres(at)}, where the charge is; expected a distance "
            "from it"
        )


def refuse_never(
    observations: Observations, charge: Charge, here: Bool[np.ndarray, " row"]
) -> None:
    """Refuse a row of a charge that never explodes."""
    if here.any() and bool(charge.never):
        named = f"of {shown(charge.name)}" if charge.name else "of a charge"
        raise InputError(
            f"{observations.where(int(np.argmax(here)))}: got a row {named}, which "
            "never happens in the scene: its time is inf; expected a finite time"
        )


def refuse_before_origin(
    observations: Observations,
    scene: Scene,
    charge: Charge,
    here: Bool[np.ndarray, " row"],
    beliefs: Collection[str],
) -> None:
    """Refuse readings from before a fixed origin time.

    Errors of arrivals are allowed for, up to `EARLY_SIGMAS` standard deviations.
    """
    offsets = {name: float(offset) for name, offset in scene.clock_offsets().items()}
    origin, sigma = float(charge.time_s), np.nan_to_num(observations.sigma)
    clocks, apart = observations.clocks(), clocks_apart(observations)
    for row in np.flatnonzero(here):
        quantity, clock = observations.quantity[row], clocks[row]
        # an unknown offset may move any reading behind the origin time
        if f"{CLOCK_OFFSET}.{clock}" in beliefs:
            continue
        start = origin + offsets.get(clock, 0.0)
        if quantity in FIREBALL_RADII and observations.time[row] <= start:
            raise InputError(
                f"{observations.where(int(row))}, column time_s: {quantity} at "
                f"{observations.time[row]:g} s; expected a time after the origin time, "
                f"{start:g} s on this clock (correct it, or free origin_time_s)"
            )
        if quantity not in ARRIVALS:
            continue
        allowed = EARLY_SIGMAS * float(sigma[row])
        or_free = f" or {CLOCK_OFFSET}.{clock}" if clock in apart else ""
        if observations.value[row] + allowed <= start:
            raise InputError(
                f"{observations.where(int(row))}: {quantity} is "
                f"{observations.value[row]:g} s; expected it after the origin time, "
                f"{start:g} s on this clock (correct it, or free origin_time_s"
                f"{or_free})"
            )


def refuse_wind_without_place(
    observations: Observations,
    position: np.ndarray,
    scene: Scene,
    beliefs: Collection[str],
) -> None:
    """Refuse wind for rows without a direction of the sound path."""
    wind = float(scene.air.wind_east), float(scene.air.wind_north)
    free = {"wind_east_m_s", "wind_north_m_s"} & set(beliefs)
    if not free and wind == (0.0, 0.0):
        return
    ranged = any(charge.range_m is not None for charge in scene.charges)
    lost = np.full(len(observations), ranged) | np.isnan(position).any(axis=1)
    lost &= np.isin(observations.quantity, FEEL_WIND)
    if lost.any():
        row = int(np.argmax(lost))
        raise InputError(
            f"{observations.where(row)}: expected east_m, north_m, up_m, since the "
            f"scene has {'a free' if free else 'a'} wind; got a range alone, which has "
            "no direction"
        )


def _place(charge: Charge) -> Float[np.ndarray, "3"]:
    return np.array(charge.position_m, float)


def metres(position: np.ndarray) -> str:
    """Return a position as text for a message."""
    return "[" + ", ".join(f"{x:.10g}" for x in position.tolist()) + "] m"
