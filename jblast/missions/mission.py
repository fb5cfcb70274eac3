"""A plan as what flies: its stops, its legs, its guidance, and how long it takes."""

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from jblast.errors import InputError
from jblast.missions.course import legs_along
from jblast.missions.frame import frame_of, level
from jblast.missions.guidance import CALIBRATE_S, IDLE_S, LANDED_S, Guidance
from jblast.missions.legs import Legs
from jblast.missions.limits import Limits
from jblast.missions.plan.item import Plan
from jblast.missions.route import stops_of
from jblast.missions.stops import Stop
from jblast.observations.places.frame import Frame
from jblast.scene import Place

ON_GROUND_M = 0.5
"""How far from the ground's height a home may lie; it is then taken as on it."""


class Mission(NamedTuple):
    """A plan that can be flown.

    Attributes:
        plan: What was asked for.
        frame: Where east-north-up has its origin.
        home_m: Where the vehicle stands at the start: east, north, up.
        stops: The places on its way.
        guidance: How they are flown to.
    """

    plan: Plan
    frame: Frame
    home_m: Float[np.ndarray, "3"]
    stops: list[Stop]
    guidance: Guidance


def mission_of(
    plan: Plan,
    *,
    place: Place | None = None,
    position_m: Float[np.ndarray, "3"] | None = None,
    yaw_rad: float = 0.0,
    limits: Limits | None = None,
    may_hover_on: bool = False,
) -> Mission:
    """Return a plan as what flies, from the ground at height 0.

    Args:
        plan: The plan.
        place: Where the origin lies; None: at the plan's home.
        position_m: Where the vehicle stands; None: at the plan's home.
        yaw_rad: Its heading there.
        limits: How it is flown where the plan does not say; None: as PX4 does.
        may_hover_on: Whether it may end in the air.

    Raises:
        InputError: The plan cannot be flown, or as in `stops_of`.
    """
    limits = Limits() if limits is None else limits
    frame = frame_of(plan, place)
    if position_m is None:
        if plan.home is None:
            raise InputError(
                f"{plan.where}: home: expected a first line with home, or the scene's "
                "[vehicle] position_m, got neither"
            )
        home = level(frame, *plan.home)
        if abs(home[2]) > ON_GROUND_M:
            raise InputError(
                f"{plan.where}: home: expected its height to be that of the scene's "
                f"[place], alt_m {frame.alt_m:g}, where the ground is, got "
                f"{plan.home.alt_m:g} m: a mission that starts "
                f"{'in the air' if home[2] > 0 else 'below ground'}"
            )
        home[2] = 0.0
    else:
        home = np.array(position_m, float)
        if home[2] > 0:
            raise InputError(
                f"{plan.where}: expected a vehicle that stands on the ground, up 0 m, "
                f"got one at {home[2]:g} m: a mission that starts in the air"
            )
    stops = stops_of(plan, frame, home, limits, may_hover_on=may_hover_on)
    legs = legs_along(stops, home, limits)
    guidance = Guidance(legs, limits.acceleration_m_s2, yaw_rad)
    return Mission(plan, frame, home, stops, guidance)


def planned_seconds(legs: Legs, acceleration_m_s2: float) -> float:
    """Return how long legs take where nothing disturbs; infinite: they have no end.

    Args:
        legs: One plan's, not padded.
        acceleration_m_s2: Of the set point.
    """
    total, speed = CALIBRATE_S + IDLE_S, 0.0
    lengths, most, ends, holds = (
        np.asarray(x, float)
        for x in (legs.length_m, legs.speed_m_s, legs.end_speed_m_s, legs.hold_s)
    )
    for length, limit, end, hold, waits, lands in zip(
        lengths, most, ends, holds, legs.waits, legs.lands, strict=True
    ):
        begin = min(speed, limit)
        square = acceleration_m_s2 * length + (begin * begin + end * end) / 2
        top = max(min(limit, math.sqrt(square)), begin, end)
        if top > 0:
            ways = (2 * top * top - begin * begin - end * end) / (2 * acceleration_m_s2)
            total += (2 * top - begin - end) / acceleration_m_s2
            total += max(length - ways, 0.0) / top
        speed = end
        if waits:
            total += LANDED_S if lands else hold
    return total
