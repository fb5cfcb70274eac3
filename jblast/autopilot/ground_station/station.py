"""A vehicle on a ground station's screen: it says where it is, and does as it is told.

It stands until it is told to arm or to begin its mission; the flight is then computed
whole, and told row by row by the wall clock.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass

from jblast.autopilot.ground_station.missions import Missions
from jblast.autopilot.ground_station.telemetry import (
    COMPONENT,
    EACH_S,
    HEARTBEAT_S,
    SYSTEM,
    Telemetry,
    heartbeat,
)
from jblast.autopilot.logs.record import FlightRecord
from jblast.autopilot.mavlink.link import Link, LinkLost
from jblast.autopilot.mavlink.wire import Message, Sender
from jblast.errors import InputError
from jblast.missions.plan.item import Plan

ARM, START = 400, 300
"""MAV_CMD_COMPONENT_ARM_DISARM and MAV_CMD_MISSION_START."""
ACCEPTED, REFUSED, DENIED, UNSUPPORTED, IN_PROGRESS = 0, 1, 2, 3, 5
"""MAV_RESULT; REFUSED is TEMPORARILY_REJECTED."""
WARNING = 4
"""MAV_SEVERITY."""


@dataclass
class Watched:
    """What a ground station was served.

    Attributes:
        flights: How many were flown.
        ended: Why it ended.
    """

    flights: int = 0
    ended: str = ""


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
