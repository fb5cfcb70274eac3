"""QGC WPL 110: the older text form of a plan, twelve fields a line, between tabs.

number, current, frame, command, p1, p2, p3, p4, latitude, longitude, height, continue.
The first line is home where it is a waypoint by heights above the sea (frame 0), as
QGroundControl and Mission Planner write it; a list without home begins with its first
item.
"""

import math

from jblast.errors import InputError, shown
from jblast.missions.plan.commands import GLOBAL, WAYPOINT
from jblast.missions.plan.item import Item, Plan, check_numbers, checked_item
from jblast.scene import Place

HEAD = "QGC WPL"
VERSION = "110"
FIELDS = (
    *("number", "current", "frame", "command", "p1", "p2", "p3", "p4"),
    *("latitude", "longitude", "height", "continue"),
)


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
        if len(fields) == 1:  # from an editor that made blanks of tabs
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
        if not items and home is None and (command, frame) == (WAYPOINT, GLOBAL):
            lat, lon, alt = (item.number_of(i) for i in (5, 6, 7))
            home = Place(lat, lon, alt)
            continue
        items.append(item)
    check_numbers(items, source)
    return Plan(items=tuple(items), home=home, source=source)


def waypoint_list_text(plan: Plan) -> str:
    """Return a plan as a list of waypoints; numbers go up from 1, home is 0.

    Raises:
        InputError: The plan does not say where home is, whose line comes first.
    """
    if plan.home is None:
        raise InputError(
            f"{plan.where}: home: expected latitude, longitude and height for the "
            "first line, got nothing"
        )
    lat, lon, alt = plan.home
    first = (None, None, None, None, lat, lon, alt)
    rows = [_line(Item(0, WAYPOINT, GLOBAL, first), current=True)]
    rows += [_line(item, current=False) for item in plan.items]
    return "\n".join([f"{HEAD} {VERSION}", *rows]) + "\n"


def _line(item: Item, *, current: bool) -> str:
    # what is not said is 0 in this form: a yaw of nothing would be north, so nan
    said = [
        ("nan" if n == 3 else "0") if value is None else _written(value)
        for n, value in enumerate(item.params)
    ]
    head = [item.number, int(current), item.frame, item.command]
    return "\t".join([*map(str, head), *said, str(int(item.auto_continue))])


def _written(value: float) -> str:
    """Return the shortest text that is read back as the same number."""
    return repr(int(value)) if value == int(value) else repr(value)


def _whole(text: str, at: str) -> int:
    value = _real(text, at)
    if value is None or value != int(value):
        raise InputError(f"{at}: expected a whole number, got {shown(text)}")
    return int(value)


def _real(text: str, at: str) -> float | None:
    """Return a number; None for nan, which is nothing said."""
    try:
        value = float(text)
    except ValueError:
        raise InputError(f"{at}: expected a number, got {shown(text)}") from None
    if math.isinf(value):
        raise InputError(f"{at}: expected a finite number, got {shown(text)}")
    return None if math.isnan(value) else value
