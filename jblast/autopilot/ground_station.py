"""Vehicle for a ground station: commands, modes, parameters and the mission protocol.

The vehicle behaves as PX4 in its automatic modes: it is armed, takes off, flies its
mission, pauses, returns and lands by command. Each flight is computed as a whole, in a
thread of its own, and sent row by row at the pace of the wall clock. Its clock stops
while a flight is computed. A command in flight computes the flight again, from the
take-off, with another end from the present position on (`Course`).

The mission protocol is mavlink.io/en/services/mission.html, from the vehicle's side. To
upload, a station sends the number of items, which the vehicle then requests one by one.
An item out of sequence is ignored and the right one requested again. An item that does
not arrive within `RETRY_S` is requested again, up to `RETRIES` times. An invalid
mission is rejected as a whole, and the previous one remains.
"""

import math
import struct
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from jblast.autopilot.logs import FlightRecord
from jblast.autopilot.mavlink import Link, LinkLost, Message, Sender, message_name
from jblast.autopilot.telemetry import (
    AUTO,
    CAPABILITIES,
    COMPLETE,
    COMPONENT,
    FLOWN,
    HEARTBEAT_S,
    MODE_HOLD,
    MODE_LAND,
    MODE_MISSION,
    MODE_RETURN,
    MODE_TAKEOFF,
    NO_MISSION,
    NOT_STARTED,
    PAUSED,
    STREAMS,
    SYSTEM,
    TELEMETRY_STEP_S,
    Telemetry,
    VehicleStatus,
    heartbeat,
)
from jblast.errors import InputError
from jblast.missions.mission import Limits
from jblast.missions.plan import (
    GLOBAL,
    INTEGER_FRAMES,
    JUMP,
    LAND,
    LOITER,
    LOITER_TIME,
    MISSION,
    RELATIVE,
    RETURN,
    SPEED,
    TAKEOFF,
    WAYPOINT,
    Item,
    Plan,
    checked_item,
)
from jblast.scene import Place

# MAV_CMD, besides those of missions.
SET_MODE, REPOSITION, PAUSE_CONTINUE, SET_ITEM = 176, 192, 193, 224
START, ARM, GET_HOME = 300, 400, 410
GET_INTERVAL, SET_INTERVAL, REQUEST, CAPABILITIES_REQUEST = 510, 511, 512, 520
MODES = {
    TAKEOFF: MODE_TAKEOFF,
    LAND: MODE_LAND,
    RETURN: MODE_RETURN,
    LOITER: MODE_HOLD,
    START: MODE_MISSION,
}
"""Mode of each command that sets one."""
ACCEPTED, REFUSED, DENIED, UNSUPPORTED, IN_PROGRESS = 0, 1, 2, 3, 5
"""MAV_RESULT; REFUSED is TEMPORARILY_REJECTED."""
WARNING = 4
"""MAV_SEVERITY."""
INSERTED = -1
"""Number of an item that is not part of the mission."""
HOVER_S = 2.0
"""Time of hover at the end of a flight in the air, in which the vehicle comes to rest;
the landing that follows in the computed flight is not shown."""
REPLAY_S = 5.0
"""Largest shift of time between two computations of a flight, declared: their paths are
equal up to the command, but for the speed at the last corner before it."""
NOT_FOUND, READ_ONLY = 1, 5
"""MAV_PARAM_ERROR."""
PARAM_FLOAT, PARAM_INT = 9, 6
"""MAV_PARAM_TYPE: single precision, and integers of 32 bits."""
TAKEOFF_PARAMETER = "MIS_TAKEOFF_ALT"
DEFAULTS: dict[str, float | int] = {
    "MAV_SYS_ID": SYSTEM,
    TAKEOFF_PARAMETER: 2.5,
    "MPC_ACC_HOR": Limits().acceleration_m_s2,
    "MPC_LAND_ALT2": Limits().slow_below_m,
    "MPC_LAND_SPEED": Limits().landing_m_s,
    "MPC_XY_CRUISE": Limits().speed_m_s,
    "MPC_Z_V_AUTO_DN": Limits().descent_m_s,
    "MPC_Z_V_AUTO_UP": Limits().climb_m_s,
    "RTL_RETURN_ALT": Limits().return_m,
}
"""Parameters by PX4's names. The height of a take-off [m], PX4's default, is settable;
the others are those of missions."""
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


class Course(NamedTuple):
    """Items of a flight, from the take-off.

    Attributes:
        items: The items.
        numbers: Number of each item in the mission, or `INSERTED`.
    """

    items: tuple[Item, ...] = ()
    numbers: tuple[int, ...] = ()

    def then(self, items: Sequence[Item], first: int | None = None) -> "Course":
        """Return the course with additional items.

        Args:
            items: The items.
            first: Number of the first one in the mission; None: inserted items.
        """
        count = range(len(items))
        numbers = [INSERTED if first is None else first + n for n in count]
        return Course((*self.items, *items), (*self.numbers, *numbers))

    def plan(self, mission: Plan | None) -> Plan:
        """Return the course as a plan that starts and ends on the ground.

        Args:
            mission: Mission with home and cruise speed; None: no mission.
        """
        items = list(self.items)
        if self.hovers:
            # A loiter without end would end the plan: the landing follows a hover.
            hover = (HOVER_S, 0.0, 0.0, None, None, None, None)
            if items[-1].command == LOITER:
                hover = (HOVER_S, 0.0, 0.0, None, *items.pop().params[4:])
            frame = self.items[-1].frame
            items.append(Item(INSERTED, LOITER_TIME, frame, hover))
            items.append(_inserted(LAND))
        return replace(mission or Plan(()), items=tuple(items))

    @property
    def hovers(self) -> bool:
        """True if the course ends in the air."""
        return bool(self.items) and self.items[-1].command not in (LAND, RETURN)


def course_of(
    plan: Plan,
    begin: Course | None = None,
    first: int = 0,
    up_m: float | None = None,
) -> Course:
    """Return the course of a mission, with a take-off if the plan has none.

    Args:
        plan: The mission.
        begin: Course flown before; None: from the ground.
        first: Index of the first item to fly.
        up_m: Height of an added take-off above home; None: the default.

    Raises:
        InputError: The mission has jumps and does not start from its first item.
    """
    begin, items = Course() if begin is None else begin, plan.items
    if first > 0 and any(item.command == JUMP for item in items):
        raise InputError(
            "expected item 0 first, as the mission has jumps, got item "
            f"{first}: start it from the ground"
        )
    moving = [item.command for item in items[first:] if item.command != SPEED]
    if not begin.items and moving and moving[0] != TAKEOFF:
        up = DEFAULTS[TAKEOFF_PARAMETER] if up_m is None else up_m
        begin = begin.then([_inserted(TAKEOFF, up)])
    speeds = [item for item in items[:first] if item.command == SPEED]
    return begin.then(speeds[-1:]).then(items[first:], first)


class Job:
    """Computation of a flight in a thread, for a command that waits for its answer.

    Attributes:
        command: MAV_CMD.
        course: Course of the flight.
        mission: Mission of the vehicle; None: no mission.
        mode: Mode in the flight.
        record: The flight; None: not finished, or `error`.
        error: Reason for no flight.

    Args:
        command: As above.
        system: MAVLink system of the command's sender.
        component: MAVLink component of the command's sender.
    """

    def __init__(self, command: int, system: int, component: int):
        self.command, self._who = command, (system, component)
        self.course, self.mode = Course(), MODE_HOLD
        self.mission: Plan | None = None
        self.record: FlightRecord | None = None
        self.error: Exception | None = None
        self._thread: threading.Thread | None = None

    @property
    def sets_mode(self) -> bool:
        """True if the command is accepted before its flight is computed, as by PX4."""
        return self.command == SET_MODE

    @property
    def running(self) -> bool:
        """True until the flight is computed."""
        return self._thread is not None and self._thread.is_alive()

    def begin(self, fly: Callable[[], FlightRecord]) -> None:
        """Start the computation."""

        def run() -> None:
            try:
                self.record = fly()
            except Exception as error:  # raised again by the thread of the link
                self.error = error

        self._thread = threading.Thread(target=run)
        self._thread.start()

    def acks(self, sender: Sender, result: int) -> list[bytes]:
        """Return the acknowledgement of the command."""
        fields = {"command": self.command, "result": result}
        return [_to(sender, self._who, "COMMAND_ACK", **fields)]


class GroundStation:
    """Service of a vehicle for a ground station over a link.

    Attributes:
        missions: Mission of the vehicle.
        watched: Result of the service.

    Args:
        link: Link to the ground station.
        standing: Record of the vehicle at rest.
        missions: As above.
        fly: Simulates a plan; None: position control at the target.
        speed: Flight time per wall-clock time [-].
        hovers: True if arming without a mission starts the position control.
    """

    def __init__(
        self,
        link: Link,
        standing: FlightRecord,
        missions: Missions,
        fly: Callable[[Plan | None], FlightRecord],
        speed: float = 1.0,
        *,
        hovers: bool = True,
    ):
        self.missions, self._link, self._fly, self._speed = missions, link, fly, speed
        self._sender, self._hovers = Sender(SYSTEM, COMPONENT), hovers
        self._telemetry = self._standing = Telemetry(standing)
        self._parameters = dict(DEFAULTS)
        self._intervals, self._sent = dict(STREAMS), dict.fromkeys(STREAMS, -1e9)
        # The mode set by the client or by a flight; None: the initial mode.
        self._chosen: int | None = None
        self._initial = MODE_HOLD if missions.plan is None else MODE_MISSION
        self._course, self._flown, self._armed = Course(), False, False
        # Flight time at the wall-clock time `_since_s`; None: the clock is stopped.
        self._time_s, self._since_s = 0.0, None
        self._item, self._reached = 0, -1
        self._flown_plan: Plan | None = None
        self._job: Job | None = None
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
        beat = -1e9
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
                # Before new commands: "in progress" is sent ahead of the result.
                frames = self._finish_job()
                frames += self.missions.remind(self._sender, now)
                if message is not None:
                    frames += self.answer(message, now)
                if now - beat >= HEARTBEAT_S:
                    beat = now
                    frames.append(self._beat())
                    if self._job is not None and not self._job.sets_mode:
                        # Clients extend their timeout with each of these.
                        frames += self._job.acks(self._sender, IN_PROGRESS)
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

    @property
    def mode(self) -> int:
        """PX4's sub-mode of AUTO."""
        if self._job is not None and self._job.sets_mode:
            return self._job.mode
        return self._initial if self._chosen is None else self._chosen

    @property
    def armed(self) -> bool:
        """True if the vehicle is armed, from the accepted command on."""
        if not self._flown:
            return self._armed
        return bool(self._telemetry.record.armed[self._row() :].any())

    def answer(self, message: Message, now: float) -> list[bytes]:
        """Return the answers to a message.

        Args:
            message: Received message.
            now: Time on the wall clock [s].
        """
        name, values = message.name, message.values
        # Messages for other vehicles or components, such as cameras, have no answer.
        if values.get("target_system", 0) not in (0, SYSTEM):
            return []
        if values.get("target_component", 0) not in (0, COMPONENT):
            return []
        if name == "MISSION_SET_CURRENT":
            self._set_item(values["seq"])
            return [self._stream("MISSION_CURRENT")]
        if name.startswith("MISSION_"):
            plan = self.missions.plan
            frames = self.missions.answer(self._sender, message, now)
            if self.missions.plan is not plan:
                self._item, self._reached = 0, -1
            return frames
        if name.startswith("PARAM_"):
            return self._parameter(message)
        if name == "TIMESYNC" and values["tc1"] == 0:
            nanoseconds = time.monotonic_ns()
            return [
                self._sender.pack("TIMESYNC", tc1=nanoseconds, ts1=values["ts1"]),
            ]
        # Requests have no target; an answer to this vehicle has one.
        if name == "PING" and values["target_system"] == 0:
            fields = {"time_usec": values["time_usec"], "seq": values["seq"]}
            who = (message.system, message.component)
            return [_to(self._sender, who, "PING", **fields)]
        if name == "SET_MODE":
            custom = values["custom_mode"]
            job = Job(SET_MODE, message.system, message.component)
            self._change_mode(custom >> 16 & 255, custom >> 24, job)
            return []
        if name not in ("COMMAND_LONG", "COMMAND_INT"):
            return []
        command, params = values["command"], [values[f"param{n}"] for n in range(1, 5)]
        if name == "COMMAND_LONG":
            params += [values[f"param{n}"] for n in range(5, 8)]
        else:
            params += [values["x"] / 1e7, values["y"] / 1e7, values["z"]]
        job = Job(command, message.system, message.component)
        if self._job is not None and self._job.command == command != SET_MODE:
            return self._job.acks(self._sender, IN_PROGRESS)
        if command == REPOSITION:
            return job.acks(self._sender, self._go(params, values.get("frame", 0), job))
        result, frames = self._command(command, params, job)
        return [*job.acks(self._sender, result), *frames]

    def _command(
        self, command: int, params: list[float], job: "Job"
    ) -> tuple[int, list[bytes]]:
        """Return the result of a command, and further frames."""
        first, second, third = (x if math.isfinite(x) else 0.0 for x in params[:3])
        name = "HOME_POSITION"
        if command in (GET_INTERVAL, SET_INTERVAL, REQUEST):
            name = message_name(int(first))
        if command == CAPABILITIES_REQUEST:
            name = "AUTOPILOT_VERSION"
        if command in (REQUEST, CAPABILITIES_REQUEST, GET_HOME):
            if name == "AUTOPILOT_VERSION":
                frame = self._sender.pack(name, capabilities=CAPABILITIES, uid=SYSTEM)
                return ACCEPTED, [frame]
            if name == "HEARTBEAT":
                return ACCEPTED, [self._beat()]
            if name not in STREAMS:
                return UNSUPPORTED, []
            return ACCEPTED, [self._stream(name)]
        if command == GET_INTERVAL:
            interval = self._intervals.get(name)
            micro = 0 if interval is None else round(1e6 * interval)
            micro = -1 if interval == math.inf else micro
            fields = {"message_id": int(first), "interval_us": micro}
            return ACCEPTED, [self._sender.pack("MESSAGE_INTERVAL", **fields)]
        if command == SET_INTERVAL:
            if name not in STREAMS:
                return UNSUPPORTED, []
            # MAVLink: 0 is the default rate, -1 disables the message.
            interval = math.inf if second < 0 else second / 1e6
            self._intervals[name] = interval or STREAMS[name]
            return ACCEPTED, []
        if command == SET_ITEM:
            return (ACCEPTED if self._set_item(int(first)) else DENIED), []
        if command == ARM:
            return self._arm(first == 1, job), []
        if command == SET_MODE:
            return self._change_mode(int(second), int(third), job), []
        if command == PAUSE_CONTINUE:
            command = START if first == 1 else LOITER
        if command not in MODES:
            return UNSUPPORTED, []
        if command == START and not self.armed:
            # Without a mission this starts the position control, as arming does.
            if self.missions.plan is not None or not self._hovers:
                self._chosen = MODE_MISSION
            return self._arm(True, job), []
        up = None if math.isnan(params[6]) or params[6] == 0 else params[6]
        return self._change_mode(AUTO, MODES[command], job, up), []

    def _arm(self, arms: bool, job: "Job") -> int:
        """Arm, or disarm on the ground; return the result."""
        if self._job is not None:
            return REFUSED
        if not arms:
            # Disarming in flight would stop the rotors.
            in_air = self._telemetry.in_air(self._row())
            if self.armed and in_air and (self._flies() or self._course.items):
                return DENIED
            self._stand()
            return ACCEPTED
        if self.armed:
            return REFUSED if self._flies() else ACCEPTED
        self._stand()
        if self.mode == MODE_MISSION:
            return self._start(job)
        self._armed = True
        if self.missions.plan is None and self._hovers and self._chosen is None:
            return self._compute(job, Course(), None, MODE_HOLD)
        return ACCEPTED

    def _change_mode(
        self, main: int, mode: int, job: "Job", up_m: float | None = None
    ) -> int:
        """Change the mode; return the result.

        Args:
            main: PX4's main mode.
            mode: PX4's sub-mode of AUTO.
            job: Command that changes it.
            up_m: Height of a take-off above the sea; None: the parameter's height above
                home.
        """
        if self._job is not None:
            return ACCEPTED if mode == self.mode else REFUSED
        if main != AUTO or mode not in MODES.values():
            return UNSUPPORTED
        flies, in_air = self._flies(), self._telemetry.in_air(self._row())
        if not self.armed:
            if mode in (MODE_HOLD, MODE_MISSION):
                self._chosen = mode
                return ACCEPTED
            return self._deny("expected an armed vehicle, got a disarmed one")
        if mode == self.mode and flies and self._flown_plan is self.missions.plan:
            return ACCEPTED
        if mode == MODE_HOLD and self._course.hovers and not flies:
            self._chosen = mode
            return ACCEPTED
        if mode == MODE_MISSION:
            return self._start(job)
        if mode == MODE_TAKEOFF:
            if self._flown:
                return self._deny("take-off: expected a vehicle on the ground")
            home = self.missions.home
            up = self._parameters[TAKEOFF_PARAMETER]
            up = up if up_m is None else up_m - home.alt_m
            if up <= 0:
                return self._deny(f"take-off: expected more than {home.alt_m:g} m")
            course = Course().then([_inserted(TAKEOFF, up)])
            return self._compute(job, course, self.missions.plan, mode)
        if not (self._flown and in_air):
            if mode == MODE_HOLD and not self._flown:
                self._chosen = mode
                return ACCEPTED
            return self._deny("expected a vehicle in the air, got one on the ground")
        added = {MODE_LAND: [_inserted(LAND)], MODE_RETURN: [_inserted(RETURN)]}
        return self._divert(job, added.get(mode, []), mode)

    def _go(self, params: list[float], frame: int, job: "Job") -> int:
        """Fly to a position; return the result."""
        if not (self._flown and self._telemetry.in_air(self._row())):
            return self._deny("expected a vehicle in the air, got one on the ground")
        if self._job is not None:
            return REFUSED
        lat, lon, alt = (None if math.isnan(value) else value for value in params[4:])
        frame = INTEGER_FRAMES.get(frame, frame)
        goal = Item(INSERTED, WAYPOINT, frame, (0.0, 0.0, 0.0, None, lat, lon, alt))
        return self._divert(job, [goal], MODE_HOLD)

    def _start(self, job: "Job") -> int:
        """Start or continue the mission; return the result."""
        plan = self.missions.plan
        if plan is None:
            return self._deny("mission: expected an uploaded one, got none")
        first = self._item if self._item < len(plan.items) else 0
        up = self._parameters[TAKEOFF_PARAMETER]
        try:
            if not self._flown:
                course, self._reached = course_of(plan, None, first, up), first - 1
                return self._compute(job, course, plan, MODE_MISSION)
            before = self._interrupted()
            # A vehicle in the air flies past a take-off.
            first += plan.items[first].command == TAKEOFF
            return self._compute(
                job, course_of(plan, before, first), plan, MODE_MISSION
            )
        except InputError as error:
            return self._deny(str(error))

    def _divert(self, job: "Job", items: list[Item], mode: int) -> int:
        """Fly other items from the present position; return the result."""
        try:
            course = self._interrupted().then(items)
        except InputError as error:
            return self._deny(str(error), REFUSED)
        return self._compute(job, course, self.missions.plan, mode)

    def _interrupted(self) -> Course:
        """Return the course flown up to the present position, and a stop there.

        Raises:
            InputError: The vehicle is not on a straight segment in the air.
        """
        row, record = self._row(), self._telemetry.record
        n = self._telemetry.item(row)
        # After the last item it hovers, although its record goes on.
        complete = not self._flies() or n >= len(self._course.items)
        if complete and self._course.hovers:
            return self._course
        kind = self._course.items[n].command if n < len(self._course.items) else None
        if any(item.command == JUMP for item in self._course.items):
            raise InputError("expected a mission without jumps to interrupt")
        straight = (WAYPOINT, TAKEOFF, LOITER, LOITER_TIME)
        if kind not in straight or not self._telemetry.in_air(row):
            raise InputError("expected straight flight; repeat the command later")
        aim = record.position_m if record.set_point_m is None else record.set_point_m
        # The set point stops with the acceleration of missions.
        near = slice(max(row - 1, 0), row + 1)
        times = np.diff(record.time_s[near])
        speed = np.diff(aim[near], axis=0)[0] / times[0] if times.size else np.zeros(3)
        way = np.linalg.norm(speed) / (2 * Limits().acceleration_m_s2)
        lat, lon, alt = record.geodetic(aim[row] + way * speed).tolist()
        if kind == TAKEOFF and np.hypot(*speed[:2]) < 0.1:
            stop = Item(
                INSERTED, TAKEOFF, GLOBAL, (0.0, 0.0, 0.0, None, None, None, alt)
            )
        else:
            stop = Item(
                INSERTED, WAYPOINT, GLOBAL, (0.0, 0.0, 0.0, None, lat, lon, alt)
            )
            if kind == TAKEOFF:
                n += 1
        before = Course(self._course.items[:n], self._course.numbers[:n])
        return before.then([stop])

    def _deny(self, text: str, result: int = DENIED) -> int:
        self.report_text(text)
        return result

    def _set_item(self, item: int) -> bool:
        """Set the mission item to fly next; return whether it exists."""
        if self._flies() or not 0 <= item < len(self.missions.items):
            return False
        self._item, self._reached = item, item - 1
        return True

    def _compute(self, job: "Job", course: Course, plan: Plan | None, mode: int) -> int:
        """Compute a flight in a thread, with the clock stopped; return the result."""
        if self._job is not None:
            return REFUSED
        self._time_s, self._since_s = self._now_s(), None
        self._job, job.course, job.mission, job.mode = job, course, plan, mode
        whole = course.plan(plan) if course.items else None
        job.begin(lambda: self._fly(whole))
        return ACCEPTED if job.sets_mode else IN_PROGRESS

    def _finish_job(self) -> list[bytes]:
        """Start the computed flight, and return the answer to its command."""
        job = self._job
        if job is None or job.running:
            return []
        self._job = None
        if job.record is None:
            self._since_s = time.monotonic()
            if not isinstance(job.error, InputError):
                raise job.error or RuntimeError("a flight without a result")
            self.report_text(str(job.error))
            return [] if job.sets_mode else job.acks(self._sender, DENIED)
        record, course = job.record, job.course
        last = None
        if course.hovers:
            # The flight is shown until the landing that `Course.plan` adds.
            landing = len(course.plan(job.mission).items) - 1
            rows = np.flatnonzero(record.item == landing)
            last = int(rows[0]) if rows.size else None
        present = self._telemetry.record.position_m[self._row()]
        before, self._telemetry = self._time_s, Telemetry(record, last)
        if self._flown:
            shift = np.abs(record.time_s - before)
            away = np.linalg.norm(record.position_m - present, axis=1)
            # Of equally near rows the one of the same time: a hover has many.
            cost = np.where(shift <= REPLAY_S, away + 0.01 * shift, np.inf)
            self._time_s = float(record.time_s[np.argmin(cost)])
        else:
            self._time_s = 0.0
            self.watched.flights += 1
        self._course, self._flown_plan, self._flown = course, job.mission, True
        # Position control without a mission has no command of its own.
        self._chosen = job.mode if course.items else None
        self._since_s = time.monotonic()
        return [] if job.sets_mode else job.acks(self._sender, ACCEPTED)

    def _stand(self) -> None:
        """Return to the state before take-off, at the scene's position and time."""
        self._flown = self._armed = False
        self._time_s, self._since_s = 0.0, None
        self._course, self._telemetry = Course(), self._standing

    def _now_s(self) -> float:
        if self._since_s is None:
            return self._time_s
        return self._time_s + self._speed * (time.monotonic() - self._since_s)

    def _row(self) -> int:
        return self._telemetry.row_at(self._now_s()) if self._flown else 0

    def _flies(self) -> bool:
        return self._flown and self._row() < self._telemetry.last

    def _status(self) -> VehicleStatus:
        count = len(self.missions.items)
        state = PAUSED if self._reached >= 0 or self._item else NOT_STARTED
        if self._flown and self.mode == MODE_MISSION:
            state = FLOWN if self._flies() else COMPLETE
        return VehicleStatus(
            armed=self.armed,
            mode=self.mode,
            item=min(self._item, max(count - 1, 0)),
            items=count,
            mission_state=state if count else NO_MISSION,
            home=self.missions.home,
        )

    def _beat(self) -> bytes:
        return heartbeat(self._sender, armed=self.armed, mode=self.mode)

    def _stream(self, name: str) -> bytes:
        return self._telemetry.frame(self._sender, name, self._row(), self._status())

    def _rows(self, now: float) -> list[bytes]:
        """Return the periodic messages that are due, and changes of the mission."""
        frames = self._progress()
        for name, interval in self._intervals.items():
            if now - self._sent[name] >= interval / max(self._speed, 1.0):
                self._sent[name] = now
                frames.append(self._stream(name))
        return frames

    def _progress(self) -> list[bytes]:
        """Return messages about reached mission items, and follow the flight's end."""
        same = self._flown_plan is self.missions.plan
        if not (self._flown and self._course.items and same):
            return []
        ended = not self._flies()
        row = self._row()
        n = min(self._telemetry.item(row), len(self._course.items))
        passed = [*self._course.numbers[: n + ended]]
        present = [*self._course.numbers[n:]]
        number = max([one for one in passed if one >= 0], default=self._reached)
        frames = []
        while self._reached < number:
            self._reached += 1
            reached = self._sender.pack("MISSION_ITEM_REACHED", seq=self._reached)
            frames.append(reached)
        current = next((one for one in present if one >= 0), self._item)
        current = self._reached + 1 if ended and self.mode == MODE_MISSION else current
        if current != self._item:
            self._item = current
            frames.append(self._stream("MISSION_CURRENT"))
        if ended and not self._telemetry.armed(row):
            # The end of a mission on the ground: the next start is its first item.
            if self._item >= len(self.missions.items):
                self._item = 0
            if self.mode != MODE_MISSION:
                self._chosen = MODE_HOLD
        elif ended and self.mode == MODE_TAKEOFF:
            self._chosen = MODE_HOLD
        return frames

    def _parameter(self, message: Message) -> list[bytes]:
        """Return the answers to a message about parameters."""
        values, names = message.values, [*self._parameters]
        if message.name == "PARAM_REQUEST_LIST":
            return [self._parameter_value(name) for name in names]
        if message.name not in ("PARAM_REQUEST_READ", "PARAM_SET"):
            return []
        name, index = values["param_id"], values.get("param_index", -1)
        if 0 <= index < len(names):
            name = names[index]
        error = NOT_FOUND if name not in self._parameters else 0
        if not error and message.name == "PARAM_SET":
            value = values["param_value"]
            error = 0 if name == TAKEOFF_PARAMETER and value > 0 else READ_ONLY
            if not error:
                self._parameters[name] = value
        if not error:
            return [self._parameter_value(name)]
        who = (message.system, message.component)
        fields = {"param_id": name, "param_index": index, "error": error}
        frames = [_to(self._sender, who, "PARAM_ERROR", **fields)]
        # Clients without this message expect the unchanged value.
        if error == READ_ONLY:
            frames.append(self._parameter_value(name))
        return frames

    def _parameter_value(self, name: str) -> bytes:
        value = self._parameters[name]
        whole = isinstance(value, int)
        # Integers are sent with their bits in the field of single precision.
        bits = struct.unpack("<f", struct.pack("<i", value))[0] if whole else value
        return self._sender.pack(
            "PARAM_VALUE",
            param_id=name,
            param_value=bits,
            param_type=PARAM_INT if whole else PARAM_FLOAT,
            param_count=len(self._parameters),
            param_index=[*self._parameters].index(name),
        )


def _inserted(command: int, up_m: float | None = None) -> Item:
    """Return an item at the present position, outside of the mission."""
    return Item(INSERTED, command, RELATIVE, (0.0, 0.0, 0.0, None, None, None, up_m))


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
