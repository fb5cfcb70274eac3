"""Plans by a pattern: a field flown over in lanes, a place flown around."""

import math

import numpy as np

from jblast.errors import InputError
from jblast.missions.frame import geodetic
from jblast.missions.plan.commands import (
    MISSION,
    RELATIVE,
    RETURN,
    TAKEOFF,
    TURNS,
    WAYPOINT,
)
from jblast.missions.plan.item import Item, Parameters, Plan
from jblast.observations.places.frame import Frame
from jblast.scene import Place

MOST_LANES = 1000


def grid_plan(
    home: Place,
    *,
    width_m: float,
    depth_m: float,
    spacing_m: float,
    up_m: float,
    centre_m: tuple[float, float] = (0.0, 0.0),
    speed_m_s: float | None = None,
) -> Plan:
    """Return a plan that flies over a field in lanes, and returns.

    Args:
        home: Where it takes off.
        width_m: Of the field, east to west, along the lanes.
        depth_m: North to south; 0: one lane.
        spacing_m: Between two lanes, at most.
        up_m: Height above home.
        centre_m: Of the field, east and north of home.
        speed_m_s: Of the flight; None: the vehicle's.

    Raises:
        InputError: There are too many lanes.
    """
    lanes = 1 + math.ceil(depth_m / spacing_m - 1e-9)
    if lanes > MOST_LANES:
        raise InputError(
            f"grid: expected at most {MOST_LANES} lanes, got {lanes}: {depth_m:g} m "
            f"every {spacing_m:g} m"
        )
    norths = np.linspace(-0.5, 0.5, lanes) * depth_m if lanes > 1 else np.zeros(1)
    places = []
    for n, north in enumerate(norths):
        side = (0.5 if n % 2 else -0.5) * width_m
        places += [
            (centre_m[0] + side, centre_m[1] + north),
            (centre_m[0] - side, centre_m[1] + north),
        ]
    return _plan(home, places, up_m, speed_m_s)


def orbit_plan(
    home: Place,
    *,
    radius_m: float,
    turns: float,
    up_m: float,
    centre_m: tuple[float, float] = (0.0, 0.0),
    speed_m_s: float | None = None,
) -> Plan:
    """Return a plan that flies around a place, clockwise, and returns.

    Args:
        home: Where it takes off.
        radius_m: Of the circle; negative: the other way round.
        turns: How many.
        up_m: Height above home.
        centre_m: Of the circle, east and north of home.
        speed_m_s: Of the flight; None: the vehicle's.
    """
    return _plan(home, [centre_m], up_m, speed_m_s, turns=turns, radius_m=radius_m)


def _plan(
    home: Place,
    places: list[tuple[float, float]],
    up_m: float,
    speed_m_s: float | None,
    turns: float | None = None,
    radius_m: float | None = None,
) -> Plan:
    """Return take-off, the places, and return."""
    points = np.array([(*place, 0.0) for place in places])
    on_earth = geodetic(Frame(*home), points)
    rows: list[tuple[int, int, Parameters]] = [
        (TAKEOFF, RELATIVE, (0.0, 0.0, 0.0, None, home.lat_deg, home.lon_deg, up_m))
    ]
    for lat, lon, _ in on_earth.tolist():
        # a ten-millionth of a degree, 1 cm, is what MAVLink sends
        where = (round(lat, 9), round(lon, 9), up_m)
        if turns is None:
            rows.append((WAYPOINT, RELATIVE, (0.0, 0.0, 0.0, None, *where)))
        else:
            rows.append((TURNS, RELATIVE, (turns, 0.0, radius_m, 0.0, *where)))
    rows.append((RETURN, MISSION, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)))
    items = tuple(Item(n, *row) for n, row in enumerate(rows, start=1))
    return Plan(items, home, hover_speed_m_s=speed_m_s)
