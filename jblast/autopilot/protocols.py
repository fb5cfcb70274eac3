"""Mission and parameter protocols, from the vehicle's side.

The mission protocol is mavlink.io/en/services/mission.html. To upload, a station sends
the number of items, which the vehicle then requests one by one. An item out of sequence
is ignored and the right one requested again. An item that does not arrive within
`RETRY_S` is requested again, up to `RETRIES` times. An invalid mission is rejected as a
whole, and the previous one remains.

The parameter protocol is mavlink.io/en/services/parameter.html, with PX4's names.
"""

import math
import struct
from collections.abc import Callable
from typing import Any

from jblast.autopilot.course import TAKEOFF_UP_M, course_of
from jblast.autopilot.mavlink import Message, Sender
from jblast.autopilot.telemetry import SYSTEM
from jblast.errors import InputError
from jblast.missions.mission import Limits
from jblast.missions.plan import INTEGER_FRAMES, MISSION, Item, Plan, checked_item
from jblast.scene import Place

RETRY_S, RETRIES = 1.5, 5
"""Timeout and number of retries recommended by the protocol."""
MAX_ITEMS = 1000
"""Maximum number of items of an uploaded mission; declared, above any autopilot's."""
# MAV_MISSION_RESULT
MISSION_ACCEPTED, ERROR, MISSION_UNSUPPORTED = 0, 1, 3
NO_SPACE, INVALID, SEQUENCE = 4, 5, 13
FLIGHT_PLAN = 0
"""MAV_MISSION_TYPE of a mission; geofences and rally points have other numbers."""
FRAME_CODES = {frame: code for code, frame in INTEGER_FRAMES.items()}
"""Frames of sent items, whose coordinates are integers. PX4 sends the same, and MAVSDK
3 accepts no others."""
UPLOADED = "uploaded mission"
NOT_FOUND, READ_ONLY = 1, 5
"""MAV_PARAM_ERROR."""
PARAM_FLOAT, PARAM_INT = 9, 6
"""MAV_PARAM_TYPE: single precision, and integers of 32 bits."""
TAKEOFF_PARAMETER = "MIS_TAKEOFF_ALT"
DEFAULTS: dict[str, float | int] = {
    "MAV_SYS_ID": SYSTEM,
    TAKEOFF_PARAMETER: TAKEOFF_UP_M,
    "MPC_ACC_HOR": Limits().acceleration_m_s2,
    "MPC_LAND_ALT2": Limits().slow_below_m,
    "MPC_LAND_SPEED": Limits().landing_m_s,
    "MPC_XY_CRUISE": Limits().speed_m_s,
    "MPC_Z_V_AUTO_DN": Limits().descent_m_s,
    "MPC_Z_V_AUTO_UP": Limits().climb_m_s,
    "RTL_RETURN_ALT": Limits().return_m,
}
"""Parameters by PX4's names. The height of a take-off [m] is settable; the others are
those of missions."""


class Missions:
    """Mission of a vehicle, and the vehicle's side of the mission protocol.

    Attributes:
        plan: Current mission; None: no mission.
        home: Position of the vehicle before take-off.

    Args:
        plan: Initial mission.
        home: As above.
        check: Raises `InputError` for an invalid plan.
        report_text: Receives text for the ground station.
    """

    def __init__(
        self,
        plan: Plan | None,
        home: Place,
        check: Callable[[Plan], object],
        report_text: Callable[[str], object],
    ):
        self.plan, self.home = plan, home
        self._check, self._report_text = check, report_text
        self._items: list[Item] | None = None
        self._count = self._tries = 0
        self._requested_s = 0.0
        self._from = (0, 0)

    @property
    def items(self) -> tuple[Item, ...]:
        """Items of the plan."""
        return () if self.plan is None else self.plan.items

    def answer(self, sender: Sender, message: Message, now_s: float) -> list[bytes]:
        """Return the answers to a message of the protocol.

        Args:
            sender: Packs the answers.
            message: Received message.
            now_s: Time on the wall clock.
        """
        values, who = message.values, message.sender
        if values.get("mission_type", FLIGHT_PLAN) != FLIGHT_PLAN:
            return self._other(sender, message)
        if message.name == "MISSION_REQUEST_LIST":
            return [sender.pack_to(who, "MISSION_COUNT", count=len(self.items))]
        if message.name in ("MISSION_REQUEST_INT", "MISSION_REQUEST"):
            return [self._item(sender, who, values["seq"])]
        if message.name in ("MISSION_COUNT", "MISSION_CLEAR_ALL"):
            return self._begin(sender, who, values.get("count", 0), now_s)
        if message.name == "MISSION_ITEM_INT" and self._items is not None:
            return self._take(sender, message, now_s)
        if message.name == "MISSION_ITEM_INT":
            self._report_text("mission item: expected a requested item, got another")
            return [_ack(sender, who, SEQUENCE)]
        return []

    def remind(self, sender: Sender, now_s: float) -> list[bytes]:
        """Return a repeated request for a missing item, or an error after retries."""
        if self._items is None or now_s - self._requested_s < RETRY_S:
            return []
        self._tries += 1
        if self._tries > RETRIES:
            self._report_text(f"upload: item {len(self._items)} missing, given up")
            self._items = None
            return [_ack(sender, self._from, ERROR)]
        return [self._ask(sender, now_s)]

    def _begin(
        self, sender: Sender, who: tuple[int, int], count: int, now_s: float
    ) -> list[bytes]:
        if count > MAX_ITEMS:
            self._report_text(
                f"upload: expected at most {MAX_ITEMS} items, got {count}"
            )
            return [_ack(sender, who, NO_SPACE)]
        # An upload without items clears the mission, too.
        if count == 0:
            self.plan, self._items = None, None
            return [_ack(sender, who, MISSION_ACCEPTED)]
        self._items, self._count, self._from, self._tries = [], count, who, 0
        return [self._ask(sender, now_s)]

    def _take(self, sender: Sender, message: Message, now_s: float) -> list[bytes]:
        items = self._items
        assert items is not None
        # An item was lost or sent twice: the protocol repeats the request.
        if message.values["seq"] != len(items):
            return [self._ask(sender, now_s)]
        try:
            items.append(item_of(message.values))
            if len(items) < self._count:
                self._tries = 0
                return [self._ask(sender, now_s)]
            plan = Plan(items=tuple(items), home=self.home, source=UPLOADED)
            self._check(course_of(plan).plan(plan))
        except InputError as error:
            self._report_text(str(error))
            # A complete list means that the plan is invalid; before, a single item is.
            whole, self._items = len(items) == self._count, None
            return [_ack(sender, self._from, INVALID if whole else MISSION_UNSUPPORTED)]
        # Only a complete and valid upload replaces the plan in use.
        self.plan, self._items = plan, None
        if plan.ignored:
            self._report_text(plan.ignored)
        return [_ack(sender, self._from, MISSION_ACCEPTED)]

    def _ask(self, sender: Sender, now_s: float) -> bytes:
        self._requested_s = now_s
        sequence = len(self._items or [])
        return sender.pack_to(self._from, "MISSION_REQUEST_INT", seq=sequence)

    def _item(self, sender: Sender, who: tuple[int, int], sequence: int) -> bytes:
        if sequence >= len(self.items):
            return _ack(sender, who, SEQUENCE)
        fields = item_fields(self.items[sequence], sequence)
        return sender.pack_to(who, "MISSION_ITEM_INT", **fields)

    def _other(self, sender: Sender, message: Message) -> list[bytes]:
        """Answer for geofences and rally points: none exist and none are accepted."""
        who, kind = message.sender, message.values["mission_type"]
        if message.name == "MISSION_REQUEST_LIST":
            return [sender.pack_to(who, "MISSION_COUNT", count=0, mission_type=kind)]
        if message.name in ("MISSION_COUNT", "MISSION_CLEAR_ALL"):
            none = message.values.get("count", 0) == 0
            result = MISSION_ACCEPTED if none else MISSION_UNSUPPORTED
            return [_ack(sender, who, result, mission_type=kind)]
        return []


class Parameters:
    """Parameters of a vehicle, and the vehicle's side of the parameter protocol."""

    def __init__(self):
        self._values = dict(DEFAULTS)

    @property
    def takeoff_up_m(self) -> float:
        """Height of a take-off above home."""
        return self._values[TAKEOFF_PARAMETER]

    def answer(self, sender: Sender, message: Message) -> list[bytes]:
        """Return the answers to a message of the protocol."""
        values, names = message.values, [*self._values]
        if message.name == "PARAM_REQUEST_LIST":
            return [self._value(sender, name) for name in names]
        if message.name not in ("PARAM_REQUEST_READ", "PARAM_SET"):
            return []
        name, index = values["param_id"], values.get("param_index", -1)
        if 0 <= index < len(names):
            name = names[index]
        frames, known = [], name in self._values
        value = values.get("param_value")
        if name == TAKEOFF_PARAMETER and value is not None and value > 0:
            self._values[name] = value
        elif value is not None or not known:
            error = READ_ONLY if known else NOT_FOUND
            fields = {"param_id": name, "param_index": index, "error": error}
            frames.append(sender.pack_to(message.sender, "PARAM_ERROR", **fields))
        # After an error, too: clients without that message expect the unchanged value.
        return [*frames, self._value(sender, name)] if known else frames

    def _value(self, sender: Sender, name: str) -> bytes:
        value = self._values[name]
        whole = isinstance(value, int)
        # Integers are sent with their bits in the field of single precision.
        bits = struct.unpack("<f", struct.pack("<i", value))[0] if whole else value
        return sender.pack(
            "PARAM_VALUE",
            param_id=name,
            param_value=bits,
            param_type=PARAM_INT if whole else PARAM_FLOAT,
            param_count=len(self._values),
            param_index=[*self._values].index(name),
        )


def _ack(
    sender: Sender, who: tuple[int, int], result: int, mission_type: int = FLIGHT_PLAN
) -> bytes:
    return sender.pack_to(who, "MISSION_ACK", type=result, mission_type=mission_type)


def item_fields(item: Item, sequence: int) -> dict[str, Any]:
    """Return the fields of MISSION_ITEM_INT of an item."""
    # NaN is MAVLink's code for an unspecified parameter.
    params = [math.nan if value is None else value for value in item.params]
    lat, lon, alt = (0.0 if math.isnan(value) else value for value in params[4:])
    scale = 1 if item.frame == MISSION else 1e7
    return {
        "seq": sequence,
        "frame": FRAME_CODES.get(item.frame, item.frame),
        "command": item.command,
        "current": int(sequence == 0),
        "autocontinue": int(item.auto_continue),
        **{f"param{n + 1}": params[n] for n in range(4)},
        "x": round(scale * lat),
        "y": round(scale * lon),
        "z": alt,
    }


def item_of(fields: dict[str, Any]) -> Item:
    """Return the item of a MISSION_ITEM_INT.

    Raises:
        InputError: As in `checked_item`.
    """
    command, frame = fields["command"], fields["frame"]
    # Without a position both are parameters, which have no scale.
    scale = 1 if frame == MISSION else 1e7
    lat, lon = fields["x"] / scale, fields["y"] / scale
    params = [*(fields[f"param{n}"] for n in range(1, 5)), lat, lon, fields["z"]]
    return checked_item(
        UPLOADED, fields["seq"], command, frame, params, bool(fields["autocontinue"])
    )
