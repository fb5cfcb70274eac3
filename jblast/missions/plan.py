"""The file of a plan: QGroundControl's `.plan` and `QGC WPL 110`.

QGroundControl's `.plan`, version 1, is JSON with the keys that its loader requires:
fileType, version, groundStation, mission of version 2 with plannedHomePosition, items
and firmwareType; an item has exactly seven params.

QGC WPL 110 is the older text form with twelve tab-separated fields per line: number,
current, frame, command, p1, p2, p3, p4, latitude, longitude, height, continue. The
first line is home if it is a waypoint with a height above the sea (frame 0), as written
by QGroundControl and Mission Planner. A list without home begins with its first item.

Numbers of commands (MAV_CMD) and the meaning of their parameters are those of MAVLink's
common.xml, from memory. Their effect on a multicopter is that of PX4, or of ArduCopter
for turns.
"""

import json
import math
import os
import sys
import tomllib
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from jblast.errors import InputError, read_text, require, shown
from jblast.files import write_text
from jblast.parameters import NOT_NEGATIVE, PLACE_LIMITS, POSITIVE, UNBOUNDED, Place

T = TypeVar("T")
EXPECTED = "a plan: QGroundControl's .plan, or QGC WPL 110"
HEAD = "QGC WPL"
VERSION = "110"
FIELDS = (
    *("number", "current", "frame", "command", "p1", "p2", "p3", "p4"),
    *("latitude", "longitude", "height", "continue"),
)
PARTS = {"geoFence": "a fence", "rallyPoints": "rally points"}
"""Ignored parts of a plan, and their descriptions."""
Parameters = tuple[float | None, ...]
"""Seven parameters of an item; None: unspecified."""


class Nav(IntEnum):
    """MAV_CMD of the supported items, without the prefixes NAV, CONDITION and DO."""

    WAYPOINT, LOITER, TURNS, LOITER_TIME, RETURN, LAND, TAKEOFF = range(16, 23)
    DELAY, HEADING, JUMP, SPEED = 93, 115, 177, 178


IGNORED = frozenset(
    (
        *(112, 114, 181, 182, 183, 184, 187, 189, 195, 196, 197, 200, 201, 202, 203),
        *(204, 205, 206, 207, 211, 214, 220, 530, 531, 532, 1000, 1001, 2000, 2001),
        *(2003, 2500, 2501),
    )
)
"""Commands without effect on the path of a multicopter: cameras, gimbals, relays and
servos.

112 and 114 delay only other commands of this list, 189 marks an item, and a region of
interest turns the camera, or the vehicle about its vertical axis.
"""
GLOBAL, MISSION, RELATIVE, TERRAIN = 0, 2, 3, 10
"""MAV_FRAME: height above the sea, no position, height above home, above terrain."""
FRAMES = {
    GLOBAL: "above the sea",
    MISSION: "no place",
    RELATIVE: "above home",
    TERRAIN: "above the terrain, which is level",
}
"""Supported frames of an item's position (MAV_FRAME)."""
INTEGER_FRAMES = {5: GLOBAL, 6: RELATIVE, 11: TERRAIN}
"""Frames with integer coordinates in messages, and the equivalent frames."""


@dataclass(frozen=True)
class Item:
    """One item of a plan.

    Attributes:
        number: Number in the plan, as shown by ground stations and used by jumps.
        command: Key of `COMMANDS`, or one of `IGNORED`.
        frame: Key of `FRAMES`: reference of its height; any for an ignored command.
        params: Seven values: 1 to 4 by the command, latitude and longitude [degree],
            height [m]; None: unspecified.
        auto_continue: True if the next item follows automatically.
    """

    number: int = field(metadata={"key": "index"})
    command: int
    frame: int
    params: Parameters
    auto_continue: bool = True

    @property
    def words(self) -> str:
        """Number and name of the command, for messages and tables."""
        return f"item {self.number}, {command_name(self.command)}"

    @property
    def ignored(self) -> bool:
        """True for a command without effect on the path."""
        return self.command in IGNORED

    @property
    def place(self) -> tuple[float, float] | None:
        """Latitude and longitude [degree]; None: current position, or no position."""
        lat, lon = self.params[4], self.params[5]
        if not COMMANDS[self.command].placed or lat is None or lon is None:
            return None
        # MAVLink has 0, 0 for the present position.
        return None if lat == lon == 0 else (lat, lon)

    def number_of(self, parameter: int, default: float = 0.0) -> float:
        """Return parameter 1 to 7, or the default if it is unspecified."""
        value = self.params[parameter - 1]
        return default if value is None else value


@dataclass(frozen=True)
class Plan:
    """A plan.

    Attributes:
        items: Items in order.
        home: Latitude, longitude, height above the sea; None: unspecified.
        hover_speed_m_s: Cruise speed of a multicopter; None: unspecified.
        firmware: MAV_AUTOPILOT: 12 PX4, 3 ArduPilot.
        source: File of the plan; "" without one.
        rest: Tables of the file; other parts are written back unchanged.
    """

    items: tuple[Item, ...]
    home: Place | None = None
    hover_speed_m_s: float | None = None
    firmware: int = 12
    source: str = ""
    rest: dict[str, Any] = field(default_factory=dict, compare=False)

    @property
    def where(self) -> str:
        """Name of the plan in messages."""
        return self.source or "plan"

    @property
    def ignored(self) -> str:
        """Ignored parts and commands, one line; "" without any."""
        parts = [
            f"{name}: {words}"
            for name, words in PARTS.items()
            if isinstance(part := self.rest.get(name), dict)
            # QGroundControl writes both parts into every plan, mostly with empty lists
            and any(isinstance(value, list) and value for value in part.values())
        ]
        counts = Counter(item.command for item in self.items if item.ignored)
        parts += [
            f"command {command} ({count} of {len(self.items)} items)"
            for command, count in counts.items()
        ]
        return f"ignored in {self.where}: {'; '.join(parts)}" if parts else ""


def plan_text(plan: Plan, path: str | os.PathLike[str]) -> str:
    """Return a plan in QGroundControl's format, for a file with the suffix .plan.

    Ignored parts of the original file are written unchanged.

    Raises:
        InputError: The plan has no home, or the file has another suffix.
    """
    check_form(path)
    words = "latitude, longitude and height, required in a .plan"
    require(plan.home is not None, f"{plan.where}: home", words, "nothing")
    assert plan.home is not None
    # MAV_TYPE 2: a quadrotor.
    mission = {"vehicleType": 2, **plan.rest.get("mission", {})}
    if plan.hover_speed_m_s is not None:
        # QGroundControl writes both; the cruise speed is that of aeroplanes.
        mission.setdefault("cruiseSpeed", plan.hover_speed_m_s)
        mission["hoverSpeed"] = plan.hover_speed_m_s
    mission |= {
        "version": 2,
        "firmwareType": plan.firmware,
        "plannedHomePosition": list(plan.home),
        "items": [
            {
                "autoContinue": item.auto_continue,
                "command": item.command,
                "doJumpId": item.number,
                "frame": item.frame,
                "params": list(item.params),
                "type": "SimpleItem",
            }
            for item in plan.items
        ],
    }
    document = {
        "fileType": "Plan",
        "version": 1,
        "groundStation": "QGroundControl",
        "geoFence": {"circles": [], "polygons": [], "version": 2},
        "rallyPoints": {"points": [], "version": 2},
        **plan.rest,
        "mission": mission,
    }
    return json.dumps(document, indent=4, allow_nan=False) + "\n"


def read_plan(path: str | os.PathLike[str]) -> Plan:
    """Read a plan; its format follows from the content, not from the name.

    Args:
        path: QGroundControl's .plan, version 1, or a list of waypoints, QGC WPL 110.

    Raises:
        InputError: It is neither, it has another version, an item cannot be flown, or
            two items have one number.

    Example:
        `plan = read_plan("campus.plan")`
    """
    text, source = read_text(path, EXPECTED).lstrip(), str(path)
    if text.startswith("{"):
        plan = read_ground_control(text, source)
    elif text.startswith(HEAD):
        plan = read_waypoint_list(text, source)
    else:
        got = shown(text[:40].partition("\n")[0]) if text else "an empty file"
        raise InputError(f"{path}: line 1: expected {EXPECTED}; got {got}")
    for number, count in Counter(item.number for item in plan.items).items():
        at = f"{source}: item {number}"
        require(count == 1, at, "a new number", "that of another item")
    return plan


def check_mission(scene: str | os.PathLike[str]) -> dict[str, Any]:
    """Read the plan of a scene's vehicle, if it has one, without JAX.

    Args:
        scene: Scene file; its own errors are those of `scene.read_scene`.

    Returns:
        The unchecked tables of the scene; none if it is broken.

    Raises:
        InputError: As in `read_plan`.
    """
    try:
        document = tomllib.loads(read_text(scene, "a scene in TOML"))
    except (ValueError, RecursionError):
        return {}
    vehicle = document.get("vehicle")
    name = vehicle.get("mission") if isinstance(vehicle, dict) else None
    if isinstance(name, str):
        read_plan(Path(scene).parent / name)
    return document


def check_form(path: str | os.PathLike[str]) -> None:
    """Check that a file's name has the suffix .plan.

    Raises:
        InputError: The suffix is another one.
    """
    ending = Path(path).suffix.lower()
    got = ending or "no suffix"
    require(ending == ".plan", path, "a name with the suffix .plan", got)


def write_plan(plan: Plan, path: str | os.PathLike[str]) -> None:
    """Write a plan in QGroundControl's format.

    Raises:
        InputError: As in `plan_text`.
    """
    write_text(path, plan_text(plan, path))


def read_waypoint_list(text: str, source: str) -> Plan:
    """Read a list of waypoints, with the name of its file for messages.

    Raises:
        InputError: As in `read_plan`.
    """
    lines = text.splitlines()
    version = lines[0].removeprefix(HEAD).strip()
    where = f"{source}: line 1"
    require(version == VERSION, where, f"{HEAD} {VERSION}", shown(lines[0]))
    items, home = [], None
    for n, line in enumerate(lines[1:], start=2):
        at, fields = f"{source}: line {n}", line.split()
        if not fields:
            continue
        words = f"{len(FIELDS)} fields between tabs ({', '.join(FIELDS)})"
        require(len(fields) == len(FIELDS), at, words, len(fields))
        number, _, frame, command, *params, goes_on = (
            _read(text, f"{at}: {name}")
            for text, name in zip(fields, FIELDS, strict=True)
        )
        item = checked_item(at, number, command, frame, params, goes_on != 0)
        # Home is the first line only, and only above the sea: a later one is a
        # waypoint.
        if not items and home is None and (command, frame) == (Nav.WAYPOINT, GLOBAL):
            home = Place(*map(item.number_of, (5, 6, 7)))
        else:
            items.append(item)
    return Plan(items=tuple(items), home=home, source=source)


def _read(text: str, at: str) -> int | float:
    """Return the number of a field; a whole one as an integer."""
    try:
        value = float(text)
    except ValueError:
        raise InputError(f"{at}: expected a number, got {shown(text)}") from None
    return int(value) if value.is_integer() else value


def read_ground_control(text: str, source: str) -> Plan:
    """Read a .plan, with the name of its file for messages.

    Raises:
        InputError: As in `read_plan`.
    """
    try:
        document = json.loads(text)
    # RecursionError: deeply nested lists, as [[[[[[.
    except (ValueError, RecursionError) as error:
        raise InputError(f"{source}: broken JSON: {error}") from None
    document = _typed(dict, document, source, "a plan, {...}")
    kind = document.get("fileType")
    require(kind == "Plan", f"{source}: fileType", '"Plan"', shown(kind))
    mission = _typed(dict, document.get("mission"), f"{source}: mission", "a table")
    for table, known, of in ((document, 1, ""), (mission, 2, "mission ")):
        version = shown(table.get("version"))
        require(version == f"{known}", f"{source}: {of}version", f"{known}", version)
    entries = _typed(list, mission.get("items"), f"{source}: items", "a list")
    simple = [
        one
        for n, entry in enumerate(entries, start=1)
        for one in _simple_items(entry, f"{source}: item {n}")
    ]
    speed = _number(mission.get("hoverSpeed"), f"{source}: hoverSpeed")
    if speed is not None:
        POSITIVE.checked(speed, f"{source}: hoverSpeed", "a number [m/s]")
    firmware = mission.get("firmwareType", 12)
    at, words = f"{source}: plannedHomePosition", "[latitude, longitude, height]"
    place = _typed(list, mission.get("plannedHomePosition"), at, words)
    require(len(place) == 3 and None not in place, at, words, shown(place))
    home = Place(*(_number(value, at) or 0.0 for value in place))
    check_place(home, at)
    return Plan(
        items=tuple(_item(one, n, source) for n, one in enumerate(simple, start=1)),
        home=home,
        hover_speed_m_s=speed,
        firmware=firmware if type(firmware) is int else 12,
        source=source,
        rest=document,
    )


def _simple_items(entry: Any, at: str) -> list[Any]:
    """Return an entry of a plan, or the simple items of a complex one."""
    if not isinstance(entry, dict) or entry.get("type") != "ComplexItem":
        return [entry]
    # A survey or corridor has its waypoints in "TransectStyleComplexItem", "Items".
    tables = [entry, *(value for value in entry.values() if isinstance(value, dict))]
    items = next((items for table in tables if (items := table.get("Items"))), None)
    name = shown(entry.get("complexItemType"))
    return _typed(
        list,
        items,
        at,
        "a SimpleItem, or a ComplexItem with its waypoints in Items (a plan that "
        "QGroundControl downloads from a vehicle has waypoints in its place)",
        f"the ComplexItem {name} without",
    )


def _item(entry: Any, place: int, source: str) -> Item:
    """Return one item, the nth in the file."""
    at = f"{source}: item {place}"
    entry = _typed(dict, entry, at, "a table")
    kind, params = entry.get("type"), entry.get("params")
    require(kind == "SimpleItem", f"{at} type", "SimpleItem", shown(kind))
    params = _typed(list, params, f"{at} params", "a list of 7")
    require(len(params) == 7, f"{at} params", "a list of 7", shown(params))
    goes_on = entry.get("autoContinue", True)
    _typed(bool, goes_on, f"{at} autoContinue", "true or false")
    head = entry.get("doJumpId", place), entry.get("command"), entry.get("frame")
    return checked_item(source, *head, params, goes_on)


def _typed(kind: type[T], value: Any, at: str, words: str, got: str = "") -> T:
    """Return a value of a type of JSON; True is no integer.

    Raises:
        InputError: It has another type.
    """
    require(type(value) is kind, at, words, got or shown(value))
    return value


def checked_item(
    where: str,
    number: Any,
    command: Any,
    frame: Any,
    params: Sequence[Any],
    auto_continue: bool = True,
) -> Item:
    """Return an item after checking its numbers.

    Args:
        where: File, and line if it has lines, for messages.
        number: Number of the item as read.
        command: Command as read.
        frame: Frame as read.
        params: Seven values; None and NaN are unspecified.
        auto_continue: True if the next item follows automatically.

    Raises:
        InputError: A number has another type, or as in `check_item`.
    """
    at = f"{where}: item {number}"
    numbers = {"number": number, "command": command, "frame": frame}
    for name, value in numbers.items():
        _typed(int, value, f"{at} {name}", "a whole number")
    at = f"{at}, {command_name(command)}"
    values = [
        _number(value, f"{at}, parameter {n}") for n, value in enumerate(params, 1)
    ]
    # Messages with integer coordinates have been scaled by their reader.
    frame = INTEGER_FRAMES.get(frame, frame)
    item = Item(number, command, frame, (*values,), auto_continue)
    check_item(item, where)
    return item


def check_item(item: Item, where: str) -> None:
    """Check command, frame, parameters and position of an item.

    Args:
        item: The item.
        where: File, and line if it has lines, for messages.

    Raises:
        InputError: The command, its frame or a parameter is not supported, or its
            position is missing or out of range.
    """
    # A command without effect may have any frame.
    if item.ignored:
        return
    known = ", ".join(f"{one} ({kind.name})" for one, kind in COMMANDS.items())
    at, kind = f"{where}: item {item.number} command", COMMANDS.get(item.command)
    require(kind is not None, at, f"one of {known}", item.command)
    assert kind is not None
    at, frames = f"{where}: {item.words}", dict(FRAMES)
    if kind.placed:
        del frames[MISSION]
    words = "one of " + ", ".join(f"{one} ({name})" for one, name in frames.items())
    require(item.frame in frames, f"{at}, frame", words, item.frame)
    for n, (value, allowed) in enumerate(
        zip(item.params[:4], kind.allowed, strict=True), start=1
    ):
        holds = value is None or allowed.holds(value)
        require(holds, f"{at}, parameter {n}", allowed.words, f"{value or 0:g}")
    if kind.placed:
        check_place(item.params[4:], at, kind.needs)


def check_place(
    place: Sequence[float | None], at: str, needs: Sequence[bool] = (True, True, True)
) -> None:
    """Check a latitude, longitude and height; None is unspecified.

    Raises:
        InputError: One of them is out of range, or missing but needed.
    """
    names = ("latitude", "longitude", "height")
    limits = PLACE_LIMITS.values()
    for name, value, bounds, needed in zip(names, place, limits, needs, strict=True):
        require(value is not None or not needed, f"{at}, {name}", "a number", "nothing")
        if value is not None:
            bounds.checked(value, f"{at}, {name}")


def _number(value: Any, at: str) -> float | None:
    """Return a number; None for null or NaN."""
    if value is None:
        return None
    # JSON has integers of any length. NaN is not larger.
    finite = type(value) in (int, float) and not abs(value) > sys.float_info.max
    require(finite, at, "a finite number or null", shown(value))
    return None if math.isnan(value) else float(value)


class Allowed(NamedTuple):
    """Supported values of a parameter.

    Attributes:
        words: The values in words.
        holds: Function from a value to whether it is supported.
    """

    words: str
    holds: Callable[[float], bool]


# Ignoring a parameter would fly another mission than the one displayed.
NOTHING = Allowed("0 or nothing (no other value is supported)", lambda x: x == 0)
ANY = Allowed("a number", UNBOUNDED.allows)
NONE = (NOTHING, NOTHING, NOTHING, NOTHING)
AT_LEAST_0 = Allowed("0 or more", NOT_NEGATIVE.allows)
TIMES = Allowed("0 to 1000 turns", lambda x: 0 <= x <= 1000)
SECONDS = Allowed(
    "a positive number of seconds (a time of day is not supported)", POSITIVE.allows
)
SENSE = Allowed("one of -1, 0, 1", (-1, 0, 1).__contains__)
RELATES = Allowed("one of 0, 1", (0, 1).__contains__)
REPEATS = Allowed(
    "a number of repetitions, 0 or more (-1, without end, is not possible unattended)",
    lambda x: x >= 0 and x.is_integer(),
)
OF_SPEED = Allowed("one of 0, 1, 2, 3", (0, 1, 2, 3).__contains__)
CHANGE = Allowed("0.05 to 60 m/s, or -1", lambda x: x == -1 or 0.05 <= x <= 60)


class Command(NamedTuple):
    """Command of a supported command.

    Attributes:
        name: Short name.
        allowed: Supported values of parameters 1 to 4.
        placed: True if it has a position; 0, 0 is the current one.
        needs: Whether latitude, longitude and height must be numbers.
    """

    name: str
    allowed: tuple[Allowed, Allowed, Allowed, Allowed]
    placed: bool = True
    needs: tuple[bool, bool, bool] = (True, True, True)


NOWHERE = (False, False, False)
COMMANDS: dict[int, Command] = {
    # hold [s], acceptance radius [m], -, yaw [degree, clockwise from north]
    Nav.WAYPOINT: Command("waypoint", (AT_LEAST_0, AT_LEAST_0, NOTHING, ANY)),
    # A multicopter loiters on the spot, at any radius.
    Nav.LOITER: Command("loiter", (NOTHING, NOTHING, ANY, ANY)),
    # turns, exit heading, radius [m] (positive: clockwise), exit location: the vehicle
    # leaves at its entry point
    Nav.TURNS: Command("loiter for turns", (TIMES, ANY, ANY, ANY)),
    # time [s], and the same three, which have no meaning on the spot
    Nav.LOITER_TIME: Command("loiter for a time", (AT_LEAST_0, ANY, ANY, ANY)),
    Nav.RETURN: Command("return to launch", NONE, placed=False),
    # yaw; it lands on the ground at any height parameter
    Nav.LAND: Command("land", (NOTHING, NOTHING, NOTHING, ANY), needs=NOWHERE),
    # pitch (fixed wing only), -, -, yaw
    Nav.TAKEOFF: Command(
        "take-off", (ANY, NOTHING, NOTHING, ANY), needs=(False, False, True)
    ),
    # delay [s]
    Nav.DELAY: Command("delay", (SECONDS, ANY, ANY, ANY), placed=False),
    # angle [degree], rate, sense (1: clockwise), 1: relative to the heading
    Nav.HEADING: Command("turn", (ANY, ANY, SENSE, RELATES), placed=False),
    # number of the next item, number of repetitions
    Nav.JUMP: Command("jump", (ANY, REPEATS, NOTHING, NOTHING), placed=False),
    # 0 or 1: over ground, 2: climb, 3: descent; [m/s], -1 no change; throttle
    Nav.SPEED: Command("change speed", (OF_SPEED, CHANGE, ANY, NOTHING), placed=False),
}
"""Supported commands by number."""


def command_name(number: int) -> str:
    """Return the name of a supported command, or the number of another one."""
    known = COMMANDS.get(number)
    return f"command {number}" if known is None else known.name
