"""Items of a plan as messages of the mission protocol, and back."""

import math
from collections.abc import Sequence
from typing import Any

from jblast.missions.plan.commands import COMMANDS
from jblast.missions.plan.item import Item, Plan, checked_item
from jblast.scene import Place

WHOLE_FRAMES = {5: 0, 6: 3}
"""Frames whose places are whole numbers, and the frames that they are."""
UPLOADED = "uploaded mission"


def item_fields(item: Item, sequence: int) -> dict[str, Any]:
    """Return the fields of MISSION_ITEM_INT of an item."""
    params = [math.nan if value is None else value for value in item.params]
    lat, lon, alt = (0.0 if math.isnan(value) else value for value in params[4:])
    placed = COMMANDS[item.command].placed != "never"
    return {
        "seq": sequence,
        "frame": item.frame,
        "command": item.command,
        "current": int(sequence == 0),
        "autocontinue": int(item.auto_continue),
        **{f"param{n + 1}": params[n] for n in range(4)},
        "x": round(1e7 * lat) if placed else int(lat),
        "y": round(1e7 * lon) if placed else int(lon),
        "z": alt,
    }


def item_of(fields: dict[str, Any]) -> Item:
    """Return the item that MISSION_ITEM_INT tells.

    Raises:
        InputError: As in `checked_item`.
    """
    command, frame = fields["command"], fields["frame"]
    frame = WHOLE_FRAMES.get(frame, frame)
    lat, lon = fields["x"] / 1e7, fields["y"] / 1e7
    params = [*(fields[f"param{n}"] for n in range(1, 5)), lat, lon, fields["z"]]
    return checked_item(
        UPLOADED, fields["seq"], command, frame, params, bool(fields["autocontinue"])
    )


def plan_of(items: Sequence[Item], home: Place) -> Plan:
    """Return the plan of items that were uploaded; home is where the vehicle stands."""
    return Plan(items=tuple(items), home=home, source=UPLOADED)
