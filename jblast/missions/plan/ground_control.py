"""QGroundControl's .plan, version 1: JSON.

What its loader demands is kept: fileType, version, groundStation, mission of version 2
with plannedHomePosition, items and firmwareType; an item has exactly seven params.
"""

import json
from typing import Any

from jblast.errors import InputError, nearest, shown
from jblast.missions.plan.item import Item, Plan, check_numbers, checked_item
from jblast.parameter_table import PLACE_LIMITS
from jblast.scene import Place

ITEM_KEYS = ("type", "frame", "command", "params", "autoContinue", "doJumpId")
PARTS = {
    "geoFence": (("circles", "polygons"), "a fence"),
    "rallyPoints": (("points",), "rally points"),
}
"""What a plan may have besides, the lists in it, and how it is called."""


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
    items = tuple(_item(entry, n, source) for n, entry in enumerate(entries, start=1))
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
        not_flown=tuple(_not_flown(document)),
        rest=document,
    )


def ground_control_text(plan: Plan) -> str:
    """Return a plan as QGroundControl reads it.

    Parts of the file it was read from that nothing here goes by are written as they
    were.

    Raises:
        InputError: The plan does not say where home is.
    """
    if plan.home is None:
        raise InputError(
            f"{plan.where}: home: expected latitude, longitude and height, which a "
            ".plan has to say, got nothing"
        )
    mission = dict(plan.rest.get("mission", {})) | {
        "version": 2,
        "firmwareType": plan.firmware,
        "plannedHomePosition": list(plan.home),
        "items": [_entry(item) for item in plan.items],
    }
    mission.setdefault("vehicleType", 2)
    if plan.hover_speed_m_s is not None:
        mission["hoverSpeed"] = plan.hover_speed_m_s
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


def _item(entry: Any, place: int, source: str) -> Item:
    """Return one item, the nth in the file."""
    if not isinstance(entry, dict):
        raise InputError(
            f"{source}: item {place}: expected a table, got {shown(entry)}"
        )
    if entry.get("type") == "ComplexItem":
        name = shown(entry.get("complexItemType"))
        raise InputError(
            f"{source}: item {place}: expected a SimpleItem, got the ComplexItem "
            f"{name}; a plan that QGroundControl downloads from a vehicle has "
            "waypoints in its place"
        )
    if entry.get("type") != "SimpleItem":
        raise InputError(
            f"{source}: item {place} type: expected SimpleItem, "
            f"got {shown(entry.get('type'))}"
        )
    number = entry.get("doJumpId", place)
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
    """Refuse another version than the one that is read."""
    version = table.get("version")
    if type(version) is not int or version != known:
        raise InputError(
            f"{source}: {of}version: expected {known}, got {shown(version)}"
        )


def _home(value: Any, source: str) -> Place:
    """Return where home is."""
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
    """Return whether this is a finite number of a common size."""
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    return is_number and abs(value) < 1e9 and value > above


def _not_flown(document: dict[str, Any]) -> list[str]:
    """Return what else the plan has, in words."""
    found = []
    for name, (lists, words) in PARTS.items():
        part = document.get(name)
        if isinstance(part, dict) and any(part.get(each) for each in lists):
            found.append(f"{name}: {words}")
    return found
