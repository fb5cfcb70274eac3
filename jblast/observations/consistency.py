"""What a log and a scene may not say together of places and times."""

from collections.abc import Collection

import numpy as np
from jaxtyping import Bool, Float

from jblast.errors import InputError, argument, shown
from jblast.observations.table import Observations
from jblast.observations.times.clocks import clocks_apart
from jblast.parameter_table import CLOCK_OFFSET
from jblast.quantities import ARRIVALS, DIRECTIONS, FEEL_WIND, FIREBALL_RADII, PLACELESS
from jblast.scene import Charge, Scene

EARLY = 5.0
"""A reading this many sigmas before the origin time is no error of measurement."""
AGREE = 1e-3
"""How far a place given twice may differ [m]."""


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
    for name in ("charge_east_m", "charge_north_m"):
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
    elif not np.isnan(position).any() and "charge_up_m" not in free:
        stated = float(np.linalg.norm(position - _place(charge)))
    if stated is not None and abs(given - stated) > AGREE:
        raise InputError(f"{where}: got {given!r}; expected {stated!r} as in the scene")


def refuse_placeless(
    observations: Observations,
    position: np.ndarray,
    charge: Charge,
    here: Bool[np.ndarray, " row"],
) -> None:
    """Refuse rows that no distance from the charge can be found for."""
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
    """Refuse a direction from nowhere: a range alone has none."""
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
        here: Which rows are of it.
        to_free: Parameters to free where its place was assumed, for want of a scene.
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
    """Refuse a row of a charge of which nothing can be recorded."""
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
    """Refuse what is told of the time before a fixed origin time.

    That of a wave's arrival has an error, which is allowed for.
    """
    offsets = {name: float(offset) for name, offset in scene.clock_offsets().items()}
    origin, sigma = float(charge.time_s), np.nan_to_num(observations.sigma)
    clocks, apart = observations.clocks(), clocks_apart(observations)
    for row in np.flatnonzero(here):
        quantity, clock = observations.quantity[row], clocks[row]
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
        allowed = EARLY * float(sigma[row])
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
    """Refuse wind where nobody knows which way the sound went."""
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
    """Return a position as a message shows it."""
    return "[" + ", ".join(f"{x:.10g}" for x in position.tolist()) + "] m"
