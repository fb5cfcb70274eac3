"""Where the sensors of a log stand: what the log says and what the scene says."""

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from jblast.errors import InputError, shown
from jblast.observations.table import Observations
from jblast.scene import Scene

EARLY = 5.0
"""A reading this many sigmas before the origin time is no error of measurement."""
AGREE = 1e-3
"""How far a place given twice may differ [m]."""


def place(
    observations: Observations, scene: Scene, beliefs: Collection[str] = ()
) -> Observations:
    """Fill in the positions of sensors from the scene, and check what both say.

    Afterwards each row has a position or a slant range, unless it is a
    `shock_radius_m`, which needs none, or the scene gives the charge's range.

    Args:
        observations: The log.
        scene: What stands where.
        beliefs: Names of the scene's parameters that are not fixed.

    Raises:
        InputError: A sensor's place is missing, or given twice and differently; or the
            log holds what nothing is built for yet.
    """
    _refuse_several(observations, "shot", observations.shot)
    _refuse_several(observations, "clock", observations.clock)
    position = observations.position.copy()
    sensors = {sensor.name: np.asarray(sensor.position) for sensor in scene.sensors}
    sensors = {name: at for name, at in sensors.items() if not np.isnan(at).any()}
    missing = set(np.flatnonzero(np.isnan(position).any(axis=1)).tolist())
    for row, name in enumerate(observations.sensor):
        known = sensors.get(name)
        if known is None:
            continue
        if row in missing:
            position[row] = known
        elif np.linalg.norm(position[row] - known) > AGREE:
            raise InputError(
                f"{_where(observations, row)}: sensor {shown(name)} stands at "
                f"{_metres(position[row])}; expected {_metres(known)} as in the scene"
            )
    for row in np.flatnonzero(~np.isnan(observations.slant_range)):
        _check_range(observations, int(row), position[row], scene, beliefs)
        position[row] = np.nan  # the slant range is what counts
    _refuse_placeless(observations, position, scene)
    if not {"charge_east_m", "charge_north_m", "charge_up_m"} & set(beliefs):
        _refuse_on_charge(observations, position, scene)
    if "origin_time_s" not in beliefs:
        _refuse_before_origin(observations, scene)
    return replace(observations, position=position)


def _refuse_several(
    observations: Observations, column: str, names: tuple[str, ...]
) -> None:
    """Refuse a log of several shots or clocks."""
    distinct = list(dict.fromkeys(names))
    if len(distinct) > 1:
        row = names.index(distinct[1])
        raise InputError(
            f"{_where(observations, row)}, column {column}: more than one {column} in "
            f"a log is not supported yet; expected {shown(distinct[0])} as in the rows "
            f"before, got {shown(distinct[1])}"
        )


def _check_range(
    observations: Observations,
    row: int,
    position: np.ndarray,
    scene: Scene,
    beliefs: Collection[str],
) -> None:
    """Refuse a slant range beside a free place, or one the scene contradicts."""
    where = f"{_where(observations, row)}, column range_m"
    given = float(observations.slant_range[row])
    for name in ("charge_east_m", "charge_north_m"):
        if name in beliefs:
            raise InputError(
                f"{where}: a range cannot place a charge: {name} is not fixed, so "
                f"expected east_m, north_m, up_m; got range_m = {given:g}"
            )
    if "charge_range_m" in beliefs:
        raise InputError(
            f"{where}: got {given:g}, but [charge] range_m of the scene is not fixed; "
            "expected one of the two"
        )
    charge = scene.charge
    told = None
    if charge.range is not None:
        told = float(charge.range)
    elif not np.isnan(position).any() and "charge_up_m" not in beliefs:
        at = np.array([float(charge.east), float(charge.north), float(charge.up)])
        told = float(np.linalg.norm(position - at))
    if told is not None and abs(given - told) > AGREE:
        raise InputError(f"{where}: got {given!r}; expected {told!r} as in the scene")


def _refuse_placeless(
    observations: Observations, position: np.ndarray, scene: Scene
) -> None:
    """Refuse rows that no distance from the charge can be found for."""
    needs = np.array([q != "shock_radius_m" for q in observations.quantity])
    if scene.charge.range is not None:
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
            f"{_where(observations, row)}: expected east_m, north_m, up_m or range_m, "
            f"here or in a [[sensor]] of the scene named {shown(name)}; got neither"
        )


def _refuse_on_charge(
    observations: Observations, position: np.ndarray, scene: Scene
) -> None:
    """Refuse a sensor where the charge is fixed: no law holds at distance zero."""
    charge = scene.charge
    if charge.range is not None:
        return
    at = np.array([float(charge.east), float(charge.north), float(charge.up)])
    for row in np.flatnonzero(np.linalg.norm(position - at, axis=1) == 0):
        name = observations.sensor[row]
        raise InputError(
            f"{_where(observations, int(row))}: sensor {shown(name)} stands at "
            f"{_metres(at)}, where the charge is; expected a distance from it"
        )


def _refuse_before_origin(observations: Observations, scene: Scene) -> None:
    """Refuse a wave that arrives before a fixed origin time, errors allowed for."""
    offsets = {sensor.name: float(sensor.clock_offset) for sensor in scene.sensors}
    for row, quantity in enumerate(observations.quantity):
        if quantity not in ("air_arrival_s", "ground_arrival_s"):
            continue
        start = float(scene.charge.time) + offsets.get(observations.sensor[row], 0.0)
        allowed = EARLY * float(np.nan_to_num(observations.sigma[row]))
        if observations.value[row] + allowed <= start:
            raise InputError(
                f"{_where(observations, row)}: {quantity} is "
                f"{observations.value[row]:g} s; expected it after the origin time, "
                f"{start:g} s on this clock (correct it, or free origin_time_s)"
            )


def _where(observations: Observations, row: int) -> str:
    """Name the file and line of a row, or the row of a table made here."""
    source = observations.source or "observations"
    if observations.line:
        return f"{source}: line {observations.line[row]}"
    return f"{source}: row {row + 1}"


def _metres(position: np.ndarray) -> str:
    return "[" + ", ".join(f"{x:.10g}" for x in position.tolist()) + "] m"
