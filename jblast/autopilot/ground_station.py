"""Vehicle for a ground station: telemetry and the mission protocol.

The vehicle waits for a command to arm or to start its mission. The flight is then
computed as a whole and sent row by row at the pace of the wall clock.

Constants of telemetry are those of MAVLink's common.xml: MAV_TYPE_QUADROTOR,
MAV_AUTOPILOT_PX4, and PX4's modes of the main mode AUTO (px4_custom_mode.h).

The mission protocol is mavlink.io/en/services/mission.html, from the vehicle's side. To
upload, a station sends the number of items, which the vehicle then requests one by one.
An item out of sequence is ignored and the right one requested again. An item that does
not arrive within `RETRY_S` is requested again, up to `RETRIES` times. An invalid
mission is rejected as a whole, and the previous one remains.
"""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from jblast.autopilot.logs import (
    FlightRecord,
    down,
    euler,
    right,
    scalar_first,
    stamped,
)
from jblast.autopilot.mavlink import Link, LinkLost, Message, Sender
from jblast.errors import InputError
from jblast.missions.plan import MISSION, Item, Plan, checked_item
from jblast.scene import Place

ARM, START = 400, 300
"""MAV_CMD_COMPONENT_ARM_DISARM and MAV_CMD_MISSION_START."""
ACCEPTED, REFUSED, DENIED, UNSUPPORTED, IN_PROGRESS = 0, 1, 2, 3, 5
"""MAV_RESULT; REFUSED is TEMPORARILY_REJECTED."""
WARNING = 4
"""MAV_SEVERITY."""
# As sent by PX4: MAV_COMP_ID_AUTOPILOT1 of the first vehicle.
SYSTEM, COMPONENT = 1, 1
# MAV_TYPE and MAV_AUTOPILOT
QUADROTOR, PX4 = 2, 12
CUSTOM, GUIDED, SAFETY_ARMED = 1, 8, 128
"""Bits of the base mode."""
MODE_MISSION, MODE_LOITER = 4 << 16 | 4 << 24, 4 << 16 | 3 << 24
"""PX4's custom modes: main mode AUTO in the third byte, its sub-mode in the fourth."""
STANDBY, ACTIVE = 3, 4
"""MAV_STATE."""
TELEMETRY_STEP_S = 0.1
"""Interval between two rows of telemetry: 10 Hz, as usual over a radio link."""
HEARTBEAT_S = 1.0
"""Interval between two heartbeats: the protocol's rate."""
RETRY_S, RETRIES = 1.5, 5
"""Timeout and number of retries recommended by the protocol."""
MAX_ITEMS = 1000
"""Maximum number of items of an uploaded mission; declared, above any autopilot's."""
MISSION_ACCEPTED, ERROR, MISSION_UNSUPPORTED, NO_SPACE, INVALID, SEQUENCE = (
    0,
    1,
    3,
    4,
    5,
    13,
)
"""MAV_MISSION_RESULT."""
FLIGHT_PLAN = 0
"""MAV_MISSION_TYPE of a mission; geofences and rally points have other numbers."""
UPLOADED = "uploaded mission"


@dataclass
class ServiceResult:
    """Result of serving a ground station.

    Attributes:
        flights: Number of flights.
        ended: Reason of the end.
    """

    flights: int = 0
    ended: str = ""


class Missions:
    """Mission of a vehicle, and the vehicle's side of the mission protocol.

    Attributes:
        plan: Current mission; None: no mission.

    Args:
        plan: Initial mission.
        home: Position of the vehicle.
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
        self.plan = plan
        self._home, self._check, self._report_text = home, check, report_text
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
        values, who = message.values, (message.system, message.component)
        if values.get("mission_type", FLIGHT_PLAN) != FLIGHT_PLAN:
            return self._other(sender, message)
        if message.name == "MISSION_REQUEST_LIST":
            return [_to(sender, who, "MISSION_COUNT", count=len(self.items))]
        if message.name in ("MISSION_REQUEST_INT", "MISSION_REQUEST"):
            return [self._item(sender, who, values["seq"])]
        if message.name == "MISSION_CLEAR_ALL":
            self.plan, self._items = None, None
            return [_ack(sender, who, MISSION_ACCEPTED)]
        if message.name == "MISSION_COUNT":
            return self._begin(sender, who, values["count"], now_s)
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
        # An upload without items clears the mission.
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
            plan = Plan(items=tuple(items), home=self._home, source=UPLOADED)
            self._check(plan)
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
        return _to(sender, self._from, "MISSION_REQUEST_INT", seq=sequence)

    def _item(self, sender: Sender, who: tuple[int, int], sequence: int) -> bytes:
        if sequence >= len(self.items):
            return _ack(sender, who, SEQUENCE)
        fields = item_fields(self.items[sequence], sequence)
        return _to(sender, who, "MISSION_ITEM_INT", **fields)

    def _other(self, sender: Sender, message: Message) -> list[bytes]:
        """Answer for geofences and rally points: none exist and none are accepted."""
        who, kind = (
            (message.system, message.component),
            message.values["mission_type"],
        )
        if message.name == "MISSION_REQUEST_LIST":
            return [_to(sender, who, "MISSION_COUNT", count=0, mission_type=kind)]
        if message.name in ("MISSION_COUNT", "MISSION_CLEAR_ALL"):
            none = message.values.get("count", 0) == 0
            result = MISSION_ACCEPTED if none else MISSION_UNSUPPORTED
            return [_ack(sender, who, result, mission_type=kind)]
        return []


class GroundStation:
    """Service of a vehicle for a ground station over a link.

    Args:
        link: Link to the ground station.
        standing: Record of the vehicle at rest.
        missions: Mission of the vehicle.
        fly: Simulates a plan; None: position control at the target.
        speed: Flight time per wall-clock time [-].
    """

    def __init__(
        self,
        link: Link,
        standing: FlightRecord,
        missions: Missions,
        fly: Callable[[Plan | None], FlightRecord],
        speed: float = 1.0,
    ):
        self.missions, self._link, self._fly, self._speed = missions, link, fly, speed
        self._sender = Sender(SYSTEM, COMPONENT)
        self._telemetry, self._begun_s = Telemetry(standing), None
        self._item = -1
        self.watched = ServiceResult()

    def report_text(self, text: str) -> None:
        """Send a text for the operator, cut to the 50 characters of STATUSTEXT."""
        if self._link.connected:
            frame = self._sender.pack("STATUSTEXT", severity=WARNING, text=text[:50])
            self._link.send(frame)

    def serve(self, seconds: float | None = None) -> ServiceResult:
        """Serve until the ground station disconnects or the time is over.

        Args:
            seconds: Wall-clock time; None: no end.
        """
        begin = time.monotonic()
        beat = reported = -1e9
        try:
            while seconds is None or time.monotonic() - begin < seconds:
                now = time.monotonic()
                if self._link.address.kind == "tcp" and not self._link.accept(
                    TELEMETRY_STEP_S
                ):
                    continue
                # A fifth of the telemetry step: the loop stays responsive without busy
                # waiting.
                message = self._link.receive(TELEMETRY_STEP_S / 5)
                frames = self.missions.remind(self._sender, now)
                if message is not None:
                    frames += self._answer(message, now)
                if now - beat >= HEARTBEAT_S:
                    beat = now
                    frames.append(self._beat(now))
                if now - reported >= TELEMETRY_STEP_S / max(self._speed, 1.0):
                    reported = now
                    frames += self._rows(now)
                if frames and self._link.connected:
                    self._link.send(*frames)
            self.watched.ended = "the time is over"
        except LinkLost as end:
            self.watched.ended = str(end)
        except InputError as error:
            self.watched.ended = str(error)
        except KeyboardInterrupt:
            self.watched.ended = "interrupted"
        return self.watched

    def _row(self, now: float) -> int:
        begun = self._begun_s
        return self._telemetry.row_at(
            0.0 if begun is None else self._speed * (now - begun)
        )

    def _beat(self, now: float) -> bytes:
        has_mission = self.missions.plan is not None
        armed = self._begun_s is not None and self._telemetry.armed(self._row(now))
        return heartbeat(self._sender, armed=armed, has_mission=has_mission)

    def _rows(self, now: float) -> list[bytes]:
        row = self._row(now)
        frames = self._telemetry.frames(self._sender, row)
        item = self._telemetry.item(row)
        if self._begun_s is not None and item != self._item:
            if self._item >= 0:
                reached = self._sender.pack("MISSION_ITEM_REACHED", seq=self._item)
                frames.append(reached)
            frames.append(self._sender.pack("MISSION_CURRENT", seq=item))
            self._item = item
        return frames

    def _answer(self, message: Message, now: float) -> list[bytes]:
        if message.name.startswith("MISSION_"):
            return self.missions.answer(self._sender, message, now)
        if message.name != "COMMAND_LONG":
            return []
        values = message.values
        command = values["command"]
        if command not in (ARM, START):
            return [self._ack(command, UNSUPPORTED)]
        if command == ARM and values["param1"] != 1:
            # Disarming in flight would stop the rotors.
            return [self._ack(command, DENIED if self._flies(now) else ACCEPTED)]
        if self._flies(now):
            return [self._ack(command, REFUSED)]
        # Computing a flight takes seconds, and stations repeat a command without an
        # answer.
        self._link.send(self._ack(command, IN_PROGRESS))
        try:
            record = self._fly(self.missions.plan)
        except InputError as error:
            self.report_text(str(error))
            return [self._ack(command, DENIED)]
        self._telemetry, self._begun_s = Telemetry(record), time.monotonic()
        self._item = -1
        self.watched.flights += 1
        return [self._ack(command, ACCEPTED)]

    def _flies(self, now: float) -> bool:
        if self._begun_s is None:
            return False
        return self._row(now) < self._telemetry.record.time_s.size - 1

    def _ack(self, command: int, result: int) -> bytes:
        return self._sender.pack("COMMAND_ACK", command=command, result=result)


def heartbeat(sender: Sender, *, armed: bool, has_mission: bool) -> bytes:
    """Return the heartbeat of the vehicle."""
    return sender.pack(
        "HEARTBEAT",
        type=QUADROTOR,
        autopilot=PX4,
        base_mode=CUSTOM | GUIDED | (SAFETY_ARMED if armed else 0),
        custom_mode=MODE_MISSION if has_mission else MODE_LOITER,
        system_status=ACTIVE if armed else STANDBY,
        mavlink_version=3,
    )


class Telemetry:
    """Telemetry messages of a flight's rows.

    Args:
        record: The flight; messages have its estimated state.
    """

    def __init__(self, record: FlightRecord):
        self.record = record
        state = record.estimated
        self._angles = euler(scalar_first(state.quaternion))
        self._rates = right(record.body_rate_rad_s)
        self._places = record.geodetic(state.position_m)
        self._ups = state.position_m[:, 2] - state.position_m[0, 2]
        self._moves = down(state.velocity_m_s)

    def row_at(self, time_s: float) -> int:
        """Return the last row up to a time."""
        # 1e-9 s for the rounding of a product of speed and clock time.
        after = np.searchsorted(self.record.time_s, time_s + 1e-9, side="right")
        return int(np.clip(after - 1, 0, self.record.time_s.size - 1))

    def frames(self, sender: Sender, row: int) -> list[bytes]:
        """Return ATTITUDE and GLOBAL_POSITION_INT of a row."""
        boot = round(1e3 * float(self.record.time_s[row]))
        angles, rates = self._angles[row].tolist(), self._rates[row].tolist()
        names = ("roll", "pitch", "yaw", "rollspeed", "pitchspeed", "yawspeed")
        attitude = dict(zip(names, [*angles, *rates], strict=True))
        lat, lon, alt = self._places[row]
        heading = round(100 * float(np.degrees(angles[2]) % 360)) % 36_000
        # Integer centimetres per second, north, east, down, in 16 bits.
        moves = np.clip(np.round(100 * self._moves[row]), -32_767, 32_767).astype(int)
        return [
            sender.pack("ATTITUDE", time_boot_ms=boot, **attitude),
            sender.pack(
                "GLOBAL_POSITION_INT",
                time_boot_ms=boot,
                lat=round(1e7 * lat),
                lon=round(1e7 * lon),
                alt=round(1e3 * alt),
                relative_alt=round(1e3 * float(self._ups[row])),
                hdg=heading,
                **dict(zip(("vx", "vy", "vz"), moves.tolist(), strict=True)),
            ),
        ]

    def item(self, row: int) -> int:
        """Return the number of the current mission item."""
        return int(self.record.item[row])

    def armed(self, row: int) -> bool:
        """Return whether the vehicle is armed."""
        return bool(self.record.armed[row])


def telemetry_log(record: FlightRecord, *, has_mission: bool) -> bytes:
    """Return the telemetry of a whole flight as the bytes of a .tlog."""
    found: list[bytes] = []
    sender, telemetry = Sender(SYSTEM, COMPONENT), Telemetry(record)
    beats, item = -np.inf, -1
    for row in record.rows_each(TELEMETRY_STEP_S).tolist():
        time_s = float(record.time_s[row])
        if time_s - beats >= HEARTBEAT_S - 1e-9:
            armed = telemetry.armed(row)
            frame = heartbeat(sender, armed=armed, has_mission=has_mission)
            found.append(stamped(time_s, frame))
            beats = time_s
        frames = telemetry.frames(sender, row)
        found += [stamped(time_s, frame) for frame in frames]
        if has_mission and telemetry.item(row) != item:
            item = telemetry.item(row)
            found.append(stamped(time_s, sender.pack("MISSION_CURRENT", seq=item)))
    return b"".join(found)


def _to(sender: Sender, who: tuple[int, int], name: str, **fields: object) -> bytes:
    return sender.pack(name, target_system=who[0], target_component=who[1], **fields)


def _ack(
    sender: Sender, who: tuple[int, int], result: int, mission_type: int = FLIGHT_PLAN
) -> bytes:
    return _to(sender, who, "MISSION_ACK", type=result, mission_type=mission_type)


def item_fields(item: Item, sequence: int) -> dict[str, Any]:
    """Return the fields of MISSION_ITEM_INT of an item."""
    # NaN is MAVLink's code for an unspecified parameter.
    params = [math.nan if value is None else value for value in item.params]
    lat, lon, alt = (0.0 if math.isnan(value) else value for value in params[4:])
    scale = 1 if item.frame == MISSION else 1e7
    return {
        "seq": sequence,
        "frame": item.frame,
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
