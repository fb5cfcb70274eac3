"""Vehicle for a ground station: commands, modes and telemetry.

The vehicle behaves as PX4 in its automatic modes: it is armed, takes off, flies its
mission, pauses, returns and lands by command. It is simulated step by step at the pace
of the wall clock. A command in flight replaces the path of its controller by one that
begins at the present set point, with a stop at the stopping distance.
"""

import math
import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, PyTree

from jblast.autopilot.lockstep import PERIOD_S
from jblast.autopilot.mavlink import (
    HEARTBEAT_S,
    Link,
    LinkLost,
    answer,
    dialect,
    message,
)
from jblast.autopilot.protocols import (
    AUTO,
    CAPABILITIES,
    COMPLETE,
    COMPONENT,
    FLOWN,
    LANDED_UP_M,
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
    Missions,
    Parameters,
    Status,
    heartbeat,
    telemetry,
)
from jblast.errors import InputError
from jblast.missions import Item, Mission, MissionControl, Plan, Progress, mission_of
from jblast.missions.guidance import ENDED, FLYING
from jblast.missions.plan import (
    GLOBAL,
    MISSION,
    RELATIVE,
    Nav,
    checked_item,
)
from jblast.missions.route import Limits, geodetic
from jblast.observations.places import Frame
from jblast.scene import Place
from jblast.vehicle import PositionHold, State
from jblast.vehicle.rollout import FlightState, Simulator
from jblast.vehicle.state import four, joined

# MAV_CMD, besides those of missions.
SET_MODE, REPOSITION, PAUSE_CONTINUE, SET_ITEM = 176, 192, 193, 224
START, ARM, GET_HOME = 300, 400, 410
GET_INTERVAL, SET_INTERVAL, REQUEST, CAPABILITIES_REQUEST = 510, 511, 512, 520
MODES = {
    Nav.TAKEOFF: MODE_TAKEOFF,
    Nav.LAND: MODE_LAND,
    Nav.RETURN: MODE_RETURN,
    Nav.LOITER: MODE_HOLD,
    START: MODE_MISSION,
}
"""Mode of each command that sets one."""
ACCEPTED, REFUSED, DENIED, UNSUPPORTED = 0, 1, 2, 3
"""MAV_RESULT; REFUSED is TEMPORARILY_REJECTED."""
WARNING = 4
"""MAV_SEVERITY."""
BLOCK, BLOCK_S = 25, 25 * PERIOD_S
"""Steps of a program, and their duration: one interval of the telemetry."""
LEAST_LEGS = 64
"""Least length of a table of legs; a longer table is padded to a power of 2, because
each length compiles a program of its own."""
INSERTED = -1
"""Number of an item that is not part of the mission."""


@eqx.filter_jit
def _advanced(
    simulator: Simulator,
    control: MissionControl,
    now: FlightState,
    memory: PyTree[Array],
    first: Int[Array, ""],
) -> tuple[FlightState, PyTree[Array], State]:
    """Return flight, controller and vehicle after `BLOCK` steps."""
    period, vehicle = simulator.step_s, simulator.vehicle

    def turn(carried: tuple[FlightState, PyTree[Array]], n: Int[Array, ""]) -> Any:
        now, memory = carried
        time_s, state = n.astype(period.dtype) * period, joined(now.motion)
        speeds, memory = control(time_s, state, vehicle, memory, period)
        return (simulator.step(now, n, command=four(speeds)), memory), None

    (now, memory), _ = jax.lax.scan(turn, (now, memory), first + jnp.arange(BLOCK))
    return now, memory, joined(now.motion)


class Craft:
    """A vehicle that follows a path, step by step.

    Attributes:
        state: State of the vehicle.
        time_s: Time of flight.
        mission: Path; None before the take-off.

    Args:
        simulator: Steps of the vehicle.
        start: Initial state.
        hold: Controller that follows the set point.
    """

    def __init__(self, simulator: Simulator, start: State, hold: PositionHold):
        self._simulator, self._start, self._hold = simulator, start, hold
        self.stand()

    def stand(self) -> None:
        """Return to the start."""
        self.state, self.mission, self._steps = self._start, None, 0
        self.mission: Mission | None
        self._now = self._simulator.start(self._start)
        self._memory: Any = None

    @property
    def time_s(self) -> float:
        """Time of flight."""
        return self._steps * PERIOD_S

    @property
    def progress(self) -> Progress:
        """State of the guidance."""
        return self._memory[1]

    @property
    def flies(self) -> bool:
        """True from the take-off's command on, until the vehicle is disarmed."""
        return self.mission is not None and int(self.progress.phase) < ENDED

    @property
    def over(self) -> bool:
        """True if the path is over, or there is none."""
        return self.mission is None or self.where()[1]

    @property
    def yaw_rad(self) -> float:
        """Heading of the set point, or of the start."""
        if self.mission is not None:
            return float(self.progress.yaw_rad)
        _, _, z, w = np.asarray(self.state.quaternion).tolist()
        return 2 * math.atan2(z, w)

    @property
    def in_air(self) -> bool:
        """True above the ground."""
        return float(self.state.position_m[2]) > LANDED_UP_M

    @property
    def throttle(self) -> float:
        """Mean rotor speed as a share of the maximum."""
        speeds = np.asarray(self.state.rotor_speed_rad_s)
        share = speeds.mean() / float(self._simulator.vehicle.rotor_speed_max_rad_s)
        return float(share) if self.flies else 0.0

    def set_point(self) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]]:
        """Return position and velocity of the set point."""
        legs, now = self._control.guidance.legs, self.progress
        place, way, _ = legs.at(now.leg, now.along_m)
        return np.asarray(place), np.asarray(now.speed_m_s * way)

    def follow(self, mission: Mission, *, in_air: bool) -> None:
        """Follow a path from the ground, or from the present set point."""
        guidance, legs = mission.guidance, mission.guidance.legs
        size = max(LEAST_LEGS, 1 << (legs.count - 1).bit_length())
        guidance = eqx.tree_at(lambda own: own.legs, guidance, legs.padded(size))
        self._control = MissionControl(guidance, self._hold)
        integral, fresh = self._control.start()
        if in_air:
            fresh = fresh._replace(phase=jnp.full_like(fresh.phase, FLYING))
        if self.flies:
            integral, now = self._memory
            fresh = fresh._replace(speed_m_s=now.speed_m_s)
        self.mission, self._memory = mission, (integral, fresh)

    def advance(self) -> None:
        """Take `BLOCK` steps.

        Raises:
            InputError: The vehicle's state diverges; it is at the start again.
        """
        # NumPy's arrays have one type, where JAX's may be weak: one program for all.
        control, now, memory = jax.tree.map(
            lambda x: np.asarray(x) if eqx.is_array(x) else x,
            (self._control, self._now, self._memory),
        )
        self._now, self._memory, self.state = _advanced(
            self._simulator, control, now, memory, jnp.asarray(self._steps)
        )
        self._steps += BLOCK
        if not np.isfinite(np.asarray(self.state.position_m)).all():
            self.stand()
            raise InputError("the state of the vehicle diverged")

    def where(self) -> tuple[int, bool]:
        """Return the index of the current item of the path, and whether it is over.

        A path is over on the ground with the rotors at rest, or in its last hover.
        """
        mission, now = self.mission, self.progress
        assert mission is not None
        legs, leg = self._control.guidance.legs, int(now.leg)
        visit = int(legs.visit[leg])
        item = next(stop.item for stop in mission.stops if stop.visit == visit)
        hovers = not mission.stops[-1].lands and math.isinf(float(legs.hold_s[leg]))
        over = int(now.phase) == ENDED or (hovers and float(now.since_s) > 0)
        return item, over


class Path(NamedTuple):
    """Relation of a path to the mission of the vehicle.

    Attributes:
        plan: Mission in use at its command; None: none.
        added: Number of items ahead of those of the mission.
        first: Number of the first item in the mission; None: another path.
    """

    plan: Plan | None
    added: int = 0
    first: int | None = None


class GroundStation:
    """Service of a vehicle for a ground station over a link.

    Attributes:
        missions: Mission of the vehicle, and its home.
        flights: Number of flights.
        ended: Reason of the end of the service.

    Args:
        link: Link to the ground station.
        craft: The vehicle.
        missions: As above.
        place: Geodetic position of the scene's origin.
        target_m: Target in the air that the vehicle flies to, once armed without a
            mission; None: arming does not start a flight.
        speed: Flight time per wall-clock time [-].
    """

    def __init__(
        self,
        link: Link,
        craft: Craft,
        missions: Missions,
        place: Place,
        target_m: Float[np.ndarray, "3"] | None = None,
        speed: float = 1.0,
    ):
        self.missions, self._link, self._craft = missions, link, craft
        self._place, self._frame = place, Frame(*place)
        self._target_m, self._speed = target_m, speed
        self._home_m = np.asarray(craft.state.position_m) * [1.0, 1.0, 0.0]
        self._parameters, self.flights, self.ended = Parameters(), 0, ""
        self._intervals, self._sent = dict(STREAMS), dict.fromkeys(STREAMS, -1e9)
        self._has_first_mission = missions.plan is not None
        # The mode set by the client or by a flight; None: the initial mode.
        self._chosen: int | None = None
        self._armed = False  # before the take-off
        self._path = Path(None)
        # Current item, and last reached one.
        self._item, self._reached = 0, -1
        self._next_s = 0.0  # wall-clock time of the next steps

    def serve(self, seconds: float | None = None) -> None:
        """Serve until the ground station disconnects or the time is over.

        Args:
            seconds: Wall-clock time; None: no end.
        """
        start, beat = time.monotonic(), -1e9
        try:
            while seconds is None or time.monotonic() - start < seconds:
                # A fifth of the telemetry step: the loop stays responsive without busy
                # waiting.
                wait = TELEMETRY_STEP_S / 5
                if self._craft.flies:
                    wait = min(wait, max(self._next_s - time.monotonic(), 0.0))
                received = self._link.receive(wait)
                now, sent = time.monotonic(), []
                try:
                    sent += self.missions.remind(now)
                    if received is not None:
                        sent += self.answer(received, now)
                    sent += self._advance(now)
                except InputError as error:
                    # A rejected SET_MODE, or a vehicle that diverges.
                    self.report_text(str(error))
                if now - beat >= HEARTBEAT_S:
                    beat = now
                    sent.append(self.beat())
                self._link.send(*sent, *self._due(now))
            self.ended = "the time is over"
        except LinkLost as end:
            self.ended = str(end)
        except KeyboardInterrupt:
            self.ended = "interrupted"

    def report_text(self, text: str) -> None:
        """Send a text for the operator, cut to the 50 characters of STATUSTEXT."""
        self._link.send(message("STATUSTEXT", severity=WARNING, text=text[:50]))

    def beat(self) -> Any:
        """Return the heartbeat."""
        return heartbeat(armed=self.armed, mode=self.mode)

    @property
    def mode(self) -> int:
        """PX4's sub-mode of AUTO."""
        if self._chosen is not None:
            return self._chosen
        starts = self._has_first_mission and self.missions.plan is not None
        return MODE_MISSION if starts else MODE_HOLD

    @property
    def armed(self) -> bool:
        """True if the vehicle is armed, from the accepted command on."""
        return self._craft.flies or self._armed

    def answer(self, received: Any, now: float) -> list[Any]:
        """Return the answers to a message.

        Args:
            received: Received message.
            now: Time on the wall clock [s].

        Raises:
            InputError: SET_MODE is rejected.
        """
        name = received.get_type()
        # Messages for other vehicles or components, such as cameras, have no answer.
        if getattr(received, "target_system", 0) not in (0, SYSTEM):
            return []
        if getattr(received, "target_component", 0) not in (0, COMPONENT):
            return []
        if name == "MISSION_SET_CURRENT":
            self._set_item(received.seq)
            return [self._stream("MISSION_CURRENT")]
        if name.startswith("MISSION_"):
            plan = self.missions.plan
            sent = self.missions.answer(received, now)
            if self.missions.plan is not plan:
                self._item, self._reached = 0, -1
            return sent
        if name.startswith("PARAM_"):
            return self._parameters.answer(received)
        if name == "TIMESYNC" and received.tc1 == 0:
            return [message("TIMESYNC", tc1=time.monotonic_ns(), ts1=received.ts1)]
        # Requests have no target; an answer to this vehicle has one.
        if name == "PING" and received.target_system == 0:
            return [
                answer(received, "PING", time_usec=received.time_usec, seq=received.seq)
            ]
        if name == "SET_MODE":
            custom = received.custom_mode
            self._change_mode(custom >> 16 & 255, custom >> 24)
            return []
        if name not in ("COMMAND_LONG", "COMMAND_INT"):
            return []
        params = [getattr(received, f"param{n}") for n in range(1, 5)]
        if name == "COMMAND_LONG":
            params += [received.param5, received.param6, received.param7]
        else:
            params += [received.x / 1e7, received.y / 1e7, received.z]
        try:
            frame = getattr(received, "frame", GLOBAL)
            result, sent = self._command(received.command, params, frame)
        except InputError as error:
            self.report_text(str(error))
            result, sent = DENIED, []
        ack = answer(received, "COMMAND_ACK", command=received.command, result=result)
        return [ack, *sent]

    def _command(
        self, command: int, params: list[float], frame: int
    ) -> tuple[int, list[Any]]:
        """Return the result of a command, and further messages.

        Raises:
            InputError: The command is rejected.
        """
        first, second, third = (x if math.isfinite(x) else 0.0 for x in params[:3])
        if command in (GET_INTERVAL, SET_INTERVAL, REQUEST):
            return self._message(command, int(first), second)
        if command == CAPABILITIES_REQUEST:
            return self._message(REQUEST, dialect().MAVLINK_MSG_ID_AUTOPILOT_VERSION)
        if command == GET_HOME:
            return self._message(REQUEST, dialect().MAVLINK_MSG_ID_HOME_POSITION)
        if command == SET_ITEM:
            return (ACCEPTED if self._set_item(int(first)) else DENIED), []
        if command == ARM:
            return (self._arm() if first == 1 else self._disarm()), []
        if command == SET_MODE:
            return self._change_mode(int(second), int(third)), []
        if command == REPOSITION:
            return self._go(params[4:], frame), []
        if command == PAUSE_CONTINUE:
            command = START if first == 1 else Nav.LOITER
        if command not in MODES:
            return UNSUPPORTED, []
        if command == START and not self.armed:
            # Without a mission this starts the position control, as arming does.
            if self.missions.plan is not None or self._target_m is None:
                self._chosen = MODE_MISSION
            return self._arm(), []
        up = None if math.isnan(params[6]) or params[6] == 0 else params[6]
        return self._change_mode(AUTO, MODES[command], up), []

    def _message(
        self, command: int, number: int, interval_us: float = 0.0
    ) -> tuple[int, list[Any]]:
        """Return the result of a command about a message, and further messages."""
        kind = dialect().mavlink_map.get(number)
        name = "" if kind is None else kind.msgname
        once = {
            "AUTOPILOT_VERSION": lambda: message(
                name, capabilities=CAPABILITIES, uid=SYSTEM
            ),
            "HEARTBEAT": self.beat,
            **{one: lambda: self._stream(name) for one in STREAMS},
        }
        if command == REQUEST and name in once:
            return ACCEPTED, [once[name]()]
        if command == GET_INTERVAL and name:
            interval = self._intervals.get(name, 0.0)
            micro = -1 if interval == math.inf else round(1e6 * interval)
            fields = {"message_id": number, "interval_us": micro}
            return ACCEPTED, [message("MESSAGE_INTERVAL", **fields)]
        if command == SET_INTERVAL and name in STREAMS:
            # MAVLink: 0 is the default rate, -1 disables the message.
            interval = math.inf if interval_us < 0 else interval_us / 1e6
            self._intervals[name] = interval or STREAMS[name]
            return ACCEPTED, []
        return UNSUPPORTED, []

    def _set_item(self, item: int) -> bool:
        """Set the mission item to fly next; return whether this is possible."""
        if not self._craft.over or not 0 <= item < len(self.missions.items):
            return False
        self._item, self._reached = item, item - 1
        return True

    def _arm(self) -> int:
        """Arm, and start what arming starts; return the result."""
        if self.armed:
            return ACCEPTED
        # After a landing the vehicle stays where it is until it is armed again.
        self._craft.stand()
        if self.mode == MODE_MISSION:
            return self._start()
        hovers = self.missions.plan is None and self._chosen is None
        if hovers and self._target_m is not None:
            return self._follow([self._at(Nav.TAKEOFF, self._target_m)], Path(None))
        self._armed = True
        return ACCEPTED

    def _disarm(self) -> int:
        """Disarm on the ground; return the result."""
        # Disarming in flight would stop the rotors.
        if self._craft.flies and self._craft.in_air:
            return DENIED
        if self.armed:
            self._craft.stand()
        self._armed = False
        return ACCEPTED

    def _change_mode(self, main: int, mode: int, up_m: float | None = None) -> int:
        """Change the mode; return the result.

        Args:
            main: PX4's main mode.
            mode: PX4's sub-mode of AUTO.
            up_m: Height of a take-off above the sea; None: the parameter's height above
                home.
        """
        if main != AUTO or mode not in MODES.values():
            return UNSUPPORTED
        if not self.armed and mode not in (MODE_HOLD, MODE_MISSION):
            raise InputError("expected an armed vehicle, got a disarmed one")
        craft = self._craft
        if not self.armed or (mode == MODE_HOLD and not craft.flies):
            self._chosen = mode
            return ACCEPTED
        same = self._path.plan is self.missions.plan
        if mode == self.mode != MODE_HOLD and same and not craft.over:
            return ACCEPTED
        if mode == MODE_MISSION:
            return self._start()
        if mode == MODE_TAKEOFF:
            return self._take_off(up_m)
        added = {MODE_LAND: [_item(Nav.LAND)], MODE_RETURN: [_item(Nav.RETURN)]}
        return self._divert(added.get(mode, []), mode)

    def _start(self) -> int:
        """Start or continue the mission; return the result."""
        plan = self.missions.plan
        if plan is None:
            raise InputError("mission: expected an uploaded one, got none")
        first = self._item if self._item < len(plan.items) else 0
        # A vehicle in the air flies past a take-off.
        first += self._craft.flies and plan.items[first].command == Nav.TAKEOFF
        grounded = not self._craft.flies
        result = self._follow(*self._course(plan, first, grounded=grounded))
        self._chosen, self._reached = MODE_MISSION, first - 1
        return result

    def _course(
        self, plan: Plan, first: int = 0, *, grounded: bool = True
    ) -> tuple[list[Item], Path]:
        """Return the items to fly of a mission, with a take-off if it has none.

        Args:
            plan: The mission.
            first: Number of the first item to fly.
            grounded: True for a vehicle on the ground.

        Raises:
            InputError: The mission has jumps and does not start from its first item.
        """
        items = list(plan.items)
        if first > 0 and any(item.command == Nav.JUMP for item in items):
            raise InputError(
                "expected item 0 first, as the mission has jumps, got item "
                f"{first}: start it from the ground"
            )
        moving = [
            item.command
            for item in items[first:]
            if not (item.ignored or item.command in (Nav.SPEED, Nav.HEADING))
        ]
        # Changes of speed hold for all following items.
        added = [item for item in items[:first] if item.command == Nav.SPEED]
        if grounded and moving and moving[0] != Nav.TAKEOFF:
            added.append(_item(Nav.TAKEOFF, self._parameters.takeoff_up_m))
        return [*added, *items[first:]], Path(plan, len(added), first)

    def _take_off(self, up_m: float | None) -> int:
        """Take off to a height above the sea, or by default; return the result."""
        if self._craft.flies:
            raise InputError("take-off: expected a vehicle on the ground")
        home_m, up = self.missions.home.alt_m, self._parameters.takeoff_up_m
        up = up if up_m is None else up_m - home_m
        if up <= 0:
            raise InputError(f"take-off: expected more than {home_m:g} m")
        result = self._follow([_item(Nav.TAKEOFF, up)], Path(self.missions.plan))
        self._chosen = MODE_TAKEOFF
        return result

    def _go(self, place: list[float], frame: int) -> int:
        """Fly to a latitude, longitude and height; return the result."""
        # NaN is MAVLink's code for the present value, as 0, 0 is in an item.
        lat, lon = (0.0 if math.isnan(value) else value for value in place[:2])
        alt = place[2]
        if math.isnan(alt):
            frame = GLOBAL
            alt = float(self._frame.alt_m + self._craft.state.position_m[2])
        params = [0.0, 0.0, 0.0, None, lat, lon, alt]
        goal = checked_item("position", INSERTED, Nav.WAYPOINT, frame, params)
        return self._divert([goal], MODE_HOLD)

    def _divert(self, items: list[Item], mode: int) -> int:
        """Fly other items from the present position; return the result."""
        if not (self._craft.flies and self._craft.in_air):
            raise InputError("expected a vehicle in the air, got one on the ground")
        result = self._follow(items, Path(self.missions.plan))
        self._chosen = mode
        return result

    def _follow(self, items: Sequence[Item], path: Path) -> int:
        """Follow a path from the start, or from the present set point.

        Args:
            items: Items of the path.
            path: Relation of the items to the mission.
        """
        craft, start_m = self._craft, np.asarray(self._craft.state.position_m)
        if craft.flies:
            if int(craft.progress.phase) < FLYING:
                return REFUSED
            start_m, velocity = craft.set_point()
            ahead = self._stop(start_m, velocity, path.plan)
            items, path = [*ahead, *items], path._replace(added=path.added + len(ahead))
        in_air = craft.flies or bool(start_m[2] > 0)
        mission = self._mission(items, path.plan, start_m if in_air else None)
        self.flights += not craft.flies
        # A longer table of legs compiles a program.
        with self._link.beating(self.beat()):
            craft.follow(mission, in_air=in_air)
            craft.advance()
        self._path, self._armed = path, False
        self._next_s = time.monotonic() + BLOCK_S / self._speed
        return ACCEPTED

    def _stop(
        self,
        place_m: Float[np.ndarray, "3"],
        velocity_m_s: Float[np.ndarray, "3"],
        plan: Plan | None,
    ) -> list[Item]:
        """Return the items by which a set point stops, at a mission's acceleration."""
        speed, cruise = float(np.linalg.norm(velocity_m_s)), Limits().speed_m_s
        if plan is not None:
            cruise = plan.hover_speed_m_s or cruise
        way = velocity_m_s * speed / (2 * Limits().acceleration_m_s2)
        # It may brake from a speed above that of the following items.
        first, then = (
            Item(
                INSERTED,
                Nav.SPEED,
                MISSION,
                (1.0, one, -1.0, None, None, None, None),
            )
            for one in (max(speed, cruise), cruise)
        )
        return [first, self._at(Nav.LOITER_TIME, place_m + way), then]

    def _at(self, command: int, place_m: Float[np.ndarray, "3"]) -> Item:
        """Return an item at a position: east, north, up."""
        place = geodetic(self._frame, place_m).tolist()
        return Item(INSERTED, command, GLOBAL, (0.0, 0.0, 0.0, None, *place))

    def check(self, plan: Plan) -> Mission:
        """Return the path of a mission from the ground.

        Raises:
            InputError: The mission cannot be flown.
        """
        return self._mission(self._course(plan)[0], plan)

    def compile(self) -> None:
        """Compile the steps of a flight."""
        takeoff = [_item(Nav.TAKEOFF, self._parameters.takeoff_up_m)]
        self._craft.follow(self._mission(takeoff, None), in_air=False)
        self._craft.advance()
        self._craft.stand()

    def _mission(
        self,
        items: Sequence[Item],
        plan: Plan | None,
        start_m: Float[np.ndarray, "3"] | None = None,
    ) -> Mission:
        return mission_of(
            replace(plan or Plan(()), items=tuple(items)),
            place=self._place,
            position_m=self._home_m,
            start_m=start_m,
            yaw_rad=self._craft.yaw_rad,
            may_hover_on=True,
        )

    def _advance(self, now: float) -> list[Any]:
        """Simulate up to the present, and return messages about reached mission items.

        Raises:
            InputError: The vehicle's state diverges.
        """
        craft, path = self._craft, self._path
        if not craft.flies or now < self._next_s:
            return []
        self._next_s += BLOCK_S / self._speed
        craft.advance()
        index, over = craft.where()
        landed, count = not craft.flies, len(self.missions.items)
        if over:
            self._path = Path(path.plan)
            if self.mode == MODE_TAKEOFF or (landed and self.mode != MODE_MISSION):
                self._chosen = MODE_HOLD
        if path.first is None or path.plan is not self.missions.plan:
            return []
        item = count if over else path.first + max(index - path.added, 0)
        sent = [
            message("MISSION_ITEM_REACHED", seq=n)
            for n in range(self._reached + 1, item)
        ]
        self._reached = max(self._reached, item - 1)
        # The end of a mission on the ground: the next start is its first item.
        item = 0 if landed else item
        if item != self._item:
            self._item = item
            sent.append(self._stream("MISSION_CURRENT"))
        return sent

    def _due(self, now: float) -> list[Any]:
        """Return the periodic messages that are due."""
        sent, shown = [], {}
        for name, interval in self._intervals.items():
            if now - self._sent[name] >= interval / max(self._speed, 1.0):
                self._sent[name] = now
                shown = shown or telemetry(self._status())
                sent.append(message(name, **shown[name]))
        return sent

    def _stream(self, name: str) -> Any:
        return message(name, **telemetry(self._status())[name])

    def _status(self) -> Status:
        craft, count = self._craft, len(self.missions.items)
        state = PAUSED if self._reached >= 0 or self._item else NOT_STARTED
        if self._reached == count - 1:
            state = COMPLETE
        if self.mode == MODE_MISSION and not craft.over:
            state = FLOWN
        return Status(
            time_s=craft.time_s,
            state=craft.state,
            throttle=craft.throttle,
            frame=self._frame,
            armed=self.armed,
            mode=self.mode,
            item=min(self._item, max(count - 1, 0)),
            items=count,
            mission_state=state if count else NO_MISSION,
            home=self.missions.home,
        )


def _item(command: int, up_m: float | None = None) -> Item:
    """Return an item at the present position, outside of the mission.

    Args:
        command: MAV_CMD.
        up_m: Height above home; None: the present height.
    """
    params = (0.0, 0.0, 0.0, None, None, None, up_m)
    return Item(INSERTED, command, RELATIVE, params)
