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
import tomllib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from jblast.errors import InputError, nearest, read_text, require, shown
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
ITEM_KEYS = ("type", "frame", "command", "params", "autoContinue", "doJumpId")
PARTS = {
    "geoFence": (("circles", "polygons"), "a fence"),
    "rallyPoints": (("points",), "rally points"),
}
"""Ignored parts of a plan, their lists, and their description."""
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
MAX_LISTED = 3
"""Maximum number of items of one ignored command in a warning."""


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
        not_flown: Descriptions of ignored parts.
        rest: Other parts of the file, written back unchanged.
    """

    items: tuple[Item, ...]
    home: Place | None = None
    hover_speed_m_s: float | None = None
    firmware: int = 12
    source: str = ""
    not_flown: tuple[str, ...] = ()
    rest: dict[str, Any] = field(default_factory=dict, compare=False)

    @property
    def where(self) -> str:
        """Name of the plan in messages."""
        return self.source or "plan"

    @property
    def ignored(self) -> str:
        """Ignored parts and commands, one line; "" without any."""
        items: dict[int, list[str]] = {}
        for item in self.items:
            if item.ignored:
                items.setdefault(item.command, []).append(str(item.number))
        parts = list(self.not_flown)
        for command, numbers in items.items():
            more = len(numbers) - MAX_LISTED
            last = [f"{more} more"] if more > 0 else []
            listed = ", ".join([*numbers[:MAX_LISTED], *last])
            word = "item" if len(numbers) == 1 else "items"
            parts.append(f"command {command} in {word} {listed}")
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
    mission = dict(plan.rest.get("mission", {})) | {
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
    # MAV_TYPE 2: a quadrotor.
    mission.setdefault("vehicleType", 2)
    if plan.hover_speed_m_s is not None:
        mission["hoverSpeed"] = plan.hover_speed_m_s
        # QGroundControl writes both; the cruise speed is that of aeroplanes.
        mission.setdefault("cruiseSpeed", plan.hover_speed_m_s)
    document = {
        "fileType": "Plan",
        "version": 1,
        "groundStation": "QGroundControl",
        "geoFence": {"circles": [], "polygons": [], "version": 2},
        "rallyPoints": {"points": [], "version": 2},
    }
    document |= {**plan.rest, "mission": mission}
    return json.dumps(document, indent=4, allow_nan=False) + "\n"


def read_plan(path: str | os.PathLike[str]) -> Plan:
    """Read a plan; its format follows from the content, not from the name.

    Args:
        path: QGroundControl's .plan, version 1, or a list of waypoints, QGC WPL 110.

    Raises:
        InputError: It is neither, or as in `read_ground_control`.

    Example:
        `plan = read_plan("campus.plan")`
    """
    text = read_text(path, EXPECTED)
    begin = text.lstrip()[:40]
    if begin.startswith("{"):
        return read_ground_control(text, str(path))
    if begin.startswith(HEAD):
        return read_waypoint_list(text.lstrip(), str(path))
    got = shown(begin.partition("\n")[0]) if begin else "an empty file"
    raise InputError(f"{path}: line 1: expected {EXPECTED}; got {got}")


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
    """Read a list of waypoints.

    Args:
        text: The file.
        source: Its name, for the messages.

    Raises:
        InputError: It is none, of another version, or an item cannot be flown.
    """
    lines = text.split("\n")
    version = lines[0].strip().removeprefix(HEAD).strip()
    where = f"{source}: line 1"
    require(version == VERSION, where, f"{HEAD} {VERSION}", shown(lines[0]))
    items, home = [], None
    for n, line in enumerate(lines[1:], start=2):
        if not line.strip():
            continue
        at = f"{source}: line {n}"
        fields = line.strip().split("\t")
        if len(fields) == 1:  # an editor has replaced tabs by blanks
            fields = line.split()
        words = f"{len(FIELDS)} fields between tabs ({', '.join(FIELDS)})"
        require(len(fields) == len(FIELDS), at, words, len(fields))
        numbers = [
            _read(text, f"{at}: {name}")
            for text, name in zip(fields, FIELDS, strict=True)
        ]
        number, _, frame, command, *params, goes_on = numbers
        item = checked_item(at, number, command, frame, params, goes_on != 0)
        # Home is the first line only, and only above the sea: a later one is a
        # waypoint.
        if not items and home is None and (command, frame) == (Nav.WAYPOINT, GLOBAL):
            home = Place(*map(item.number_of, (5, 6, 7)))
            continue
        items.append(item)
    check_numbers(items, source)
    return Plan(items=tuple(items), home=home, source=source)


def _read(text: str, at: str) -> int | float:
    """Return the number of a field; a whole one as an integer."""
    try:
        value = float(text)
    except ValueError:
        raise InputError(f"{at}: expected a number, got {shown(text)}") from None
    return int(value) if value.is_integer() else value


def read_ground_control(text: str, source: str) -> Plan:
    """Read a .plan.

    Args:
        text: The file.
        source: Its name, for the messages.

    Raises:
        InputError: It is none, of another version, or an item cannot be flown.
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
        version = _typed(
            int, table.get("version"), f"{source}: {of}version", f"{known}"
        )
        require(version == known, f"{source}: {of}version", f"{known}", version)
    entries = _typed(list, mission.get("items"), f"{source}: items", "a list")
    simple = [
        one
        for n, entry in enumerate(entries, start=1)
        for one in _simple_items(entry, n, source)
    ]
    items = tuple(_item(one, n, source) for n, one in enumerate(simple, start=1))
    check_numbers(items, source)
    speed = _number(mission.get("hoverSpeed"), f"{source}: hoverSpeed")
    if speed is not None:
        POSITIVE.checked(speed, f"{source}: hoverSpeed", "a number [m/s]")
    firmware = mission.get("firmwareType", 12)
    return Plan(
        items=items,
        home=_home(mission.get("plannedHomePosition"), source),
        hover_speed_m_s=speed,
        firmware=firmware if type(firmware) is int else 12,
        source=source,
        not_flown=tuple(
            f"{name}: {words}"
            for name, (lists, words) in PARTS.items()
            if isinstance(part := document.get(name), dict)
            # QGroundControl writes both parts into every plan, mostly with empty lists
            and any(part.get(each) for each in lists)
        ),
        rest=document,
    )


def _simple_items(entry: Any, place: int, source: str) -> list[Any]:
    """Return an entry of a plan, or the simple items of a complex one."""
    if not isinstance(entry, dict) or entry.get("type") != "ComplexItem":
        return [entry]
    # A survey or corridor has its waypoints in "TransectStyleComplexItem", "Items".
    tables = [entry, *(value for value in entry.values() if isinstance(value, dict))]
    items = next((items for table in tables if (items := table.get("Items"))), None)
    if not isinstance(items, list):
        name = shown(entry.get("complexItemType"))
        raise InputError(
            f"{source}: item {place}: expected a SimpleItem, or a ComplexItem with its "
            f"waypoints in Items, got the ComplexItem {name} without; a plan that "
            "QGroundControl downloads from a vehicle has waypoints in its place"
        )
    return items


def _item(entry: Any, place: int, source: str) -> Item:
    """Return one item, the nth in the file."""
    at = f"{source}: item {place}"
    entry = _typed(dict, entry, at, "a table")
    kind, params = entry.get("type"), entry.get("params")
    require(kind == "SimpleItem", f"{at} type", "SimpleItem", shown(kind))
    number = entry.get("doJumpId", place)
    _typed(int, number, f"{at} doJumpId", "a whole number")
    at = f"{source}: item {number}"
    close = nearest("params", set(entry) - set(ITEM_KEYS))
    seven = isinstance(params, list) and len(params) == 7
    require(seven, f"{at} params", "a list of 7", shown(params) + close)
    goes_on = entry.get("autoContinue", True)
    _typed(bool, goes_on, f"{at} autoContinue", "true or false")
    return checked_item(
        source, number, entry.get("command"), entry.get("frame"), params, goes_on
    )


def _typed(kind: type[T], value: Any, at: str, words: str) -> T:
    """Return a value of a type of JSON; True is no integer.

    Raises:
        InputError: It has another type.
    """
    require(type(value) is kind, at, words, shown(value))
    return value


def _home(value: Any, source: str) -> Place:
    """Return the home position."""
    at = f"{source}: plannedHomePosition"
    three = isinstance(value, list) and len(value) == 3 and None not in value
    require(three, at, "[latitude, longitude, height]", shown(value))
    home = Place(*(_number(each, at) or 0.0 for each in value))
    check_place(home, at)
    return home


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
        InputError: The command or its frame is not supported, position or height is
            missing or out of range, or a parameter is not supported.
    """
    at = f"{where}: item {number}"
    _typed(int, number, f"{where}: number", "a whole number")
    known = ", ".join(f"{one} ({kind.name})" for one, kind in COMMANDS.items())
    # `type`, because True is an int for `isinstance`.
    supported = type(command) is int and (command in COMMANDS or command in IGNORED)
    require(supported, f"{at} command", f"one of {known}", shown(command))
    # Messages with integer coordinates have been scaled by their reader.
    frame = INTEGER_FRAMES.get(frame, frame) if type(frame) is int else frame
    # A command without effect may have any frame.
    supported = type(frame) is int and (frame in FRAMES or command in IGNORED)
    at = f"{at}, {command_name(command)}"
    words = "one of " + ", ".join(f"{one} ({name})" for one, name in FRAMES.items())
    require(supported, f"{at}, frame", words, shown(frame))
    values = [
        _number(value, f"{at}, parameter {n}") for n, value in enumerate(params, 1)
    ]
    item = Item(number, command, frame, (*values,), auto_continue)
    check_item(item, where)
    if not item.ignored and COMMANDS[command].placed:
        have = frame != MISSION
        require(have, f"{at}, frame", "0, 3 or 10, with a position", "2")
        needs = COMMANDS[command].needs
        names = ("latitude", "longitude", "height")
        for name, value, needed in zip(names, values[4:], needs, strict=True):
            there = value is not None or not needed
            require(there, f"{at}, {name}", "a number", "nothing")
    return item


def check_item(item: Item, where: str) -> None:
    """Check the parameters and the position of an item.

    Args:
        item: The item.
        where: File, and line if it has lines, for messages.

    Raises:
        InputError: A parameter is not supported, or a position is out of range.
    """
    if item.ignored:
        return
    at, kind = f"{where}: {item.words}", COMMANDS[item.command]
    for n, (value, allowed) in enumerate(
        zip(item.params[:4], kind.allowed, strict=True), start=1
    ):
        holds = value is None or allowed.holds(value)
        require(holds, f"{at}, parameter {n}", allowed.words, f"{value or 0:g}")
    if kind.placed:
        check_place(item.params[4:], at)


def check_numbers(items: Sequence[Item], where: str) -> None:
    """Reject two items with the same number.

    Raises:
        InputError: A number occurs twice.
    """
    seen: set[int] = set()
    for item in items:
        at, new = f"{where}: item {item.number}", item.number not in seen
        require(new, at, "a new number", "that of another item")
        seen.add(item.number)


def check_place(place: Sequence[float | None], at: str) -> None:
    """Check a latitude, longitude and height; None is unspecified.

    Raises:
        InputError: One of them is out of range.
    """
    names = ("latitude", "longitude", "height")
    for name, value, bounds in zip(names, place, PLACE_LIMITS.values(), strict=True):
        if value is not None:
            bounds.checked(value, f"{at}, {name}")


def _number(value: Any, at: str) -> float | None:
    """Return a number; None for null or NaN."""
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        advice = nearest(value, ("null",)) if isinstance(value, str) else ""
        raise InputError(f"{at}: expected a number or null, got {shown(value)}{advice}")
    try:
        number = float(value)
    # JSON has integers of any length.
    except OverflowError:
        number = math.inf
    if math.isinf(number):
        raise InputError(f"{at}: expected a finite number, got {shown(value)}")
    return None if math.isnan(number) else number


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
