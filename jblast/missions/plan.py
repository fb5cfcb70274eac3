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
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from jblast.errors import InputError, nearest, read_text, shown
from jblast.files import write_text
from jblast.parameters import PLACE_LIMITS, Place

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
Parameters = tuple[
    float | None,
    float | None,
    float | None,
    float | None,
    float | None,
    float | None,
    float | None,
]
# MAV_CMD of the supported items, without the prefixes NAV and DO.
WAYPOINT, LOITER, TURNS, LOITER_TIME = 16, 17, 18, 19
RETURN, LAND, TAKEOFF, DELAY, HEADING = 20, 21, 22, 93, 115
JUMP, SPEED = 177, 178
IGNORED = {
    112: "delay of the next command",
    114: "next command after a distance",
    181: "set relay",
    182: "repeat relay",
    183: "set servo",
    184: "repeat servo",
    187: "set actuator",
    189: "start of a landing",
    195: "region of interest",
    196: "region of interest at the next waypoint",
    197: "no region of interest",
    200: "camera control",
    201: "region of interest",
    202: "camera settings",
    203: "camera control",
    204: "gimbal settings",
    205: "gimbal",
    206: "camera trigger by distance",
    207: "switch the fence",
    211: "gripper",
    214: "camera trigger by time",
    220: "gimbal",
    530: "camera mode",
    531: "camera zoom",
    532: "camera focus",
    1000: "gimbal",
    1001: "gimbal settings",
    2000: "take pictures",
    2001: "stop pictures",
    2003: "camera trigger",
    2500: "start video",
    2501: "stop video",
}
"""Commands without effect on the path of a multicopter, with their names.

112 and 114 delay only other commands of this list, 189 marks an item, and a region of
interest turns the camera, or the vehicle about its vertical axis.
"""
NOT_FLOWN = {
    31: "loiter to altitude",
    82: "spline waypoint",
    84: "VTOL take-off",
    85: "VTOL landing",
    92: "guided enable",
    94: "payload place",
    113: "change altitude",
    176: "set mode",
    179: "set home",
    3000: "VTOL transition",
}
"""Names of some unsupported commands, for messages."""
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
FRAMES_NOT_FLOWN = {1: "local north, east, down", 4: "local east, north, up"}
MAX_LISTED = 3
"""Maximum number of items of one ignored command in a warning."""


@dataclass(frozen=True)
class Item:
    """One item of a plan.

    Attributes:
        number: Number in the plan, as shown by ground stations and used by jumps.
        command: Key of `COMMANDS`.
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
        return f"item {self.number}, {COMMANDS[self.command].name}"

    @property
    def ignored(self) -> bool:
        """True for a command without effect on the path."""
        return COMMANDS[self.command].ignored

    @property
    def place(self) -> tuple[float, float] | None:
        """Latitude and longitude [degree]; None: current position, or no position."""
        lat, lon = self.params[4], self.params[5]
        placed = COMMANDS[self.command].placed
        if placed == "never" or lat is None or lon is None:
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
            parts.append(f"{command_words(command)} in {word} {listed}")
        return f"ignored in {self.where}: {'; '.join(parts)}" if parts else ""


def plan_text(plan: Plan, path: str | os.PathLike[str]) -> str:
    """Return a plan in QGroundControl's format, for a file with the suffix .plan.

    Ignored parts of the original file are written unchanged.

    Raises:
        InputError: The plan has no home, or the file has another suffix.
    """
    check_form(path)
    if plan.home is None:
        raise InputError(
            f"{plan.where}: home: expected latitude, longitude and height, required in "
            "a .plan, got nothing"
        )
    mission = dict(plan.rest.get("mission", {})) | {
        "version": 2,
        "firmwareType": plan.firmware,
        "plannedHomePosition": list(plan.home),
        "items": [_entry(item) for item in plan.items],
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
    if ending != ".plan":
        raise InputError(
            f"{path}: expected a name with the suffix .plan, got "
            f"{ending or 'no suffix'}"
        )


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
    if version != VERSION:
        raise InputError(
            f"{source}: line 1: expected {HEAD} {VERSION}, got {shown(lines[0])}"
        )
    items, home = [], None
    for n, line in enumerate(lines[1:], start=2):
        if not line.strip():
            continue
        at = f"{source}: line {n}"
        fields = line.strip().split("\t")
        if len(fields) == 1:  # an editor has replaced tabs by blanks
            fields = line.split()
        if len(fields) != len(FIELDS):
            raise InputError(
                f"{at}: expected {len(FIELDS)} fields between tabs "
                f"({', '.join(FIELDS)}), got {len(fields)}"
            )
        number, _, frame, command, goes_on = (
            _whole(fields[i], f"{at}: {FIELDS[i]}") for i in (0, 1, 2, 3, 11)
        )
        params = [
            _real(fields[i], f"{at}: {FIELDS[i]}") for i in range(4, len(FIELDS) - 1)
        ]
        item = checked_item(at, number, command, frame, params, goes_on != 0)
        # Home is the first line only, and only above the sea: a later one is a
        # waypoint.
        if not items and home is None and (command, frame) == (WAYPOINT, GLOBAL):
            lat, lon, alt = (item.number_of(i) for i in (5, 6, 7))
            home = Place(lat, lon, alt)
            continue
        items.append(item)
    check_numbers(items, source)
    return Plan(items=tuple(items), home=home, source=source)


def _whole(text: str, at: str) -> int:
    value = _real(text, at)
    if value is None or value != int(value):
        raise InputError(f"{at}: expected a whole number, got {shown(text)}")
    return int(value)


def _real(text: str, at: str) -> float | None:
    """Return a number; None for nan, which means unspecified."""
    try:
        value = float(text)
    except ValueError:
        raise InputError(f"{at}: expected a number, got {shown(text)}") from None
    if math.isinf(value):
        raise InputError(f"{at}: expected a finite number, got {shown(text)}")
    return None if math.isnan(value) else value


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
    if not isinstance(document, dict):
        raise InputError(f"{source}: expected a plan, {{...}}, got {shown(document)}")
    kind = document.get("fileType")
    if kind != "Plan":
        raise InputError(f'{source}: fileType: expected "Plan", got {shown(kind)}')
    _version(document, 1, source, "")
    mission = document.get("mission")
    if not isinstance(mission, dict):
        raise InputError(f"{source}: mission: expected a table, got {shown(mission)}")
    _version(mission, 2, source, "mission ")
    entries = mission.get("items")
    if not isinstance(entries, list):
        raise InputError(f"{source}: items: expected a list, got {shown(entries)}")
    found: list[Item] = []
    for n, entry in enumerate(entries, start=1):
        for one in _simple_items(entry, n, source):
            found.append(_item(one, len(found) + 1, source))
    items = tuple(found)
    check_numbers(items, source)
    speed = mission.get("hoverSpeed")
    if speed is not None and not _is_number(speed, above=0.0):
        raise InputError(
            f"{source}: hoverSpeed: expected a positive number [m/s], "
            f"got {shown(speed)}"
        )
    firmware = mission.get("firmwareType", 12)
    return Plan(
        items=items,
        home=_home(mission.get("plannedHomePosition"), source),
        hover_speed_m_s=None if speed is None else float(speed),
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
    if not isinstance(entry, dict):
        raise InputError(
            f"{source}: item {place}: expected a table, got {shown(entry)}"
        )
    if entry.get("type") != "SimpleItem":
        raise InputError(
            f"{source}: item {place} type: expected SimpleItem, "
            f"got {shown(entry.get('type'))}"
        )
    number = entry.get("doJumpId", place)
    # `type`, because True is an int for `isinstance`.
    if type(number) is not int:
        raise InputError(
            f"{source}: item {place} doJumpId: expected a whole number, "
            f"got {shown(number)}"
        )
    params = entry.get("params")
    if not isinstance(params, list) or len(params) != 7:
        close = nearest("params", set(entry) - set(ITEM_KEYS))
        raise InputError(
            f"{source}: item {number} params: expected a list of 7, "
            f"got {shown(params)}{close}"
        )
    goes_on = entry.get("autoContinue", True)
    if not isinstance(goes_on, bool):
        raise InputError(
            f"{source}: item {number} autoContinue: expected true or false, "
            f"got {shown(goes_on)}"
        )
    return checked_item(
        source, number, entry.get("command"), entry.get("frame"), params, goes_on
    )


def _entry(item: Item) -> dict[str, Any]:
    return {
        "autoContinue": item.auto_continue,
        "command": item.command,
        "doJumpId": item.number,
        "frame": item.frame,
        "params": list(item.params),
        "type": "SimpleItem",
    }


def _version(table: dict[str, Any], known: int, source: str, of: str) -> None:
    """Reject other versions than the supported one."""
    version = table.get("version")
    if type(version) is not int or version != known:
        raise InputError(
            f"{source}: {of}version: expected {known}, got {shown(version)}"
        )


def _home(value: Any, source: str) -> Place:
    """Return the home position."""
    at = f"{source}: plannedHomePosition"
    if not (
        isinstance(value, list) and len(value) == 3 and all(map(_is_number, value))
    ):
        raise InputError(
            f"{at}: expected [latitude, longitude, height], got {shown(value)}"
        )
    lat, lon, alt = map(float, value)
    if not (abs(lat) <= 90.0 and abs(lon) <= 180.0):
        raise InputError(
            f"{at}: expected a latitude of -90 to 90 and a longitude of -180 to 180 "
            f"degrees, got {lat:g}, {lon:g}"
        )
    if not PLACE_LIMITS["alt_m"].allows(alt):
        words = PLACE_LIMITS["alt_m"].words()
        raise InputError(f"{at}: expected a height {words} m, got {alt:g}")
    return Place(lat, lon, alt)


def _is_number(value: Any, above: float = float("-inf")) -> bool:
    """Return whether a value is a finite number of a plausible size."""
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    return is_number and abs(value) < 1e9 and value > above


def checked_item(
    where: str,
    number: int,
    command: Any,
    frame: Any,
    params: Sequence[Any],
    auto_continue: bool = True,
) -> Item:
    """Return an item after checking its numbers.

    Args:
        where: File, and line if it has lines, for messages.
        number: Number of the item.
        command: Command as read.
        frame: Frame as read.
        params: Seven values; None and NaN are unspecified.
        auto_continue: True if the next item follows automatically.

    Raises:
        InputError: The command or its frame is not supported, position or height is
            missing or out of range, or a parameter is not supported.
    """
    at = f"{where}: item {number}"
    if type(command) is not int or command not in COMMANDS:
        given = command_words(command) if type(command) is int else shown(command)
        flown = [one for one, kind in COMMANDS.items() if not kind.ignored]
        known = ", ".join(map(command_words, flown))
        raise InputError(f"{at} command: expected one of {known}; got {given}")
    kind = COMMANDS[command]
    at = f"{at}, {kind.name}"
    # A command without effect may have any frame; messages with integer coordinates
    # have been scaled by their reader.
    frame = INTEGER_FRAMES.get(frame, frame) if type(frame) is int else frame
    if type(frame) is not int or not (frame in FRAMES or kind.ignored):
        frames = ", ".join(f"{one} ({words})" for one, words in FRAMES.items())
        other = FRAMES_NOT_FLOWN.get(frame) if type(frame) is int else None
        got = shown(frame) + (f" ({other})" if other else "")
        raise InputError(f"{at}, frame: expected one of {frames}; got {got}")
    values = [_number(value, f"{at}, parameter {n}") for n, value in _counted(params)]
    for n, value in _counted(values[:4]):
        # Ignoring a parameter would fly another mission than the one displayed.
        if value and n not in kind.used and not kind.ignored:
            raise InputError(
                f"{at}, parameter {n}: expected 0 or nothing (no other value is "
                f"supported), got {value:g}"
            )
    item = Item(number, command, frame, (*values,), auto_continue)  # type: ignore[arg-type]  seven, counted by the reader
    if kind.placed != "never":
        _check_place(item, at)
    return item


def check_numbers(items: Sequence[Item], where: str) -> None:
    """Reject two items with the same number.

    Raises:
        InputError: A number occurs twice.
    """
    seen: set[int] = set()
    for item in items:
        if item.number in seen:
            raise InputError(
                f"{where}: item {item.number}: expected a new number, got that of "
                "another item"
            )
        seen.add(item.number)


def _check_place(item: Item, at: str) -> None:
    """Reject an invalid position.

    Raises:
        InputError: Latitude, longitude or height are missing or out of range.
    """
    if item.frame == MISSION:
        raise InputError(f"{at}, frame: expected 0, 3 or 10, with a position, got 2")
    lat, lon, alt = item.params[4:]
    needs = COMMANDS[item.command].placed == "always"
    for name, value in (("latitude", lat), ("longitude", lon)):
        if value is None and needs:
            raise InputError(f"{at}, {name}: expected a number [degree], got nothing")
    if lat is not None and not -90.0 <= lat <= 90.0:
        swapped = ""
        # Plausible after an exchange: then it is proposed.
        if lon is not None and abs(lon) <= 90.0 and abs(lat) <= 180.0:
            swapped = "; are latitude and longitude swapped?"
        raise InputError(
            f"{at}, latitude: expected -90 to 90 degrees, got {lat:g}{swapped}"
        )
    if lon is not None and not -180.0 <= lon <= 180.0:
        raise InputError(f"{at}, longitude: expected -180 to 180 degrees, got {lon:g}")
    if alt is None:
        if item.command == LAND:  # lands on the ground at any height parameter
            return
        raise InputError(f"{at}, height: expected a number [m], got nothing")
    if not PLACE_LIMITS["alt_m"].allows(alt):
        words = PLACE_LIMITS["alt_m"].words()
        raise InputError(f"{at}, height: expected a number {words} m, got {alt:g}")


def _counted(values: Sequence[Any]) -> list[tuple[int, Any]]:
    return list(enumerate(values, start=1))


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


class Command(NamedTuple):
    """A supported command.

    Attributes:
        number: MAV_CMD number.
        name: Short name.
        placed: Presence of a position: "always" (0, 0 is the current position), "may"
            (0, 0 or nothing), "never".
        used: Supported parameters among 1 to 4; the others must be 0 or absent.
        ignored: True for a command without effect on the path.
    """

    number: int
    name: str
    placed: str
    used: tuple[int, ...]
    ignored: bool = False


COMMANDS = {
    command.number: command
    for command in (
        # hold [s], acceptance radius [m], -, yaw [degree, clockwise from north]
        Command(WAYPOINT, "waypoint", "always", (1, 2, 4)),
        # A multicopter loiters on the spot, at any radius.
        Command(LOITER, "loiter", "always", (3, 4)),
        # turns, exit heading, radius [m] (positive: clockwise), exit location: the
        # vehicle leaves at its entry point
        Command(TURNS, "loiter for turns", "always", (1, 2, 3, 4)),
        # time [s], and the same three, which have no meaning on the spot
        Command(LOITER_TIME, "loiter for a time", "always", (1, 2, 3, 4)),
        Command(RETURN, "return to launch", "never", ()),
        # -, -, -, yaw
        Command(LAND, "land", "may", (4,)),
        # pitch (fixed wing only), -, -, yaw
        Command(TAKEOFF, "take-off", "may", (1, 4)),
        # delay [s]; a time of day instead is refused
        Command(DELAY, "delay", "never", (1, 2, 3, 4)),
        # angle [degree], rate, sense (1: clockwise), 1: relative to the heading
        Command(HEADING, "turn", "never", (1, 2, 3, 4)),
        # number of the next item, number of repetitions
        Command(JUMP, "jump", "never", (1, 2)),
        # 0 or 1: over ground, 2: climb, 3: descent; [m/s], -1 no change; throttle
        Command(SPEED, "change speed", "never", (1, 2, 3)),
        *(Command(number, name, "never", (), True) for number, name in IGNORED.items()),
    )
}


def command_words(number: int) -> str:
    """Return a command's number with its name, if it is known."""
    if number in COMMANDS:
        return f"{number} ({COMMANDS[number].name})"
    name = NOT_FLOWN.get(number)
    return f"{number} ({name})" if name else f"{number}"
