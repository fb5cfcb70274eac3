"""The places that one item of a plan asks for, from where the vehicle is before it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float

from jblast.errors import InputError
from jblast.missions.frame import level
from jblast.missions.limits import CEILING_M, FARTHEST_M, Limits
from jblast.missions.plan.commands import (
    GLOBAL,
    LAND,
    LOITER,
    LOITER_TIME,
    RETURN,
    TAKEOFF,
    TURNS,
    WAYPOINT,
)
from jblast.missions.plan.item import Item
from jblast.observations.places.frame import Frame

CIRCLE_M = 10.0
"""Radius where an item for turns says none; declared."""
RAISES = 1e-3
"""Least difference of heights that is flown by itself [m]."""


@dataclass(frozen=True)
class Stop:
    """A place on the way.

    Attributes:
        item: Place in the plan, from 0.
        goal_m: East, north, up.
        speed_m_s: Over ground, on the way there.
        climb_m_s: Upwards at most.
        descent_m_s: Downwards at most.
        acceptance_m: How near the vehicle must come.
        hold_s: How long it stays; infinite: for ever.
        yaw_rad: From east to north; NaN: as it is.
        stops: Whether the set point stops there, hold or not.
        turns: Around the goal, at `radius_m`; 0: none.
        radius_m: Positive: clockwise.
        lands: Whether it is on the ground.
        visit: Which in the order of the items as they are flown, from 0.
    """

    item: int
    goal_m: Float[np.ndarray, "3"]
    speed_m_s: float
    climb_m_s: float
    descent_m_s: float
    acceptance_m: float
    hold_s: float = 0.0
    yaw_rad: float = math.nan
    stops: bool = False
    turns: float = 0.0
    radius_m: float = 0.0
    lands: bool = False
    visit: int = 0


def held(stop: Stop) -> Stop:
    """Return a stop at the same place, for ever."""
    return replace(stop, hold_s=math.inf, stops=False, turns=0.0, lands=False)


def stops_for(
    item: Item,
    n: int,
    at: Float[np.ndarray, "3"],
    home: Float[np.ndarray, "3"],
    frame: Frame,
    speeds: dict[str, float],
    limits: Limits,
    where: str,
) -> list[Stop]:
    """Return the stops of one item, from where the vehicle is before it."""
    radius = limits.acceptance_m

    def stop(goal: Sequence[float] | np.ndarray, **options: Any) -> Stop:
        known: dict[str, Any] = {"acceptance_m": radius, **speeds}
        return Stop(n, np.array(goal, float), **(known | options))

    goal = _goal(item, at, home, frame)
    yaw = _yaw(item)
    if item.command == TAKEOFF:
        up = np.array([at[0], at[1], goal[2]])
        found = [stop(up, stops=True, yaw_rad=yaw)]
        if np.hypot(*(goal - up)[:2]) > limits.acceptance_m:
            found.append(stop(goal, yaw_rad=yaw))
        return found
    if item.command == WAYPOINT:
        radius = item.number_of(2) or radius
        _at_least(item, 1, 0.0, where)
        _at_least(item, 2, 0.0, where)
        return [stop(goal, hold_s=item.number_of(1), yaw_rad=yaw)]
    if item.command == LOITER_TIME:
        _at_least(item, 1, 0.0, where)
        return [stop(goal, hold_s=item.number_of(1), stops=True)]
    if item.command == LOITER:
        return [stop(goal, hold_s=math.inf, yaw_rad=yaw)]
    if item.command == TURNS:
        _at_least(item, 1, 0.0, where)
        circle = item.number_of(3) or CIRCLE_M
        return [stop(goal, turns=item.number_of(1), radius_m=circle, stops=True)]
    if item.command == RETURN:
        high = max(float(at[2]), float(home[2]) + limits.return_m)
        found = (
            [] if high - at[2] < RAISES else [stop((at[0], at[1], high), stops=True)]
        )
        over = np.array([home[0], home[1], high])
    else:
        found, high = [], float(at[2])
        over = np.array([goal[0], goal[1], high])
    if np.hypot(*(over - (found[-1].goal_m if found else at))[:2]) > RAISES:
        found.append(stop(over, stops=True, yaw_rad=yaw))
    slow = float(home[2]) + limits.slow_below_m
    if high > slow + RAISES:
        found.append(stop((over[0], over[1], slow), yaw_rad=yaw))
    ground = np.array([over[0], over[1], home[2]])
    slowly = min(limits.landing_m_s, speeds["descent_m_s"])
    return [*found, stop(ground, descent_m_s=slowly, lands=True, yaw_rad=yaw)]


def _goal(
    item: Item,
    at: Float[np.ndarray, "3"],
    home: Float[np.ndarray, "3"],
    frame: Frame,
) -> Float[np.ndarray, "3"]:
    """Return where an item goes to: without a place here, without a height as high."""
    lat, lon, alt = item.params[4:]
    up = at[2]
    if alt is not None:
        up = alt - frame.alt_m if item.frame == GLOBAL else home[2] + alt
    if item.place is None:
        return np.array([at[0], at[1], up])
    assert lat is not None  # else it has no place
    assert lon is not None
    east, north, _ = level(frame, lat, lon, frame.alt_m)
    return np.array([east, north, up])


def _yaw(item: Item) -> float:
    """Return a heading from east to north; NaN where an item says none."""
    degrees = item.params[3]
    if degrees is None or item.command not in (WAYPOINT, LOITER, LAND, TAKEOFF):
        return math.nan
    return math.remainder(math.pi / 2 - math.radians(degrees), 2 * math.pi)


def _at_least(item: Item, parameter: int, least: float, where: str) -> None:
    value = item.number_of(parameter)
    if value < least:
        raise InputError(
            f"{where}: {item.words}, parameter {parameter}: expected {least:g} or "
            f"more, got {value:g}"
        )


def check_reach(stop: Stop, home: Float[np.ndarray, "3"], at: str) -> None:
    """Refuse a place that cannot be reached, and say why."""
    away = float(np.hypot(*(stop.goal_m - home)[:2]))
    up = float(stop.goal_m[2] - home[2])
    if away + abs(stop.radius_m) > FARTHEST_M:
        raise InputError(
            f"{at}: expected a place within {FARTHEST_M / 1e3:g} km of home, where the "
            f"ground counts as level, got one {away / 1e3:.4g} km away: unreachable"
        )
    if up > CEILING_M:
        raise InputError(
            f"{at}: expected a height of at most {CEILING_M:g} m above home, got "
            f"{up:g} m: unreachable, above the ceiling"
        )
    if up <= 0.0 and not stop.lands:
        raise InputError(
            f"{at}: expected a height above the ground, got {up:g} m above home: "
            "unreachable, " + ("below ground" if up < 0 else "on the ground")
        )
