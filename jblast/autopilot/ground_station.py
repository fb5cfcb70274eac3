"""A vehicle on a ground station's screen: telemetry and the mission protocol.

The vehicle stands until a command to arm or to begin its mission. The flight is then
computed whole and sent row by row at the pace of the wall clock.

Numbers of telemetry are those of MAVLink's common.xml: MAV_TYPE_QUADROTOR,
MAV_AUTOPILOT_PX4, and PX4's modes of the main mode AUTO (px4_custom_mode.h).

The mission protocol is mavlink.io/en/services/mission.html, from the vehicle's side: a
station that uploads sends the number of items, which are then requested one by one. An
item out of turn is ignored and the right one requested again, as is one that does not
arrive within `RETRY_S`, up to `RETRIES` times. A mission that cannot be flown is
rejected as a whole, and the previous one remains.
"""

import math
import time
from collections.abc import Callable, Iterator, Sequence
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
from jblast.missions.plan import COMMANDS, Item, Plan, checked_item
from jblast.scene import Place

ARM, START = 400, 300
"""MAV_CMD_COMPONENT_ARM_DISARM and MAV_CMD_MISSION_START."""
ACCEPTED, REFUSED, DENIED, UNSUPPORTED, IN_PROGRESS = 0, 1, 2, 3, 5
"""MAV_RESULT; REFUSED is TEMPORARILY_REJECTED."""
WARNING = 4
"""MAV_SEVERITY."""
# as PX4 sends: MAV_COMP_ID_AUTOPILOT1 of the first vehicle
SYSTEM, COMPONENT = 1, 1
# MAV_TYPE and MAV_AUTOPILOT
QUADROTOR, PX4 = 2, 12
CUSTOM, GUIDED, SAFETY_ARMED = 1, 8, 128
"""Bits of the base mode."""
MODE_MISSION, MODE_LOITER = 4 << 16 | 4 << 24, 4 << 16 | 3 << 24
"""PX4's custom modes: main mode AUTO in the third byte, its sub-mode in the fourth."""
STANDBY, ACTIVE = 3, 4
"""MAV_STATE."""
EACH_S = 0.1
"""Between two rows of telemetry."""
HEARTBEAT_S = 1.0
"""Between two heartbeats: the protocol's rate."""
RETRY_S, RETRIES = 1.5, 5
"""As the protocol recommends."""
MOST_ITEMS = 1000
"""Of an uploaded mission; declared."""
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
"""MAV_MISSION_TYPE; fences and rally points are others."""
WHOLE_FRAMES = {5: 0, 6: 3}
"""Frames whose places are whole numbers, and the frames that they are."""
UPLOADED = "uploaded mission"


@dataclass
class Watched:
    """What a ground station was served.

    Attributes:
        flights: How many were flown.
        ended: Why it ended.
    """

    flights: int = 0
    ended: str = ""


class Missions:
    """The mission that a vehicle holds.

    Attributes:
        plan: It; None: there is none.

    Args:
        plan: What it holds at first.
        home: Where the vehicle stands.
        check: Refuses a plan that cannot be flown, by an `InputError`.
        say: Receives text for the ground station.
    """

    def __init__(
        self,
        plan: Plan | None,
        home: Place,
        check: Callable[[Plan], object],
        say: Callable[[str], object],
    ):
        self.plan = plan
        self._home, self._check, self._say = home, check, say
        self._items: list[Item] | None = None
        self._count = self._tries = 0
        self._asked_s = 0.0
        self._from = (0, 0)

    @property
    def items(self) -> tuple[Item, ...]:
        """Of the plan."""
        return () if self.plan is None else self.plan.items

    def answer(self, sender: Sender, message: Message, now_s: float) -> list[bytes]:
        """Return what is answered to a message of the protocol.

        Args:
            sender: Packs it.
            message: That came.
            now_s: On the wall clock.
        """
        said, who = message.values, (message.system, message.component)
        if said.get("mission_type", FLIGHT_PLAN) != FLIGHT_PLAN:
            return self._other(sender, message)
        if message.name == "MISSION_REQUEST_LIST":
            return [_to(sender, who, "MISSION_COUNT", count=len(self.items))]
        if message.name in ("MISSION_REQUEST_INT", "MISSION_REQUEST"):
            return [self._item(sender, who, said["seq"])]
        if message.name == "MISSION_CLEAR_ALL":
            self.plan, self._items = None, None
            return [_ack(sender, who, MISSION_ACCEPTED)]
        if message.name == "MISSION_COUNT":
            return self._begin(sender, who, said["count"], now_s)
        if message.name == "MISSION_ITEM_INT" and self._items is not None:
            return self._take(sender, message, now_s)
        if message.name == "MISSION_ITEM_INT":
            self._say("mission item: expected one that was asked for, got another")
            return [_ack(sender, who, SEQUENCE)]
        return []

    def remind(self, sender: Sender, now_s: float) -> list[bytes]:
        """Return the request of an item that did not come; after some, give up."""
        if self._items is None or now_s - self._asked_s < RETRY_S:
            return []
        self._tries += 1
        if self._tries > RETRIES:
            self._say(f"upload: item {len(self._items)} did not come, given up")
            self._items = None
            return [_ack(sender, self._from, ERROR)]
        return [self._ask(sender, now_s)]

    def _begin(
        self, sender: Sender, who: tuple[int, int], count: int, now_s: float
    ) -> list[bytes]:
        if count > MOST_ITEMS:
            self._say(f"upload: expected at most {MOST_ITEMS} items, got {count}")
            return [_ack(sender, who, NO_SPACE)]
        if count == 0:
            self.plan, self._items = None, None
            return [_ack(sender, who, MISSION_ACCEPTED)]
        self._items, self._count, self._from, self._tries = [], count, who, 0
        return [self._ask(sender, now_s)]

    def _take(self, sender: Sender, message: Message, now_s: float) -> list[bytes]:
        items = self._items
        assert items is not None
        if message.values["seq"] != len(items):
            return [self._ask(sender, now_s)]
        try:
            items.append(item_of(message.values))
            if len(items) < self._count:
                self._tries = 0
                return [self._ask(sender, now_s)]
            plan = plan_of(items, self._home)
            self._check(plan)
        except InputError as error:
            self._say(str(error))
            whole, self._items = len(items) == self._count, None
            return [_ack(sender, self._from, INVALID if whole else MISSION_UNSUPPORTED)]
        self.plan, self._items = plan, None
        return [_ack(sender, self._from, MISSION_ACCEPTED)]

    def _ask(self, sender: Sender, now_s: float) -> bytes:
        self._asked_s = now_s
        sequence = len(self._items or [])
        return _to(sender, self._from, "MISSION_REQUEST_INT", seq=sequence)

    def _item(self, sender: Sender, who: tuple[int, int], sequence: int) -> bytes:
        if sequence >= len(self.items):
            return _ack(sender, who, SEQUENCE)
        fields = item_fields(self.items[sequence], sequence)
        return _to(sender, who, "MISSION_ITEM_INT", **fields)

    def _other(self, sender: Sender, message: Message) -> list[bytes]:
        """Answer for fences and rally points: there are none, and none are taken."""
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
    """A vehicle at one end of a link, a ground station at the other.

    Args:
        link: To the ground station.
        standing: The vehicle as it stands.
        missions: What it is to fly.
        fly: Flies a plan; without one it holds its place.
        speed: Seconds of flight a second of the wall clock.
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
        self.watched = Watched()

    def say(self, text: str) -> None:
        """Send a sentence to be read; what is past 50 letters is cut off there."""
        if self._link.connected:
            frame = self._sender.pack("STATUSTEXT", severity=WARNING, text=text[:50])
            self._link.send(frame)

    def serve(self, seconds: float | None = None) -> Watched:
        """Serve until the ground station hangs up, or for some time.

        Args:
            seconds: Of the wall clock; None: no end.
        """
        begin = time.monotonic()
        beat = reported = -1e9
        try:
            while seconds is None or time.monotonic() - begin < seconds:
                now = time.monotonic()
                if self._link.address.kind == "tcp" and not self._link.accept(EACH_S):
                    continue
                message = self._link.receive(EACH_S / 5)
                frames = self.missions.remind(self._sender, now)
                if message is not None:
                    frames += self._answer(message, now)
                if now - beat >= HEARTBEAT_S:
                    beat = now
                    frames.append(self._beat(now))
                if now - reported >= EACH_S / max(self._speed, 1.0):
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
        said = message.values
        command = said["command"]
        if command not in (ARM, START):
            return [self._ack(command, UNSUPPORTED)]
        if command == ARM and said["param1"] != 1:
            # in flight nobody stops the rotors
            return [self._ack(command, DENIED if self._flies(now) else ACCEPTED)]
        if self._flies(now):
            return [self._ack(command, REFUSED)]
        self._link.send(self._ack(command, IN_PROGRESS))
        try:
            record = self._fly(self.missions.plan)
        except InputError as error:
            self.say(str(error))
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
    """The messages of a flight's rows.

    Args:
        record: The flight, by the state that the vehicle estimates.
    """

    def __init__(self, record: FlightRecord):
        self.record = record
        believed = record.believed
        self._angles = euler(scalar_first(believed.quaternion))
        self._rates = right(record.body_rate_rad_s)
        self._places = record.geodetic(believed.position_m)
        self._ups = believed.position_m[:, 2] - believed.position_m[0, 2]
        self._moves = down(believed.velocity_m_s)

    def row_at(self, time_s: float) -> int:
        """Return the last row at a time."""
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
        # whole centimetres a second, north, east, down, in 16 bits
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
        """Return the number of the item that it is on the way to."""
        return int(self.record.item[row])

    def armed(self, row: int) -> bool:
        """Return whether it is armed."""
        return bool(self.record.armed[row])


def telemetry_log(record: FlightRecord, *, has_mission: bool) -> bytes:
    """Return the telemetry of a whole flight as the bytes of a .tlog."""
    return b"".join(_stamped_frames(record, has_mission))


def _stamped_frames(record: FlightRecord, has_mission: bool) -> Iterator[bytes]:
    sender, telemetry = Sender(SYSTEM, COMPONENT), Telemetry(record)
    beats, item = -np.inf, -1
    for row in record.rows_each(EACH_S).tolist():
        time_s = float(record.time_s[row])
        if time_s - beats >= HEARTBEAT_S - 1e-9:
            armed = telemetry.armed(row)
            frame = heartbeat(sender, armed=armed, has_mission=has_mission)
            yield stamped(time_s, frame)
            beats = time_s
        for frame in telemetry.frames(sender, row):
            yield stamped(time_s, frame)
        if has_mission and telemetry.item(row) != item:
            item = telemetry.item(row)
            yield stamped(time_s, sender.pack("MISSION_CURRENT", seq=item))


def _to(sender: Sender, who: tuple[int, int], name: str, **fields: object) -> bytes:
    return sender.pack(name, target_system=who[0], target_component=who[1], **fields)


def _ack(
    sender: Sender, who: tuple[int, int], result: int, mission_type: int = FLIGHT_PLAN
) -> bytes:
    return _to(sender, who, "MISSION_ACK", type=result, mission_type=mission_type)


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
    """Return the item of a MISSION_ITEM_INT.

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
