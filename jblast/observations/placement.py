"""Where the sensors of a log stand: what the log says and what the scene says."""

from collections.abc import Collection
from dataclasses import replace

import numpy as np
from jaxtyping import ArrayLike, Float, Int

from jblast.errors import InputError, shown
from jblast.observations.consistency import (
    AGREE,
    check_range,
    metres,
    refuse_aimless,
    refuse_before_origin,
    refuse_never,
    refuse_on_charge,
    refuse_placeless,
    refuse_wind_without_place,
)
from jblast.observations.table import SAMPLES, Observations
from jblast.observations.times.clocks import check_clocks
from jblast.parameter_table import CHARGE_POSITION, PARAMETERS
from jblast.quantities import BY_CAMERA, CLOCK_TIMES
from jblast.scene import Scene

OF_PLACE = (
    "; both count from its [place]: where that was moved, take position_m out of its "
    "[[sensor]], as the log says where they stood"
)
"""What may be wrong where a log in degrees and its scene contradict each other."""


def resolve_positions(
    observations: Observations,
    scene: Scene,
    beliefs: Collection[str] = (),
    *,
    is_default: bool = False,
) -> Observations:
    """Fill in the positions of sensors from the scene, and check what both say.

    Afterwards each row has a position or a slant range, unless it is `PLACELESS`, or
    the scene gives the charge's range. A `fireball_radius_px` is seen by the scene's
    camera, from its place; a range, of the charge or of the row, is from there.

    Args:
        observations: The log.
        scene: What stands where.
        beliefs: Names of the scene's parameters that are not fixed.
        is_default: Whether no scene was given, and the place of the charge is assumed.

    Raises:
        InputError: A sensor's place is missing, or given twice and differently; or the
            log holds what nothing is built for yet.
    """
    _refuse_samples(observations)
    shots = _shots(observations, scene)
    check_clocks(observations, scene, beliefs)
    position = observations.position.copy()
    sensors = {sensor.name: np.asarray(sensor.position_m) for sensor in scene.sensors}
    sensors = {name: at for name, at in sensors.items() if not np.isnan(at).any()}
    missing = set(np.flatnonzero(np.isnan(position).any(axis=1)).tolist())
    for row, name in enumerate(observations.sensor):
        known = sensors.get(name)
        if known is None:
            continue
        if row in missing:
            position[row] = known
        elif np.linalg.norm(position[row] - known) > AGREE:
            again = "" if observations.frame is None else OF_PLACE
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
            position[row] = np.nan  # the slant range is what counts
        refuse_placeless(observations, position, charge, here)
        if not free & set(CHARGE_POSITION):
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
    names = ("charge_east_m", "charge_north_m", *(("origin_time_s",) if timed else ()))
    return tuple(name for name in names if name not in beliefs)


def _refuse_samples(observations: Observations) -> None:
    """Refuse a record of which nothing was read yet."""
    if SAMPLES in observations.quantity:
        row = observations.quantity.index(SAMPLES)
        raise InputError(
            f"{observations.where(row)}, column quantity: expected readings, got the "
            f"samples of {shown(observations.records()[row])}; pick them first, or fit "
            "them as they are"
        )


def camera_place(
    scene: Scene, stated: Float[ArrayLike, "3"], who: str
) -> Float[np.ndarray, "3"]:
    """Return where a fireball was seen from: the camera, whatever its name in a log.

    Args:
        scene: Has the camera.
        stated: Place that is told of it elsewhere [m]; NaN if none is.
        who: What reads off its images, for the messages.

    Raises:
        InputError: The scene has no camera, or it stands elsewhere than told.
    """
    if scene.camera is None:
        raise InputError(
            f"{who}: fireball_radius_px is seen by the camera of the scene; expected a "
            "[camera] with position_m and focal_px, got none"
        )
    if scene.camera.mount:
        raise InputError(
            f"{who}: fireball_radius_px is seen by the camera of the scene; expected "
            f'one that stands still, got mount = "{scene.camera.mount}"'
        )
    at, stated = np.asarray(scene.camera.position), np.asarray(stated)
    if np.linalg.norm(at - stated) > AGREE:  # not so where nothing is told, NaN
        raise InputError(
            f"{who}: fireball_radius_px at {metres(stated)}; expected {metres(at)}, "
            "where the [camera] of the scene stands"
        )
    return at


def _shots(observations: Observations, scene: Scene) -> Int[np.ndarray, " row"]:
    """Return which of the scene's charges each row is of."""
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
