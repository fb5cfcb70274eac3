"""Vehicle for a ground station: commands, modes and telemetry.

The vehicle behaves as PX4 in its automatic modes: it is armed, takes off, flies its
mission, pauses, returns and lands by command. Each flight is computed as a whole, in a
thread of its own, and sent row by row at the pace of the wall clock. Its clock stops
while a flight is computed. A command in flight computes the flight again, from the
take-off, with another end from the present position on (`Course`).
"""

import math
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from jblast.autopilot.course import INSERTED, Course, course_of, inserted
from jblast.autopilot.flight_record import FlightRecord
from jblast.autopilot.mavlink import Link, LinkLost, Message, Sender, message_name
from jblast.autopilot.protocols import Missions, Parameters
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
    DELAY,
    GLOBAL,
    JUMP,
    LAND,
    LOITER,
    LOITER_TIME,
    RETURN,
    TAKEOFF,
    WAYPOINT,
    Item,
    Plan,
    checked_item,
)

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
REPLAY_S = 5.0
"""Largest shift of time between two computations of a flight, declared: their paths are
equal up to the command, but for the speed at the last corner before it."""
CLIMB_M_S = 0.1
"""Horizontal speed of the set point below which a take-off climbs vertically, declared:
there it is 0 but for rounding, and on the way to the take-off's position m/s."""


@dataclass
class ServiceResult:
    """Result of serving a ground station.

    Attributes:
        flights: Number of flights.
        ended: Reason of the end.
    """

    flights: int = 0
    ended: str = ""


class NotNow(InputError):
    """A command that may be accepted later."""


class Request(NamedTuple):
    """A command that waits for its answer.

    Attributes:
        command: MAV_CMD.
        who: System and component of its sender.
    """

    command: int
    who: tuple[int, int]

    @property
    def sets_mode(self) -> bool:
        """True if it is accepted before its flight is computed, as by PX4."""
        return self.command == SET_MODE

    def acks(self, sender: Sender, result: int) -> list[bytes]:
        """Return the acknowledgement."""
        fields = {"command": self.command, "result": result}
        return [sender.pack_to(self.who, "COMMAND_ACK", **fields)]


class Job(NamedTuple):
    """Computation of a flight.

    Attributes:
        request: Command that started it.
        course: Course of the flight.
        mission: Mission of the vehicle; None: no mission.
        mode: Mode in the flight.
        begin_s: Wall-clock time at its begin.
        record: The flight, once it is computed.
    """

    request: Request
    course: Course
    mission: Plan | None
    mode: int
    begin_s: float
    record: Future[FlightRecord]


class Flight(NamedTuple):
    """A computed flight.

    Attributes:
        course: Its course.
        mission: Mission of the vehicle at its command; None: no mission.
        telemetry: Its telemetry.
    """

    course: Course
    mission: Plan | None
    telemetry: Telemetry


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
        report: Called with a line when the computation of a flight begins and ends.
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
        report: Callable[[str], object] = lambda line: None,
    ):
        self._report = report
        self.missions, self._link, self._fly, self._speed = missions, link, fly, speed
        self._sender, self._parameters = Sender(SYSTEM, COMPONENT), Parameters()
        self._standing, self._hovers = Telemetry(standing), hovers
        self._intervals, self._sent = dict(STREAMS), dict.fromkeys(STREAMS, -1e9)
        self._has_first_mission = missions.plan is not None
        # The mode set by the client or by a flight; None: the initial mode.
        self._chosen: int | None = None
        # None: the vehicle stands on the ground, before its take-off.
        self._flight: Flight | None = None
        self._armed = False  # before the take-off
        # Flight time at the wall-clock time `_since_s`; None: the clock is stopped.
        self._time_s, self._since_s = 0.0, None
        # Current item, last reached one, and last row with reported progress.
        self._item, self._reached, self._followed = 0, -1, -1
        self._job: Job | None = None
        self.watched = ServiceResult()

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
                try:
                    frames += self.missions.remind(self._sender, now)
                    if message is not None:
                        frames += self.answer(message, now)
                except InputError as error:
                    # A rejected SET_MODE, or a number that does not fit the answer.
                    self.report_text(str(error))
                if now - beat >= HEARTBEAT_S:
                    beat = now
                    frames.append(self._beat())
                    if self._job is not None and not self._job.request.sets_mode:
                        # Clients extend their timeout with each of these.
                        frames += self._job.request.acks(self._sender, IN_PROGRESS)
                frames += self._follow() + self._due(now)
                if frames and self._link.connected:
                    self._link.send(*frames)
            self.watched.ended = "the time is over"
        except (LinkLost, InputError) as end:
            self.watched.ended = str(end)
        except KeyboardInterrupt:
            self.watched.ended = "interrupted"
        return self.watched

    def report_text(self, text: str) -> None:
        """Send a text for the operator, cut to the 50 characters of STATUSTEXT."""
        if self._link.connected:
            frame = self._sender.pack("STATUSTEXT", severity=WARNING, text=text[:50])
            self._link.send(frame)

    @property
    def mode(self) -> int:
        """PX4's sub-mode of AUTO."""
        if self._job is not None and self._job.request.sets_mode:
            return self._job.mode
        if self._chosen is not None:
            return self._chosen
        starts = self._has_first_mission and self.missions.plan is not None
        return MODE_MISSION if starts else MODE_HOLD

    @property
    def armed(self) -> bool:
        """True if the vehicle is armed, from the accepted command on."""
        if self._flight is None:
            return self._armed
        return bool(self._telemetry.record.armed[self._row() :].any())

    def answer(self, message: Message, now: float) -> list[bytes]:
        """Return the answers to a message.

        Args:
            message: Received message.
            now: Time on the wall clock [s].

        Raises:
            InputError: SET_MODE is rejected, or a number does not fit its answer.
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
            return self._parameters.answer(self._sender, message)
        if name == "TIMESYNC" and values["tc1"] == 0:
            times = {"tc1": time.monotonic_ns(), "ts1": values["ts1"]}
            return [self._sender.pack("TIMESYNC", **times)]
        # Requests have no target; an answer to this vehicle has one.
        if name == "PING" and values["target_system"] == 0:
            fields = {"time_usec": values["time_usec"], "seq": values["seq"]}
            return [self._sender.pack_to(message.sender, "PING", **fields)]
        if name == "SET_MODE":
            custom = values["custom_mode"]
            request = Request(SET_MODE, message.sender)
            self._change_mode(request, custom >> 16 & 255, custom >> 24)
            return []
        if name not in ("COMMAND_LONG", "COMMAND_INT"):
            return []
        params = [values[f"param{n}"] for n in range(1, 5)]
        if name == "COMMAND_LONG":
            params += [values[f"param{n}"] for n in range(5, 8)]
        else:
            params += [values["x"] / 1e7, values["y"] / 1e7, values["z"]]
        request = Request(values["command"], message.sender)
        running = None if self._job is None else self._job.request
        if running and running.command == request.command != SET_MODE:
            return running.acks(self._sender, IN_PROGRESS)
        try:
            result, frames = self._command(request, params, values.get("frame", GLOBAL))
        except InputError as error:
            self.report_text(str(error))
            result, frames = REFUSED if isinstance(error, NotNow) else DENIED, []
        return [*request.acks(self._sender, result), *frames]

    def _command(
        self, request: Request, params: list[float], frame: int
    ) -> tuple[int, list[bytes]]:
        """Return the result of a command, and further frames.

        Raises:
            InputError: The command is rejected.
        """
        command = request.command
        first, second, third = (x if math.isfinite(x) else 0.0 for x in params[:3])
        if command in (GET_INTERVAL, SET_INTERVAL, REQUEST):
            return self._message(command, message_name(int(first)), first, second)
        if command == CAPABILITIES_REQUEST:
            return self._message(REQUEST, "AUTOPILOT_VERSION")
        if command == GET_HOME:
            return self._message(REQUEST, "HOME_POSITION")
        if command == SET_ITEM:
            return (ACCEPTED if self._set_item(int(first)) else DENIED), []
        if command == ARM:
            return (self._arm(request) if first == 1 else self._disarm()), []
        if command == SET_MODE:
            return self._change_mode(request, int(second), int(third)), []
        if command == REPOSITION:
            return self._go(request, params[4:], frame), []
        if command == PAUSE_CONTINUE:
            command = START if first == 1 else LOITER
        if command not in MODES:
            return UNSUPPORTED, []
        if command == START and not self.armed:
            # Without a mission this starts the position control, as arming does.
            if self.missions.plan is not None or not self._hovers:
                self._chosen = MODE_MISSION
            return self._arm(request), []
        up = None if math.isnan(params[6]) or params[6] == 0 else params[6]
        return self._change_mode(request, AUTO, MODES[command], up), []

    def _message(
        self, command: int, name: str, number: float = 0.0, interval_us: float = 0.0
    ) -> tuple[int, list[bytes]]:
        """Return the result of a command about a message, and further frames."""
        if command == GET_INTERVAL:
            interval = self._intervals.get(name, 0.0)
            micro = -1 if interval == math.inf else round(1e6 * interval)
            fields = {"message_id": int(number), "interval_us": micro}
            return ACCEPTED, [self._sender.pack("MESSAGE_INTERVAL", **fields)]
        if command == REQUEST and name == "AUTOPILOT_VERSION":
            fields = {"capabilities": CAPABILITIES, "uid": SYSTEM}
            return ACCEPTED, [self._sender.pack(name, **fields)]
        if command == REQUEST and name == "HEARTBEAT":
            return ACCEPTED, [self._beat()]
        if name not in STREAMS:
            return UNSUPPORTED, []
        if command == REQUEST:
            return ACCEPTED, [self._stream(name)]
        # MAVLink: 0 is the default rate, -1 disables the message.
        interval = math.inf if interval_us < 0 else interval_us / 1e6
        self._intervals[name] = interval or STREAMS[name]
        return ACCEPTED, []

    def _set_item(self, item: int) -> bool:
        """Set the mission item to fly next; return whether this is possible."""
        busy = self._flies() or self._job is not None
        if busy or not 0 <= item < len(self.missions.items):
            return False
        self._item, self._reached = item, item - 1
        return True

    def _arm(self, request: Request) -> int:
        """Arm, and start what arming starts; return the result."""
        if self._job is not None:
            return REFUSED
        if self.armed:
            return REFUSED if self._flies() else ACCEPTED
        self._stand()
        if self.mode == MODE_MISSION:
            return self._start(request)
        if self.missions.plan is None and self._hovers and self._chosen is None:
            return self._compute(request, Course(), None, MODE_HOLD)
        self._armed = True
        return ACCEPTED

    def _disarm(self) -> int:
        """Disarm on the ground; return the result."""
        if self._job is not None:
            return REFUSED
        # Disarming in flight would stop the rotors. A position controller has no other
        # end.
        if self.armed and self._in_air() and (self._flies() or self._course.items):
            return DENIED
        # After a landing the vehicle stays where it is until it is armed again.
        if self.armed:
            self._stand()
        return ACCEPTED

    def _change_mode(
        self, request: Request, main: int, mode: int, up_m: float | None = None
    ) -> int:
        """Change the mode; return the result.

        Args:
            request: Command that changes it.
            main: PX4's main mode.
            mode: PX4's sub-mode of AUTO.
            up_m: Height of a take-off above the sea; None: the parameter's height above
                home.
        """
        if self._job is not None:
            return ACCEPTED if mode == self.mode else REFUSED
        if main != AUTO or mode not in MODES.values():
            return UNSUPPORTED
        if not self.armed:
            if mode not in (MODE_HOLD, MODE_MISSION):
                raise InputError("expected an armed vehicle, got a disarmed one")
            self._chosen = mode
            return ACCEPTED
        flight, flies = self._flight, self._flies()
        current = flight is not None and flight.mission is self.missions.plan
        if mode == self.mode and flies and current:
            return ACCEPTED
        if mode == MODE_MISSION:
            return self._start(request)
        if mode == MODE_TAKEOFF:
            return self._take_off(request, up_m)
        if mode == MODE_HOLD and (not flight or (flight.course.hovers and not flies)):
            self._chosen = mode
            return ACCEPTED
        added = {MODE_LAND: [inserted(LAND)], MODE_RETURN: [inserted(RETURN)]}
        return self._divert(request, added.get(mode, []), mode)

    def _start(self, request: Request) -> int:
        """Start or continue the mission; return the result."""
        plan = self.missions.plan
        if plan is None:
            raise InputError("mission: expected an uploaded one, got none")
        first = self._item if self._item < len(plan.items) else 0
        if self._flight is None:
            course = course_of(plan, None, first, self._parameters.takeoff_up_m)
        else:
            # A vehicle in the air flies past a take-off.
            passed = plan.items[first].command == TAKEOFF
            course = course_of(plan, self._interrupted(), first + passed)
        self._reached = first - 1
        return self._compute(request, course, plan, MODE_MISSION)

    def _take_off(self, request: Request, up_m: float | None) -> int:
        """Take off to a height above the sea, or by default; return the result."""
        if self._flight is not None:
            raise InputError("take-off: expected a vehicle on the ground")
        home_m, up = self.missions.home.alt_m, self._parameters.takeoff_up_m
        up = up if up_m is None else up_m - home_m
        if up <= 0:
            raise InputError(f"take-off: expected more than {home_m:g} m")
        course = Course().then([inserted(TAKEOFF, up_m=up)])
        return self._compute(request, course, self.missions.plan, MODE_TAKEOFF)

    def _go(self, request: Request, place: list[float], frame: int) -> int:
        """Fly to a latitude, longitude and height; return the result."""
        if self._job is not None:
            return REFUSED
        # NaN is MAVLink's code for the present value, as 0, 0 is in an item.
        lat, lon = (0.0 if math.isnan(value) else value for value in place[:2])
        alt = place[2]
        if math.isnan(alt):
            record = self._telemetry.record
            frame = GLOBAL
            alt = float(record.geodetic(record.position_m[self._row()])[2])
        params = [0.0, 0.0, 0.0, None, lat, lon, alt]
        goal = checked_item("position", INSERTED, WAYPOINT, frame, params)
        return self._divert(request, [goal], MODE_HOLD)

    def _divert(self, request: Request, items: list[Item], mode: int) -> int:
        """Fly other items from the present position; return the result."""
        if not self._in_air():
            raise InputError("expected a vehicle in the air, got one on the ground")
        course = self._interrupted().then(items)
        return self._compute(request, course, self.missions.plan, mode)

    def _interrupted(self) -> Course:
        """Return the course flown up to the present position, and a stop there.

        Its items are inserted ones, as their progress has been reported.

        Raises:
            NotNow: The vehicle is not on a straight segment in the air.
        """
        row, record, course = self._row(), self._telemetry.record, self._course
        n = self._telemetry.item(row)
        # After the last item it hovers, although its record goes on.
        complete = not self._flies() or n >= len(course.items)
        if complete and course.hovers:
            return Course().then(course.hovering().items)
        kind = course.items[n].command if n < len(course.items) else None
        if any(item.command == JUMP for item in course.items):
            raise NotNow("expected a mission without jumps to interrupt")
        straight = (WAYPOINT, TAKEOFF, LOITER, LOITER_TIME, DELAY)
        if kind not in straight or not self._in_air():
            raise NotNow("expected straight flight; repeat the command later")
        aim = record.position_m if record.set_point_m is None else record.set_point_m
        # The set point stops with the acceleration of missions.
        near = slice(max(row - 1, 0), row + 1)
        times = np.diff(record.time_s[near])
        speed = np.diff(aim[near], axis=0)[0] / times[0] if times.size else np.zeros(3)
        stop_s = np.linalg.norm(speed) / (2 * Limits().acceleration_m_s2)
        lat, lon, alt = record.geodetic(aim[row] + stop_s * speed).tolist()
        command = WAYPOINT
        if kind == TAKEOFF and np.hypot(*speed[:2]) < CLIMB_M_S:
            command, lat, lon = TAKEOFF, None, None
        elif kind == TAKEOFF:
            n += 1
        params = (0.0, 0.0, 0.0, None, lat, lon, alt)
        stop = Item(INSERTED, command, GLOBAL, params)
        return Course().then([*course.items[:n], stop])

    def _compute(
        self, request: Request, course: Course, mission: Plan | None, mode: int
    ) -> int:
        """Compute a flight in a thread, with the clock stopped; return the result."""
        self._time_s, self._since_s = self._now_s(), None
        plan = course.plan(mission) if course.items else None
        pool = ThreadPoolExecutor(1)
        self._report("computing the flight")
        begin_s = time.monotonic()
        record = pool.submit(self._fly, plan)
        pool.shutdown(wait=False)  # the thread ends with the flight
        self._job = Job(request, course, mission, mode, begin_s, record)
        return ACCEPTED if request.sets_mode else IN_PROGRESS

    def _finish_job(self) -> list[bytes]:
        """Begin to send a computed flight, and return the answer to its command."""
        job, result = self._job, ACCEPTED
        if job is None or not job.record.done():
            return []
        self._job = None
        after = f"after {time.monotonic() - job.begin_s:.0f} s"
        try:
            self._begin(job, job.record.result())
            self._report(f"computing the flight: done {after}")
        except InputError as error:
            self._report(f"computing the flight: refused {after}: {error}")
            self.report_text(str(error))
            result = DENIED
        if self._flight is not None:
            self._since_s = time.monotonic()
        return [] if job.request.sets_mode else job.request.acks(self._sender, result)

    def _begin(self, job: Job, record: FlightRecord) -> None:
        """Begin a flight, or continue the present one on its new course."""
        last = None
        if job.course.hovers:
            # The flight is shown until the landing that `Course.plan` adds.
            rows = np.flatnonzero(record.item == len(job.course.hovering().items))
            last = int(rows[0]) if rows.size else None
        if self._flight is None:
            self.watched.flights += 1
        else:
            present = self._telemetry.record.position_m[self._row()]
            shift = np.abs(record.time_s - self._time_s)
            away = np.linalg.norm(record.position_m - present, axis=1)
            # Of equally near rows the one of the same time: a hover has many.
            cost = np.where(shift <= REPLAY_S, away + 0.01 * shift, np.inf)
            self._time_s = float(record.time_s[np.argmin(cost)])
        self._flight = Flight(job.course, job.mission, Telemetry(record, last))
        self._followed = -1
        # Position control without a mission has no command of its own.
        if job.course.items:
            self._chosen = job.mode

    def _stand(self) -> None:
        """Return to the state before take-off, at the scene's position and time."""
        self._flight, self._armed = None, False
        self._time_s, self._since_s = 0.0, None

    @property
    def _telemetry(self) -> Telemetry:
        return self._standing if self._flight is None else self._flight.telemetry

    @property
    def _course(self) -> Course:
        return Course() if self._flight is None else self._flight.course

    def _now_s(self) -> float:
        """Return the flight time; it stands still at the end of the flight."""
        if self._since_s is None:
            return self._time_s
        now_s = self._time_s + self._speed * (time.monotonic() - self._since_s)
        return min(now_s, self._telemetry.end_s)

    def _row(self) -> int:
        return self._telemetry.row_at(self._now_s())

    def _flies(self) -> bool:
        return self._flight is not None and self._row() < self._telemetry.last

    def _in_air(self) -> bool:
        return self._flight is not None and self._telemetry.in_air(self._row())

    def _follow(self) -> list[bytes]:
        """Follow the flight: its end, and messages about reached mission items."""
        flight, row = self._flight, self._row()
        if flight is None or not flight.course.items or row == self._followed:
            return []
        self._followed, ended = row, row == flight.telemetry.last
        landed = ended and not flight.telemetry.armed(row)
        if (landed and self.mode != MODE_MISSION) or (
            ended and self.mode == MODE_TAKEOFF
        ):
            self._chosen = MODE_HOLD
        if flight.mission is not self.missions.plan:
            return []
        numbers, frames = flight.course.numbers, []
        n = len(numbers) if landed else min(flight.telemetry.item(row), len(numbers))
        reached = max([self._reached, *numbers[:n]])
        for number in range(self._reached + 1, reached + 1):
            frames.append(self._sender.pack("MISSION_ITEM_REACHED", seq=number))
        self._reached = reached
        item = next((one for one in numbers[n:] if one >= 0), self._item)
        if ended and self.mode == MODE_MISSION:
            item = self._reached + 1
        # The end of a mission on the ground: the next start is its first item.
        if landed and item >= len(self.missions.items):
            item = 0
        if item != self._item:
            self._item = item
            frames.append(self._stream("MISSION_CURRENT"))
        return frames

    def _due(self, now: float) -> list[bytes]:
        """Return the periodic messages that are due."""
        frames = []
        for name, interval in self._intervals.items():
            if now - self._sent[name] >= interval / max(self._speed, 1.0):
                self._sent[name] = now
                frames.append(self._stream(name))
        return frames

    def _beat(self) -> bytes:
        return heartbeat(self._sender, armed=self.armed, mode=self.mode)

    def _stream(self, name: str) -> bytes:
        count = len(self.missions.items)
        state = PAUSED if self._reached >= 0 or self._item else NOT_STARTED
        if self._reached == count - 1:
            state = COMPLETE
        if self._flies() and self.mode == MODE_MISSION:
            state = FLOWN
        status = VehicleStatus(
            armed=self.armed,
            mode=self.mode,
            item=min(self._item, max(count - 1, 0)),
            items=count,
            mission_state=state if count else NO_MISSION,
            home=self.missions.home,
        )
        return self._telemetry.frame(self._sender, name, self._row(), status)
