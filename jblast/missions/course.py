r"""From stops to legs: straight lines, rounded where the set point passes.

A corner by an angle $\theta$ that need not be stopped at is cut by an arc of radius $r$
that touches both lines: it leaves them $r \tan(\theta/2)$ before the corner and comes
as near as $r (1/\cos(\theta/2) - 1)$ to it, half the acceptance radius; neither takes
more than half of a line. It is flown at $\sqrt{a r}$ at most. Speeds at the ends of
legs are such that what follows can be braked for, $v^2 \le v_{next}^2 + 2 a l$.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Float

from jblast.missions.legs import FIELDS, Legs
from jblast.missions.limits import Limits
from jblast.missions.stops import Stop

SHORTEST_M = 1e-3
"""What is shorter is no line."""
BELOW_M = 3.0
"""How far below the ground the set point of a landing goes: the vehicle comes to rest
on it before."""
STRAIGHT = math.radians(0.5)
"""A corner of less is none; of more than half a turn less this, a stop."""

Vector = Float[np.ndarray, "3"]


def legs_along(stops: Sequence[Stop], start_m: Vector, limits: Limits) -> Legs:
    """Return the legs that lead to stops, one after another.

    Args:
        stops: As `stops_of` returns them.
        start_m: Where the vehicle stands.
        limits: Of the set point's acceleration.
    """
    rows: list[dict] = []
    ways = _straight(stops, start_m)
    acceleration = limits.acceleration_m_s2
    cut = 0.0  # of the line ahead, by the arc behind
    for n, (stop, start, end, way) in enumerate(ways):
        length = float(np.linalg.norm(end - start))
        after = ways[n + 1] if n + 1 < len(ways) else None
        arc = None if after is None else _arc(stop, length, way, after, acceleration)
        take = 0.0 if arc is None else arc["take"]
        known = {"goal_m": stop.goal_m, "acceptance_m": stop.acceptance_m}
        known |= {"yaw_rad": stop.yaw_rad, "visit": stop.visit, "hold_s": stop.hold_s}
        passes = arc is not None
        rows.append(
            known
            | {
                "start_m": start + cut * way,
                "along": way,
                "length_m": max(length - cut - take, 0.0),
                "speed_m_s": _speed(stop, way),
                "waits": not passes and not stop.turns,
                "lands": stop.lands,
                "end_speed_m_s": math.inf if passes else 0.0,
            }
        )
        if arc is not None and arc["row"]["length_m"]:
            rows.append(known | arc["row"] | {"start_m": end - take * way})
        if stop.turns:
            rows.append(known | _circle(stop, end, acceleration))
        cut = take
    _brake(rows, acceleration)
    return _table(rows)


def _straight(
    stops: Sequence[Stop], start_m: Vector
) -> list[tuple[Stop, Vector, Vector, Vector]]:
    """Return the line to each stop: start, end, direction."""
    at, way, found = np.array(start_m, float), np.array([0.0, 0.0, 1.0]), []
    for stop in stops:
        end = stop.goal_m
        if stop.lands:
            end = end - np.array([0.0, 0.0, BELOW_M])
        if stop.turns:
            end = _entry(stop, at)
        line = end - at
        length = np.linalg.norm(line)
        if length > SHORTEST_M:
            way = line / length
        else:
            end = at
        found.append((stop, at, end, way))
        at = _exit(stop, end) if stop.turns else end
    return found


def _arc(
    stop: Stop, length: float, way: Vector, after: tuple, acceleration: float
) -> dict | None:
    """Return the arc around a stop that is passed; None: it stops there."""
    if stop.stops or stop.hold_s or stop.lands or stop.turns:
        return None
    following, start, end, onward = after
    ahead = float(np.linalg.norm(end - start))
    if min(length, ahead) <= SHORTEST_M:
        return None
    angle = math.acos(float(np.clip(way @ onward, -1.0, 1.0)))
    if angle > math.pi - STRAIGHT:
        return None
    row = {"speed_m_s": min(_speed(stop, way), _speed(following, onward))}
    row |= {"waits": False, "end_speed_m_s": math.inf, "along": way}
    if angle < STRAIGHT:
        return {"take": 0.0, "row": row | {"length_m": 0.0}}
    tangent = math.tan(angle / 2)
    radius = min(
        0.5 * stop.acceptance_m / (1 / math.cos(angle / 2) - 1),
        0.5 * min(length, ahead) / tangent,
    )
    inward = onward - (onward @ way) * way
    row |= {
        "inward": inward / np.linalg.norm(inward),
        "curvature_per_m": 1 / radius,
        "length_m": radius * angle,
        "speed_m_s": min(row["speed_m_s"], math.sqrt(acceleration * radius)),
    }
    return {"take": radius * tangent, "row": row}


def _entry(stop: Stop, at: Vector) -> Vector:
    """Return the nearest point of a circle; from its middle, the northern one."""
    out = at - stop.goal_m
    out[2] = 0.0
    length = np.linalg.norm(out)
    out = out / length if length > SHORTEST_M else np.array([0.0, 1.0, 0.0])
    return stop.goal_m + abs(stop.radius_m) * out


def _circle(stop: Stop, start: Vector, acceleration: float) -> dict:
    """Return the leg around a stop."""
    radius = abs(stop.radius_m)
    inward = (stop.goal_m - start) / radius
    sense = math.copysign(1.0, stop.radius_m)
    # clockwise from above: the middle is to the right
    along = sense * np.array([-inward[1], inward[0], 0.0])
    end = _exit(stop, start)
    return {
        "start_m": start,
        "along": along,
        "inward": inward,
        "curvature_per_m": 1 / radius,
        "length_m": 2 * math.pi * radius * stop.turns,
        "speed_m_s": min(stop.speed_m_s, math.sqrt(acceleration * radius)),
        "waits": True,
        "end_speed_m_s": 0.0,
        "goal_m": end,
    }


def _exit(stop: Stop, start: Vector) -> Vector:
    """Return where a circle is left."""
    east, north, _ = start - stop.goal_m
    angle = -math.copysign(2 * math.pi * stop.turns, stop.radius_m)
    sine, cosine = math.sin(angle), math.cos(angle)
    turned = [cosine * east - sine * north, sine * east + cosine * north, 0.0]
    return stop.goal_m + np.array(turned)


def _speed(stop: Stop, way: Vector) -> float:
    """Return the most speed along a line, of its parts over ground, up and down."""
    across, up = float(np.hypot(way[0], way[1])), float(way[2])
    limit = math.inf if across < 1e-9 else stop.speed_m_s / across
    if up > 1e-9:
        limit = min(limit, stop.climb_m_s / up)
    if up < -1e-9:
        limit = min(limit, stop.descent_m_s / -up)
    return limit


def _brake(rows: list[dict], acceleration: float) -> None:
    """Set the speeds at the ends of legs that are passed."""
    allowed = 0.0  # at the start of the leg after
    for row in reversed(rows):
        if row["waits"]:
            row["end_speed_m_s"] = 0.0
        else:
            row["end_speed_m_s"] = min(row["end_speed_m_s"], allowed, row["speed_m_s"])
        end = row["end_speed_m_s"]
        reach = math.sqrt(end * end + 2 * acceleration * row["length_m"])
        allowed = min(row["speed_m_s"], reach)


def _table(rows: Sequence[dict]) -> Legs:
    """Return the rows as arrays."""
    none = {"inward": np.zeros(3), "curvature_per_m": 0.0, "lands": False}
    whole = [none | row for row in rows]
    columns: dict[str, Any] = {
        name: np.array([row[name] for row in whole]) for name in FIELDS
    }
    return Legs(**columns)
