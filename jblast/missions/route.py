r"""A plan prepared for flight: its stops, and the legs between them.

A corner with the turning angle $\theta$ and without a stop is flown at a constant
acceleration, on a parabola that begins $d$ before the corner, ends $d$ after it and is
tangent to both lines. Its minimum distance from the corner is $d \sin(\theta/2)/2$, at
most half the acceptance radius, and $d$ is at most half of a line between two corners.
The speed on it is at most $\sqrt{a d/\sin(\theta/2)}$. So neither a straight passage
nor a reversal is a special case, and a circle is a polygon whose corners meet in the
middle of its edges. The speed at the end of a leg is limited by braking on the next
one, $v^2 \le v_{next}^2 + 2 a l$.

Horizontal positions are those of `observations.places.Frame`. Heights are above the
origin and are not changed by the conversion: the scene's ground is level, and the fall
of the Earth's surface below the plane (8 cm in a kilometre) is neglected both ways.
"""

import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import ArrayLike, Float

from jblast.errors import argument, require
from jblast.missions.guidance import (
    CALIBRATE_S,
    IDLE_S,
    LANDED_S,
    Guidance,
    Legs,
)
from jblast.missions.plan import (
    GLOBAL,
    IGNORED,
    MISSION,
    RELATIVE,
    Item,
    Nav,
    Parameters,
    Plan,
    check_item,
    check_place,
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
EDGE_RAD = math.radians(10.0)
"""Largest angle of a corner of a circle: its radius is exact to 7e-6 of itself."""
CIRCLE_M = 10.0
"""Default radius of an item for turns; declared."""
CHANGED = ("speed_m_s", "speed_m_s", "climb_m_s", "descent_m_s")
"""Speed changed by each value of a speed's first parameter."""
FACING = (Nav.WAYPOINT, Nav.LOITER, Nav.LAND, Nav.TAKEOFF)
"""Commands with a heading, parameter 4."""
Vector = Float[np.ndarray, "3"]


def grid_plan(
    home: Place,
    *,
    width_m: float,
    depth_m: float,
    spacing_m: float,
    **pattern: Any,
) -> Plan:
    """Return a plan of parallel lanes over a field, with return and landing.

    Args:
        home: Position of the take-off.
        width_m: Length of the lanes, east to west.
        depth_m: Extent of the field, north to south; 0: one lane.
        spacing_m: Maximum distance between two lanes.
        pattern: Height, centre and speed as in `pattern_plan`.

    Raises:
        InputError: There are too many lanes, or an argument is out of its range.
    """
    require(
        width_m > 0 and depth_m >= 0 and spacing_m > 0,
        argument("grid"),
        "a positive WIDTH and SPACING and a DEPTH of 0 or more",
        f"{width_m:g},{depth_m:g},{spacing_m:g}",
    )
    # Rounding must not add a lane to a depth of whole spacings.
    lanes = 1 + math.ceil(depth_m / spacing_m - 1e-9)
    got = f"{lanes}: {depth_m:g} m every {spacing_m:g} m"
    require(lanes <= MAX_LANES, "grid", f"at most {MAX_LANES} lanes", got)
    places: list[tuple[float, float]] = []
    for n, north in enumerate(np.linspace(-0.5, 0.5, lanes) * depth_m):
        # Every second lane is flown backwards, so that the way between lanes is short.
        east = (0.5 if n % 2 else -0.5) * width_m
        places += [(east, north), (-east, north)]
    first = (0.0, 0.0, 0.0, None)
    return pattern_plan(home, places, Nav.WAYPOINT, first, **pattern)


def orbit_plan(
    home: Place,
    *,
    radius_m: float,
    turns: float,
    **pattern: Any,
) -> Plan:
    """Return a plan of clockwise circles around a position, with return and landing.

    Args:
        home: Position of the take-off.
        radius_m: Radius of the circle; negative: counter-clockwise.
        turns: Number of circles.
        pattern: Height, centre and speed as in `pattern_plan`.

    Raises:
        InputError: An argument is out of its range.
    """
    require(
        radius_m != 0 and turns > 0,
        argument("orbit"),
        "a RADIUS other than 0 and positive TURNS",
        f"{radius_m:g},{turns:g}",
    )
    first = (turns, 0.0, radius_m, 0.0)
    return pattern_plan(home, [(0.0, 0.0)], Nav.TURNS, first, **pattern)


def pattern_plan(
    home: Place,
    places_m: Sequence[tuple[float, float]],
    command: int,
    first: tuple[float, float, float, float | None],
    *,
    up_m: float,
    centre_m: tuple[float, float] = (0.0, 0.0),
    speed_m_s: float | None = None,
) -> Plan:
    """Return a plan of take-off, positions, and return.

    Args:
        home: Position of the take-off.
        places_m: Positions, east and north of the centre.
        command: Command of each position.
        first: Its first four parameters.
        up_m: Height above home.
        centre_m: Centre of the pattern, east and north of home.
        speed_m_s: Cruise speed; None: the vehicle's.

    Raises:
        InputError: The home is out of range.
    """
    check_place(home, argument("home"))
    points = np.pad(np.array(places_m) + centre_m, ((0, 0), (0, 1)))
    # 1e-9 degree is 0.1 mm; MAVLink's resolution is 1e-7 degree, 1 cm.
    places = np.round(geodetic(Frame(*home), points), 9).tolist()
    begin = (0.0, 0.0, 0.0, None, home.lat_deg, home.lon_deg, up_m)
    rows: list[tuple[int, int, Parameters]] = [
        (Nav.TAKEOFF, RELATIVE, begin),
        *((command, RELATIVE, (*first, lat, lon, up_m)) for lat, lon, _ in places),
        (Nav.RETURN, MISSION, (0.0,) * 7),
    ]
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


class Stop(NamedTuple):
    """A target position of a mission.

    Attributes:
        item: Index of its item in the plan, from 0.
        goal_m: East, north, up.
        limits: Limits on the leg to it, and its acceptance radius.
        hold_s: Waiting time; infinite: unlimited; None: the set point does not stop.
        yaw_rad: Heading from east to north.
        lands: True if it is on the ground.
        visit: Index in the order of execution, from 0.
    """

    item: int
    goal_m: Vector
    limits: Limits
    hold_s: float | None = None
    yaw_rad: float = 0.0
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
    home_m: Vector
    stops: list[Stop]
    guidance: Guidance


def mission_of(
    plan: Plan,
    *,
    place: Place | None = None,
    position_m: Vector | None = None,
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
    origin, at = place or plan.home, f"{plan.where}: home"
    words = "a first line with home, or the scene's "
    require(origin is not None, at, words + "[place]", "neither")
    assert origin is not None
    frame, home, tolerance = Frame(*origin), position_m, 0.0
    if home is None:
        place, tolerance = plan.home, HOME_TOLERANCE_M
        require(place is not None, at, words + "[vehicle] position_m", "neither")
        home = level(frame, *(place or origin))
    # Within the tolerance of a map's height the vehicle starts on the ground.
    require(
        abs(home[2]) <= tolerance,
        at,
        f"a vehicle on the ground, alt_m {frame.alt_m:g}",
        f"one {home[2]:g} m above it: a mission that starts in the air",
    )
    home = np.array([*home[:2], 0.0], float)
    begin = home if start_m is None else np.array(start_m, float)
    base = Stop(0, begin, limits, yaw_rad=yaw_rad, visit=-1)
    stops = stops_of(plan, frame, home, base, in_flight=start_m is not None)
    require(
        may_hover_on or stops[-1].lands,
        plan.where,
        "a landing (21) or a return (20) at the end, or a duration of the flight",
        "a mission that hovers without end",
    )
    guidance = Guidance(legs_along(stops, begin), limits.acceleration_m_s2, yaw_rad)
    return Mission(plan, frame, home, stops, guidance)


def planned_seconds(guidance: Guidance) -> float:
    """Return the duration of a mission without disturbances [s], until its last leg.

    Args:
        guidance: Guidance of one plan, without padding.
    """
    legs, rate = guidance.legs, float(guidance.acceleration_m_s2)
    total, begin = CALIBRATE_S + IDLE_S + LANDED_S, 0.0
    columns = (legs.length_m, legs.speed_m_s, legs.end_speed_m_s, legs.hold_s)
    for length, limit, end, hold in np.stack(columns, axis=1).astype(float):
        # A trapezoid of speed: acceleration to `top`, cruise, and braking to `end`;
        # from v^2 = v0^2 + 2 a s on both flanks, which meet at the top speed.
        end = min(end, math.sqrt(begin * begin + 2 * rate * length))
        squares = begin * begin + end * end
        top = min(limit, math.sqrt(rate * length + squares / 2))
        # Distance of acceleration and braking; the remainder is flown at `top`.
        rest = length - (2 * top * top - squares) / (2 * rate)
        total += (2 * top - begin - end) / rate + (rest / top if rest > 0 else 0.0)
        total += hold if end == 0.0 and math.isfinite(hold) else 0.0
        begin = end
    return total


def stops_of(
    plan: Plan, frame: Frame, home_m: Vector, base: Stop, *, in_flight: bool = False
) -> list[Stop]:
    """Return the target positions of a plan in order of execution.

    Args:
        plan: The plan.
        frame: Geodetic frame of the origin.
        home_m: Home, on the ground at height 0.
        base: The start, with default limits and the initial heading.
        in_flight: Whether the vehicle is in flight at the start.

    Raises:
        InputError: The plan is empty, starts in the air, continues after its end, has
            an invalid item or jump, or has an unreachable position.
    """
    where, default, turned = plan.where, base.limits, False
    for item in plan.items:
        check_item(item, where)
    if plan.hover_speed_m_s:
        limits = default._replace(speed_m_s=plan.hover_speed_m_s)
        base = base._replace(limits=limits)
    stops: list[Stop] = []
    for n in _order(plan):
        # `base` is the last position, with limits and heading of the following items.
        item = plan.items[n]
        at = f"{where}: {item.words}"
        goes_on = not stops or stops[-1].hold_s != math.inf
        words = "no item after the end of the mission (landing, return or loiter "
        require(goes_on, at, words + "without end)", "this one")
        if item.command == Nav.SPEED:
            # -1 is no change.
            kind, speed = int(item.number_of(1)), item.number_of(2, -1.0)
            if speed > 0:
                limits = base.limits._replace(**{CHANGED[kind]: speed})
                base = base._replace(limits=limits)
            continue
        # A turn holds for all following items, as in ArduCopter, which alone has this
        # command and does not use the heading of a waypoint.
        if item.command == Nav.HEADING:
            turned, base = True, base._replace(yaw_rad=_turned(item, base.yaw_rad))
            continue
        starts = stops or in_flight or item.command == Nav.TAKEOFF
        got = f"{item.words}: a mission that starts in the air"
        require(starts, where, "a take-off (22) first, from the ground", got)
        yaw_deg = item.params[3] if item.command in FACING else None
        if yaw_deg is not None and not turned:
            base = base._replace(yaw_rad=_from_north(yaw_deg))
        base = base._replace(item=n, visit=base.visit + 1)
        goal = _goal(item, base.goal_m, frame)
        found = _stops_for(item, base, goal, home_m, default)
        for stop in found:
            check_reach(stop, home_m, at)
        stops += found
        base = base._replace(goal_m=found[-1].goal_m)
    require(stops, where, "a take-off (22) first, from the ground", "nothing to fly")
    if stops[-1].hold_s != math.inf:
        stops.append(stops[-1]._replace(hold_s=math.inf))
    return stops


def _stops_for(
    item: Item, base: Stop, goal: Vector, home: Vector, default: Limits
) -> list[Stop]:
    """Return the stops of one item.

    Args:
        item: The item.
        base: A stop at the position before it, with limits and heading.
        goal: Its position.
        home: Home, on the ground.
        default: Default limits.
    """
    at, hold = base.goal_m, item.number_of(1)
    there = base._replace(goal_m=goal)
    if item.command == Nav.TAKEOFF:
        # A take-off climbs vertically first; then the vehicle flies to its position.
        above = base._replace(goal_m=np.array([*at[:2], goal[2]]), hold_s=0.0)
        far = math.dist(goal, above.goal_m) > default.acceptance_m
        return [above, there] if far else [above]
    if item.command == Nav.WAYPOINT:
        # 0 stands for the default, as if the parameter were absent.
        radius = item.number_of(2) or default.acceptance_m
        limits = base.limits._replace(acceptance_m=radius)
        return [there._replace(hold_s=hold or None, limits=limits)]
    if item.command in (Nav.DELAY, Nav.LOITER_TIME):
        return [there._replace(hold_s=hold)]
    if item.command == Nav.LOITER:
        return [there._replace(hold_s=math.inf)]
    if item.command == Nav.TURNS:
        return _circle(there, at, hold, item.number_of(3) or CIRCLE_M)
    # A return climbs and flies home, a landing flies to its position. Both descend.
    high, over = at[2], goal
    if item.command == Nav.RETURN:
        high, over = max(high, default.return_m), home
    slow = min(default.slow_below_m, high)
    # Set speeds apply to the last metres, too, if they are lower.
    descent = min(default.landing_m_s, base.limits.descent_m_s)
    limits = base.limits._replace(descent_m_s=descent)
    # The final descent begins without a stop.
    ways = ((at, high, 0.0), (over, high, 0.0), (over, slow, None))
    stops = [
        base,
        *(
            base._replace(goal_m=np.array([*p[:2], up]), hold_s=hold)
            for p, up, hold in ways
        ),
    ]
    return [
        *(
            stop
            for before, stop in pairwise(stops)
            if math.dist(stop.goal_m, before.goal_m) > MIN_LENGTH_M
        ),
        base._replace(
            goal_m=np.array([*over[:2], 0.0]),
            limits=limits,
            hold_s=math.inf,
            lands=True,
        ),
    ]


def _circle(center: Stop, at: Vector, turns: float, radius_m: float) -> list[Stop]:
    """Return the stops of a circle: entry, corners of a polygon around it, and exit.

    Args:
        center: A stop at its centre.
        at: Position before it; the entry is the nearest point of the circle.
        turns: Number of turns.
        radius_m: Radius; positive: clockwise.
    """
    east, north, _ = at - center.goal_m
    # From the centre, the northernmost point.
    away = math.hypot(east, north) > MIN_LENGTH_M
    begin = math.atan2(north, east) if away else math.pi / 2
    count = math.ceil(2 * math.pi * turns / EDGE_RAD)
    edge = 2 * math.pi * turns / max(count, 1)
    radius = abs(radius_m)
    steps = np.array([0.0, *(np.arange(count) + 0.5), count])
    sizes = np.array([radius, *[radius / math.cos(edge / 2)] * count, radius])
    angles = begin - math.copysign(edge, radius_m) * steps
    ways = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=-1)
    places = center.goal_m + sizes[:, None] * ways
    corner = center._replace(limits=center.limits._replace(acceptance_m=radius))
    return [
        center._replace(goal_m=places[0], hold_s=0.0),
        *(corner._replace(goal_m=place) for place in places[1:-1]),
        center._replace(goal_m=places[-1], hold_s=0.0),
    ]


def _order(plan: Plan) -> list[int]:
    """Return the order of a plan's items with an effect, with jumps unrolled."""
    # Items inserted into a course have no number for jumps.
    numbers = {item.number: n for n, item in enumerate(plan.items) if item.number >= 0}
    left: dict[int, float] = {}
    order: list[int] = []
    n = 0
    while n < len(plan.items):
        item = plan.items[n]
        at = f"{plan.where}: {item.words}"
        goes_on = item.auto_continue or n + 1 == len(plan.items)
        words = "true for an unattended mission"
        require(goes_on, f"{at}, autoContinue", words, "false")
        # Jumps count, too: a cycle of jumps alone would never end.
        words = f"at most {MAX_LEGS:,} items with unrolled jumps"
        require(len(order) < MAX_LEGS, plan.where, words, "more")
        order.append(n)
        n += 1
        if item.command == Nav.JUMP:
            goal = item.number_of(1, math.nan)
            words = f"the number of an item, {min(numbers)} to {max(numbers)}"
            require(goal in numbers, at, words, f"{goal:g}")
            # After its last repetition an outer jump restarts the count of this one.
            again = left.pop(n, item.number_of(2))
            if again > 0:
                left[n], n = again - 1, numbers[int(goal)]
    skipped = (Nav.JUMP, *IGNORED)
    return [n for n in order if plan.items[n].command not in skipped]


def _turned(item: Item, yaw_rad: float) -> float:
    """Return the heading after a turn, from east to north."""
    degrees, sense, relative = (item.number_of(n) for n in (1, 3, 4))
    # Headings of a plan are clockwise.
    if not relative:
        return _from_north(degrees)
    return math.remainder(yaw_rad - (sense or 1.0) * math.radians(degrees), 2 * math.pi)


def _from_north(degrees: float) -> float:
    """Return a clockwise heading from north [degree] as one from east to north."""
    return math.remainder(math.pi / 2 - math.radians(degrees), 2 * math.pi)


def legs_along(stops: list[Stop], start_m: Vector) -> Legs:
    """Return the legs between stops.

    Args:
        stops: Target positions as returned by `stops_of`.
        start_m: Initial position of the vehicle.
    """
    rate, up = stops[0].limits.acceleration_m_s2, np.array([0.0, 0.0, 1.0])

    def column(value: Callable[[Stop], Any]) -> np.ndarray:
        return np.array([value(stop) for stop in stops])

    def before(values: np.ndarray) -> np.ndarray:
        return np.concatenate([np.zeros_like(values[:1]), values[:-1]])

    limits = Limits(*column(lambda stop: stop.limits).T)
    ends = column(lambda stop: stop.goal_m - stop.lands * LANDING_DEPTH_M * up)
    lines = np.diff(ends, axis=0, prepend=[start_m])
    lengths = np.linalg.norm(lines, axis=1)
    ways = lines / np.maximum(lengths, MIN_LENGTH_M)[:, None]
    # Speed from the limits of its components; the guard of the division is far below.
    level_share, upward = np.maximum([np.hypot(*ways.T[:2]), abs(ways[:, 2])], 1e-9)
    vertical = np.where(ways[:, 2] > 0, limits.climb_m_s, limits.descent_m_s)
    speeds = np.minimum(limits.speed_m_s / level_share, vertical / upward)
    # Half of the change of direction at each end. Its length is sin(angle / 2), guarded
    # for a straight passage.
    turns = np.diff(ways, axis=0, append=ways[-1:]) / 2
    sines = np.maximum(np.linalg.norm(turns, axis=1), 1e-9)
    some = lengths > MIN_LENGTH_M
    passes = (
        column(lambda stop: stop.hold_s is None) & some & np.append(some[1:], False)
    )
    # A line between two corners is shared by them.
    rooms = lengths / (1 + (passes & before(passes)))
    takes = np.minimum(rooms, np.append(rooms[1:], 0.0))
    takes = passes * np.minimum(takes, limits.acceptance_m / sines)
    rest = lengths - before(takes)
    fastest = np.sqrt(rate * takes / sines)
    take, bends = takes[:, None], turns / np.maximum(takes, 1e-9)[:, None]
    # The parts of a line: half of a corner at its start, the rest, and half of one at
    # its end.
    kept = np.stack([before(passes), passes | True, passes], axis=1)

    def legs(*parts: ArrayLike) -> np.ndarray:
        return np.stack(parts, axis=1)[kept]

    length = legs(before(takes), np.maximum(rest - takes, 0.0), takes)
    corners = np.minimum(before(fastest), speeds), np.minimum(fastest, speeds)
    speed = legs(corners[0], speeds, corners[1])
    end, allowed = legs(speeds, speeds * passes, speeds), 0.0
    # Backwards, because the speed at an end depends on all following legs.
    for n in reversed(range(len(end))):
        end[n] = min(end[n], speed[n], allowed)
        allowed = min(speed[n], math.sqrt(end[n] ** 2 + 2 * rate * length[n]))
    known = {
        "goal_m": column(lambda stop: stop.goal_m),
        "acceptance_m": limits.acceptance_m,
        "hold_s": column(lambda stop: stop.hold_s or 0.0),
        "yaw_rad": column(lambda stop: stop.yaw_rad),
        "visit": column(lambda stop: stop.visit),
    }
    return Legs(
        start_m=legs(
            before(ends + take / 2 * turns),
            ends - rest[:, None] * ways,
            ends - take * ways,
        ),
        way=legs(before(ways + turns), ways, ways),
        bend_per_m=legs(before(bends), 0 * bends, bends),
        length_m=length,
        speed_m_s=speed,
        end_speed_m_s=end,
        **{name: legs(values, values, values) for name, values in known.items()},
    )


def _goal(item: Item, at: Vector, frame: Frame) -> Vector:
    """Return the target of an item; missing values are those of the position `at`."""
    (east, north, up), alt = at, item.params[6]
    # ArduPilot has a height of 0 for the present height, too, where 0, 0 is the
    # present position.
    if alt is not None and (alt or item.place or item.command == Nav.TAKEOFF):
        up = alt - frame.alt_m * (item.frame == GLOBAL)
    if item.place is not None:
        east, north, _ = level(frame, *item.place, frame.alt_m)
    return np.array([east, north, up])


def check_reach(stop: Stop, home: Vector, at: str) -> None:
    """Reject an unreachable position, with the reason."""
    away, up = math.dist(stop.goal_m[:2], home[:2]), stop.goal_m[2]
    above = up > 0.0 or stop.lands
    require(
        away <= MAX_DISTANCE_M and above and up <= CEILING_M,
        at,
        f"a position within {MAX_DISTANCE_M / 1e3:g} km of home (level ground), above "
        f"the ground and at most {CEILING_M:g} m above it",
        f"one {away / 1e3:.4g} km away, {up:g} m above the ground: unreachable",
    )


def level(
    frame: Frame,
    lat_deg: Float[ArrayLike, "*place"],
    lon_deg: Float[ArrayLike, "*place"],
    alt_m: Float[ArrayLike, "*place"],
) -> Float[np.ndarray, "*place 3"]:
    """Return east, north, and height above the origin's [m]."""
    enu = np.array(frame.to_enu(lat_deg, lon_deg, frame.alt_m))
    enu[..., 2] = np.asarray(alt_m) - frame.alt_m
    return enu


def geodetic(
    frame: Frame, place_m: Float[ArrayLike, "*place 3"]
) -> Float[np.ndarray, "*place 3"]:
    """Return latitude, longitude [degree] and height [m] of positions."""
    place = np.array(place_m, float)
    up = place[..., 2] + frame.alt_m
    place[..., 2] = 0.0
    # Project from the tangent plane to the ellipsoid: 2 iterations give 1 mm at 20 km.
    for _ in range(2):
        place[..., 2] -= frame.to_geodetic(place)[..., 2] - frame.alt_m
    found = np.array(frame.to_geodetic(place))
    found[..., 2] = up
    return found
