r"""A plan prepared for flight: its stops, and the legs between them.

A corner with the turning angle $\theta$ and without a stop is replaced by an arc of
radius $r$, tangent to both lines. The arc begins $r \tan(\theta/2)$ before the corner,
at most half of a line, and its minimum distance from the corner is
$r (1/\cos(\theta/2) - 1)$, at most half the acceptance radius. The speed on the arc is
at most $\sqrt{a r}$. The speed at the end of a leg is limited by braking on the next
one, $v^2 \le v_{next}^2 + 2 a l$.

Horizontal positions are those of `observations.places.Frame`. Heights are above the
origin and are not changed by the conversion: the scene's ground is level, and the fall
of the Earth's surface below the plane (8 cm in a kilometre) is neglected both ways.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import ArrayLike, Float

from jblast.errors import InputError, argument
from jblast.missions.guidance import (
    CALIBRATE_S,
    FIELDS,
    IDLE_S,
    LANDED_S,
    Guidance,
    Legs,
)
from jblast.missions.plan import (
    DELAY,
    GLOBAL,
    HEADING,
    JUMP,
    LAND,
    LOITER,
    LOITER_TIME,
    MISSION,
    RELATIVE,
    RETURN,
    SPEED,
    TAKEOFF,
    TURNS,
    WAYPOINT,
    Item,
    Parameters,
    Plan,
)
from jblast.observations.places import Frame
from jblast.scene import Place

MAX_DISTANCE_M = 20e3
"""Maximum distance from home: there the Earth's surface is 31 m below the plane."""
CEILING_M = 4000.0
"""Maximum height above home: one density of air is used for all heights."""
MAX_LEGS = 5000
"""Maximum number of items with unrolled jumps; declared, bounds compile time."""
MAX_LANES = 1000
"""Maximum number of lanes of a grid; their two corners each stay within `MAX_LEGS`."""
HOME_TOLERANCE_M = 0.5
"""Tolerance of a home's height above ground, for maps' errors; home is set to it."""
MIN_LENGTH_M = 1e-3
"""Length below which a line has no direction: a millimetre."""
LANDING_DEPTH_M = 3.0
"""Depth of a landing's set point below the ground; declared.

The vehicle rests on the ground before the set point reaches it, so it descends with
full speed until contact.
"""
STRAIGHT_RAD = math.radians(0.5)
"""Angle below which a corner is straight; at half a turn less this it is a stop."""
Vector = Float[np.ndarray, "3"]
CIRCLE_M = 10.0
"""Default radius of an item for turns; declared."""
MIN_CLIMB_M = 1e-3
"""Minimum difference of heights for a separate climb [m]: a millimetre, rounding."""


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
    """Return a plan of parallel lanes over a field, with return and landing.

    Args:
        home: Position of the take-off.
        width_m: Length of the lanes, east to west.
        depth_m: Extent of the field, north to south; 0: one lane.
        spacing_m: Maximum distance between two lanes.
        up_m: Height above home.
        centre_m: Centre of the field, east and north of home.
        speed_m_s: Cruise speed; None: the vehicle's.

    Raises:
        InputError: There are too many lanes, or an argument is out of its range.
    """
    if width_m <= 0 or depth_m < 0 or spacing_m <= 0:
        raise InputError(
            f"{argument('grid')}: expected a positive WIDTH and SPACING and a DEPTH of "
            f"0 or more, got {width_m:g},{depth_m:g},{spacing_m:g}"
        )
    # Rounding must not add a lane to a depth of whole spacings.
    lanes = 1 + math.ceil(depth_m / spacing_m - 1e-9)
    if lanes > MAX_LANES:
        raise InputError(
            f"grid: expected at most {MAX_LANES} lanes, got {lanes}: {depth_m:g} m "
            f"every {spacing_m:g} m"
        )
    norths = np.linspace(-0.5, 0.5, lanes) * depth_m if lanes > 1 else np.zeros(1)
    places = []
    for n, north in enumerate(norths):
        # Every second lane is flown backwards, so that the way between lanes is short.
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
    """Return a plan of clockwise circles around a position, with return and landing.

    Args:
        home: Position of the take-off.
        radius_m: Radius of the circle; negative: counter-clockwise.
        turns: Number of circles.
        up_m: Height above home.
        centre_m: Centre of the circle, east and north of home.
        speed_m_s: Cruise speed; None: the vehicle's.

    Raises:
        InputError: An argument is out of its range.
    """
    if radius_m == 0 or turns <= 0:
        raise InputError(
            f"{argument('orbit')}: expected a RADIUS other than 0 and positive TURNS, "
            f"got {radius_m:g},{turns:g}"
        )
    return _plan(home, [centre_m], up_m, speed_m_s, turns=turns, radius_m=radius_m)


def _plan(
    home: Place,
    places: list[tuple[float, float]],
    up_m: float,
    speed_m_s: float | None,
    turns: float | None = None,
    radius_m: float | None = None,
) -> Plan:
    """Return a plan of take-off, positions, and return."""
    # of swapped coordinates only those with a longitude beyond 90 degrees are found
    if abs(home.lat_deg) > 90 or abs(home.lon_deg) > 180:
        raise InputError(
            f"{argument('home')}: expected a latitude of -90 to 90 and a longitude of "
            f"-180 to 180 degrees, got {home.lat_deg:g},{home.lon_deg:g}"
        )
    points = np.array([(*place, 0.0) for place in places])
    on_earth = geodetic(Frame(*home), points)
    rows: list[tuple[int, int, Parameters]] = [
        (TAKEOFF, RELATIVE, (0.0, 0.0, 0.0, None, home.lat_deg, home.lon_deg, up_m))
    ]
    for lat, lon, _ in on_earth.tolist():
        # 1e-9 degree is 0.1 mm; MAVLink's resolution is 1e-7 degree, 1 cm.
        where = (round(lat, 9), round(lon, 9), up_m)
        if turns is None:
            rows.append((WAYPOINT, RELATIVE, (0.0, 0.0, 0.0, None, *where)))
        else:
            rows.append((TURNS, RELATIVE, (turns, 0.0, radius_m, 0.0, *where)))
    rows.append((RETURN, MISSION, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)))
    items = tuple(Item(n, *row) for n, row in enumerate(rows, start=1))
    return Plan(items, home, hover_speed_m_s=speed_m_s)


class Limits(NamedTuple):
    """Default limits of a mission.

    Values are the defaults of the PX4 parameters in brackets (from memory).

    Attributes:
        speed_m_s: Ground speed [MPC_XY_CRUISE].
        climb_m_s: Climb speed [MPC_Z_V_AUTO_UP].
        descent_m_s: Descent speed [MPC_Z_V_AUTO_DN].
        landing_m_s: Final descent speed [MPC_LAND_SPEED].
        acceleration_m_s2: Acceleration of the set point [MPC_ACC_HOR is 3].
        acceptance_m: Default acceptance radius of a waypoint; declared: PX4's 10 m
            also serve aeroplanes.
        return_m: Minimum height above home of a return [RTL_RETURN_ALT].
        slow_below_m: Height of the final descent [MPC_LAND_ALT2].
    """

    speed_m_s: float = 5.0
    climb_m_s: float = 3.0
    descent_m_s: float = 1.5
    landing_m_s: float = 0.7
    acceleration_m_s2: float = 2.0
    acceptance_m: float = 1.0
    return_m: float = 30.0
    slow_below_m: float = 5.0


@dataclass(frozen=True)
class Stop:
    """A target position of a mission.

    Attributes:
        item: Index of its item in the plan, from 0.
        goal_m: East, north, up.
        speed_m_s: Ground speed on the leg to it.
        climb_m_s: Maximum climb speed.
        descent_m_s: Maximum descent speed.
        acceptance_m: Acceptance radius.
        hold_s: Waiting time; infinite: unlimited.
        yaw_rad: Heading from east to north; NaN: unchanged.
        stops: True if the set point stops, even without a waiting time.
        turns: Number of circles around the goal, at `radius_m`; 0: none.
        radius_m: Radius; positive: clockwise.
        lands: True if it is on the ground.
        visit: Index in the order of execution, from 0.
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


class Mission(NamedTuple):
    """A checked plan with its legs.

    Attributes:
        plan: The plan.
        frame: Geodetic frame of the origin.
        home_m: Initial position of the vehicle: east, north, up.
        stops: Target positions.
        guidance: Guidance along the legs.
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
    start_m: Vector | None = None,
    may_hover_on: bool = False,
) -> Mission:
    """Return the mission of a plan, from the ground at height 0 or in flight.

    Args:
        plan: The plan.
        place: Geodetic position of the origin; None: the plan's home.
        position_m: Initial position of the vehicle; None: the plan's home.
        yaw_rad: Initial heading.
        limits: Default limits; None: PX4's.
        start_m: Start of a vehicle in flight: east, north, up; None: on the ground.
        may_hover_on: Accept a plan that ends in the air.

    Raises:
        InputError: The plan is invalid, or as in `stops_of`.
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
        if abs(home[2]) > HOME_TOLERANCE_M:
            raise InputError(
                f"{plan.where}: home: expected the height of the ground, alt_m "
                f"{frame.alt_m:g} of the scene's [place], got "
                f"{plan.home.alt_m:g} m: a mission that starts "
                f"{'in the air' if home[2] > 0 else 'below ground'}"
            )
        # Within the tolerance the vehicle starts on the ground.
        home[2] = 0.0
    else:
        home = np.array(position_m, float)
        if home[2] > 0:
            raise InputError(
                f"{plan.where}: expected a vehicle on the ground, up 0 m, got one at "
                f"{home[2]:g} m: a mission that starts in the air"
            )
    stops = stops_of(
        plan,
        frame,
        home,
        limits,
        start_m=start_m,
        yaw_rad=yaw_rad,
        may_hover_on=may_hover_on,
    )
    legs = legs_along(stops, home if start_m is None else start_m, limits)
    guidance = Guidance(legs, limits.acceleration_m_s2, yaw_rad)
    return Mission(plan, frame, home, stops, guidance)


def planned_seconds(legs: Legs, acceleration_m_s2: float) -> float:
    """Return the duration of legs without disturbances [s]; infinite without an end.

    Args:
        legs: Legs of one plan, without padding.
        acceleration_m_s2: Acceleration of the set point.
    """
    total, speed = CALIBRATE_S + IDLE_S, 0.0
    lengths, most, ends, holds = (
        np.asarray(x, float)
        for x in (legs.length_m, legs.speed_m_s, legs.end_speed_m_s, legs.hold_s)
    )
    for length, limit, end, hold, waits, lands in zip(
        lengths, most, ends, holds, legs.waits, legs.lands, strict=True
    ):
        # A trapezoid of speed: acceleration to `top`, cruise, and braking to `end`.
        begin = min(speed, limit)
        # From v^2 = v0^2 + 2 a s on both flanks, which meet at the top speed.
        square = acceleration_m_s2 * length + (begin * begin + end * end) / 2
        top = max(min(limit, math.sqrt(square)), begin, end)
        if top > 0:
            # Distance of acceleration and braking; the remainder is flown at `top`.
            ways = (2 * top * top - begin * begin - end * end) / (2 * acceleration_m_s2)
            total += (2 * top - begin - end) / acceleration_m_s2
            total += max(length - ways, 0.0) / top
        speed = end
        if waits:
            total += LANDED_S if lands else hold
    return total


def stops_of(
    plan: Plan,
    frame: Frame,
    home_m: Float[np.ndarray, "3"],
    limits: Limits,
    *,
    start_m: Vector | None = None,
    yaw_rad: float = 0.0,
    may_hover_on: bool = False,
) -> list[Stop]:
    """Return the target positions of a plan in order of execution.

    Args:
        plan: The plan.
        frame: Geodetic frame of the origin.
        home_m: Initial position of the vehicle, on the ground.
        limits: Default limits.
        start_m: Start of a vehicle in flight; None: at home.
        yaw_rad: Initial heading.
        may_hover_on: Accept a plan that ends in the air.

    Raises:
        InputError: The plan is empty, starts or ends in the air, continues after a
            landing, has an invalid jump, or has an unreachable position.
    """
    where = plan.where
    if not plan.items:
        raise InputError(f"{where}: items: expected a mission, got an empty list")
    order = [n for n in _order(plan) if not plan.items[n].ignored]
    first = next(
        (n for n in order if plan.items[n].command not in (SPEED, HEADING)), None
    )
    grounded = start_m is None
    if first is None or (grounded and plan.items[first].command != TAKEOFF):
        got = "nothing to fly" if first is None else plan.items[first].words
        raise InputError(
            f"{where}: expected a take-off (22) first, from the ground, got {got}: a "
            "mission that starts in the air"
        )
    speeds = {
        "speed_m_s": plan.hover_speed_m_s or limits.speed_m_s,
        "climb_m_s": limits.climb_m_s,
        "descent_m_s": limits.descent_m_s,
    }
    stops: list[Stop] = []
    at, ended, visit = np.array(home_m if grounded else start_m, float), False, 0
    turned: dict[str, float] = {}
    for n in order:
        item = plan.items[n]
        if ended:
            raise InputError(
                f"{where}: {item.words}: expected no item after the end of the mission "
                "(landing, return or loiter without end), got this one"
            )
        # A change of speed holds for the following items and has no position.
        if item.command == SPEED:
            _change(speeds, item, where)
            continue
        # A turn holds for all following items, as in ArduCopter, which alone has this
        # command and does not use the heading of a waypoint.
        if item.command == HEADING:
            yaw_rad = _heading(item, yaw_rad, where)
            turned = {"yaw_rad": yaw_rad}
            continue
        found = stops_for(item, n, at, home_m, frame, speeds, limits, where)
        for stop in found:
            check_reach(stop, home_m, f"{where}: {item.words}")
        stops += [replace(stop, visit=visit, **turned) for stop in found]
        visit += 1
        last = stops[-1]
        at = _exit(last, _entry(last, at)) if last.turns else last.goal_m
        yaw_rad = yaw_rad if math.isnan(last.yaw_rad) else last.yaw_rad
        ended = item.command in (LAND, RETURN, LOITER)
    if not ended:
        stops.append(
            replace(stops[-1], goal_m=at, hold_s=math.inf, stops=False, turns=0.0)
        )
    if not may_hover_on and not stops[-1].lands:
        raise InputError(
            f"{where}: expected a landing (21) or a return (20) at the end, or a "
            "duration of the flight, got a mission that hovers without end"
        )
    return stops


def _order(plan: Plan) -> list[int]:
    """Return indices of the plan's items in order of execution, with jumps unrolled."""
    # Items inserted into a course have no number for jumps.
    by_number = {
        item.number: n for n, item in enumerate(plan.items) if item.number >= 0
    }
    left: dict[int, int] = {}
    order: list[int] = []
    n = steps = 0
    while n < len(plan.items):
        item = plan.items[n]
        steps += 1
        # Jumps count as steps: a cycle of jumps alone would never extend the order.
        if len(order) >= MAX_LEGS or steps > 2 * MAX_LEGS:
            raise InputError(
                f"{plan.where}: expected at most {MAX_LEGS:,} items with unrolled "
                "jumps, got more"
            )
        if not item.auto_continue and n + 1 < len(plan.items):
            raise InputError(
                f"{plan.where}: {item.words}, autoContinue: expected true for an "
                "unattended mission, got false"
            )
        if item.command != JUMP:
            order.append(n)
            n += 1
            continue
        goal, times = item.number_of(1, math.nan), item.number_of(2, math.nan)
        at = f"{plan.where}: {item.words}"
        if goal not in by_number:
            known = f"{min(by_number)} to {max(by_number)}"
            raise InputError(
                f"{at}: expected the number of an item, {known}, got {goal:g}"
            )
        if not (times >= 0 and float(times).is_integer()):  # false for nan and inf
            raise InputError(
                f"{at}: expected a number of repetitions, 0 or more, got {times:g} "
                "(-1, without end, is not possible unattended)"
            )
        if left.setdefault(n, int(times)) > 0:
            left[n] -= 1
            n = by_number[int(goal)]
        else:
            del left[n]  # an outer jump restarts the count of this one
            n += 1
    return order


def _change(speeds: dict[str, float], item: Item, where: str) -> None:
    """Apply an item that changes the speed."""
    kind, speed = item.number_of(1), item.number_of(2, -1.0)
    names = {0.0: "speed_m_s", 1.0: "speed_m_s", 2.0: "climb_m_s", 3.0: "descent_m_s"}
    if kind not in names:
        raise InputError(
            f"{where}: {item.words}, parameter 1: expected 0 to 3, got {kind:g}"
        )
    if speed == -1:  # no change
        return
    if not 0.05 <= speed <= 60.0:
        raise InputError(
            f"{where}: {item.words}, parameter 2: expected 0.05 to 60 m/s, or -1, got "
            f"{speed:g}"
        )
    speeds[names[kind]] = speed


def _heading(item: Item, yaw_rad: float, where: str) -> float:
    """Return the heading after a turn, from east to north."""
    degrees, sense, relative = (item.number_of(n) for n in (1, 3, 4))
    for parameter, value, known in ((3, sense, (-1, 0, 1)), (4, relative, (0, 1))):
        if value not in known:
            raise InputError(
                f"{where}: {item.words}, parameter {parameter}: expected one of "
                f"{', '.join(map(str, known))}, got {value:g}"
            )
    # Headings of a plan are clockwise.
    start, sign = (yaw_rad, sense or 1.0) if relative else (math.pi / 2, 1.0)
    return math.remainder(start - sign * math.radians(degrees), 2 * math.pi)


def legs_along(stops: Sequence[Stop], start_m: Vector, limits: Limits) -> Legs:
    """Return the legs between stops.

    Args:
        stops: Target positions as returned by `stops_of`.
        start_m: Initial position of the vehicle.
        limits: Limits with the set point's acceleration.
    """
    rows: list[dict] = []
    ways = _straight(stops, start_m)
    acceleration = limits.acceleration_m_s2
    cut = 0.0  # length of the next line that the previous arc replaces
    for n, (stop, start, end, way) in enumerate(ways):
        length = float(np.linalg.norm(end - start))
        after = ways[n + 1] if n + 1 < len(ways) else None
        arc = None if after is None else _arc(stop, length, way, after, acceleration)
        # An arc replaces the end of this line and the beginning of the next.
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
            end = end - np.array([0.0, 0.0, LANDING_DEPTH_M])
        if stop.turns:
            end = _entry(stop, at)
        line = end - at
        length = np.linalg.norm(line)
        if length > MIN_LENGTH_M:
            way = line / length
        else:
            end = at
        found.append((stop, at, end, way))
        at = _exit(stop, end) if stop.turns else end
    return found


def _arc(
    stop: Stop, length: float, way: Vector, after: tuple, acceleration: float
) -> dict | None:
    """Return the arc at a stop that is passed; None if the set point stops."""
    if stop.stops or stop.hold_s or stop.lands or stop.turns:
        return None
    following, start, end, onward = after
    ahead = float(np.linalg.norm(end - start))
    if min(length, ahead) <= MIN_LENGTH_M:
        return None
    # The product of two unit vectors can exceed 1 by rounding.
    angle = math.acos(float(np.clip(way @ onward, -1.0, 1.0)))
    # A reversal has no arc of finite speed.
    if angle > math.pi - STRAIGHT_RAD:
        return None
    row = {"speed_m_s": min(_speed(stop, way), _speed(following, onward))}
    row |= {"waits": False, "end_speed_m_s": math.inf, "along": way}
    if angle < STRAIGHT_RAD:
        return {"take": 0.0, "row": row | {"length_m": 0.0}}
    tangent = math.tan(angle / 2)
    # The largest arc is the fastest. Its distance from the corner is at most half of
    # the acceptance radius.
    radius = min(
        0.5 * stop.acceptance_m / (1 / math.cos(angle / 2) - 1),
        # Half of a line at most, so that the arcs at both of its ends do not overlap.
        0.5 * min(length, ahead) / tangent,
    )
    # The part of the next direction across this one points to the centre.
    inward = onward - (onward @ way) * way
    row |= {
        "inward": inward / np.linalg.norm(inward),
        "curvature_per_m": 1 / radius,
        "length_m": radius * angle,
        "speed_m_s": min(row["speed_m_s"], math.sqrt(acceleration * radius)),
    }
    return {"take": radius * tangent, "row": row}


def _entry(stop: Stop, at: Vector) -> Vector:
    """Return the nearest point of a circle; from its centre, the northernmost."""
    out = at - stop.goal_m
    out[2] = 0.0
    length = np.linalg.norm(out)
    out = out / length if length > MIN_LENGTH_M else np.array([0.0, 1.0, 0.0])
    return stop.goal_m + abs(stop.radius_m) * out


def _circle(stop: Stop, start: Vector, acceleration: float) -> dict:
    """Return the leg around a stop."""
    radius = abs(stop.radius_m)
    inward = (stop.goal_m - start) / radius
    sense = math.copysign(1.0, stop.radius_m)
    # Clockwise from above: the centre is to the right.
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
    """Return the end point of the circles."""
    east, north, _ = start - stop.goal_m
    angle = -math.copysign(2 * math.pi * stop.turns, stop.radius_m)
    sine, cosine = math.sin(angle), math.cos(angle)
    turned = [cosine * east - sine * north, sine * east + cosine * north, 0.0]
    return stop.goal_m + np.array(turned)


def _speed(stop: Stop, way: Vector) -> float:
    """Return the maximum speed along a line from the limits of its components."""
    across, up = float(np.hypot(way[0], way[1])), float(way[2])
    limit = math.inf if across < 1e-9 else stop.speed_m_s / across
    if up > 1e-9:
        limit = min(limit, stop.climb_m_s / up)
    if up < -1e-9:
        limit = min(limit, stop.descent_m_s / -up)
    return limit


def _brake(rows: list[dict], acceleration: float) -> None:
    """Set the end speeds of legs without a stop."""
    allowed = 0.0  # maximum speed at the start of the following leg
    # Backwards, because the speed at an end depends on all following legs.
    for row in reversed(rows):
        if row["waits"]:
            row["end_speed_m_s"] = 0.0
        else:
            row["end_speed_m_s"] = min(row["end_speed_m_s"], allowed, row["speed_m_s"])
        end = row["end_speed_m_s"]
        reach = math.sqrt(end * end + 2 * acceleration * row["length_m"])
        allowed = min(row["speed_m_s"], reach)


def _table(rows: Sequence[dict]) -> Legs:
    """Return the legs of rows."""
    none = {"inward": np.zeros(3), "curvature_per_m": 0.0, "lands": False}
    whole = [none | row for row in rows]
    columns: dict[str, Any] = {
        name: np.array([row[name] for row in whole]) for name in FIELDS
    }
    return Legs(**columns)


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
    """Return the stops of one item, from the position before it."""
    radius = limits.acceptance_m

    def stop(goal: Sequence[float] | np.ndarray, **options: Any) -> Stop:
        known: dict[str, Any] = {"acceptance_m": radius, **speeds}
        return Stop(n, np.array(goal, float), **(known | options))

    goal = _goal(item, at, home, frame)
    yaw = _yaw(item)
    if item.command == TAKEOFF:
        up = np.array([at[0], at[1], goal[2]])
        found = [stop(up, stops=True, yaw_rad=yaw)]
        # A take-off climbs vertically first; then the vehicle flies to its position.
        if np.hypot(*(goal - up)[:2]) > limits.acceptance_m:
            found.append(stop(goal, yaw_rad=yaw))
        return found
    if item.command == WAYPOINT:
        # 0 stands for the default, as if the parameter were absent.
        radius = item.number_of(2) or radius
        _at_least(item, 1, 0.0, where)
        _at_least(item, 2, 0.0, where)
        return [stop(goal, hold_s=item.number_of(1), yaw_rad=yaw)]
    if item.command == DELAY:
        seconds = item.number_of(1)
        if seconds <= 0:
            raise InputError(
                f"{where}: {item.words}, parameter 1: expected a positive number of "
                f"seconds (a time of day is not supported), got {seconds:g}"
            )
        return [stop(at, hold_s=seconds, stops=True)]
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
            []
            if high - at[2] < MIN_CLIMB_M
            else [stop((at[0], at[1], high), stops=True)]
        )
        over = np.array([home[0], home[1], high])
    else:
        found, high = [], float(at[2])
        over = np.array([goal[0], goal[1], high])
    if np.hypot(*(over - (found[-1].goal_m if found else at))[:2]) > MIN_CLIMB_M:
        found.append(stop(over, stops=True, yaw_rad=yaw))
    slow = float(home[2]) + limits.slow_below_m
    if high > slow + MIN_CLIMB_M:
        found.append(stop((over[0], over[1], slow), yaw_rad=yaw))
    ground = np.array([over[0], over[1], home[2]])
    # Set speeds apply to the last metres, too, if they are lower.
    slowly = min(limits.landing_m_s, speeds["descent_m_s"])
    return [*found, stop(ground, descent_m_s=slowly, lands=True, yaw_rad=yaw)]


def _goal(
    item: Item,
    at: Float[np.ndarray, "3"],
    home: Float[np.ndarray, "3"],
    frame: Frame,
) -> Float[np.ndarray, "3"]:
    """Return the target of an item; missing values are those of the position `at`."""
    lat, lon, alt = item.params[4:]
    up = at[2]
    # ArduPilot has a height of 0 for the present height, too, where 0, 0 is the
    # present position.
    if alt is not None and (alt or item.place or item.command == TAKEOFF):
        up = alt - frame.alt_m if item.frame == GLOBAL else home[2] + alt
    if item.place is None:
        return np.array([at[0], at[1], up])
    assert lat is not None  # else it has no place
    assert lon is not None
    east, north, _ = level(frame, lat, lon, frame.alt_m)
    return np.array([east, north, up])


def _yaw(item: Item) -> float:
    """Return a heading from east to north; NaN for an item without one."""
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
    """Reject an unreachable position, with the reason."""
    away = float(np.hypot(*(stop.goal_m - home)[:2]))
    up = float(stop.goal_m[2] - home[2])
    if away + abs(stop.radius_m) > MAX_DISTANCE_M:
        raise InputError(
            f"{at}: expected a position within {MAX_DISTANCE_M / 1e3:g} km of home "
            f"(level ground), got one {away / 1e3:.4g} km away: unreachable"
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


def frame_of(plan: Plan, place: Place | None = None) -> Frame:
    """Return the frame of a plan, with its origin at the scene's place or at home.

    Args:
        plan: The plan.
        place: Position of the scene's origin on the Earth, if specified.

    Raises:
        InputError: Neither specifies a position.
    """
    where = plan.home if place is None else place
    if where is None:
        raise InputError(
            f"{plan.where}: home: expected a first line with home, or the scene's "
            "[place], got neither"
        )
    return Frame(*where)


def level(
    frame: Frame,
    lat_deg: Float[ArrayLike, "*place"],
    lon_deg: Float[ArrayLike, "*place"],
    alt_m: Float[ArrayLike, "*place"],
) -> Float[np.ndarray, "*place 3"]:
    """Return east, north, and height above the origin's [m]."""
    enu = frame.to_enu(lat_deg, lon_deg, frame.alt_m)
    up = np.broadcast_to(np.asarray(alt_m, float) - frame.alt_m, enu.shape[:-1])
    return np.concatenate([enu[..., :2], up[..., None]], axis=-1)


def geodetic(
    frame: Frame, place_m: Float[ArrayLike, "*place 3"]
) -> Float[np.ndarray, "*place 3"]:
    """Return latitude, longitude [degree] and height [m] of positions."""
    place = np.array(place_m, float)
    found = place.copy()
    found[..., 2] = 0.0
    # Project from the tangent plane to the ellipsoid: 2 iterations give 1 mm at 20 km.
    for _ in range(2):
        found[..., 2] -= frame.to_geodetic(found)[..., 2] - frame.alt_m
    answer = frame.to_geodetic(found)
    answer[..., 2] = place[..., 2] + frame.alt_m
    return answer
