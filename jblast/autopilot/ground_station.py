"""Vehicle for a ground station: commands, modes and telemetry.

The vehicle behaves as PX4 in its automatic modes: it is armed, takes off, flies its
mission, pauses, returns and lands by command. It is simulated step by step at the pace
of the wall clock. A command in flight replaces the path of its controller by one that
begins at the present set point, with a stop at the stopping distance.

Constants are those of MAVLink's common.xml and PX4's modes of the main mode AUTO
(px4_custom_mode.h).
"""

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, PyTree

from jblast.autopilot.lockstep import PERIOD_S
from jblast.autopilot.mavlink import (
    HEARTBEAT_S,
    Link,
    answer,
    dialect,
    ending,
    message,
)
from jblast.autopilot.protocols import UNKNOWN, Missions, Parameters, motion_fields
from jblast.errors import InputError, require
from jblast.missions import Item, Mission, MissionControl, Plan, Progress, mission_of
from jblast.missions.guidance import ENDED, FLYING, Legs
from jblast.missions.plan import GLOBAL, RELATIVE, Nav, checked_item
from jblast.missions.route import geodetic
from jblast.observations.places import Frame
from jblast.scene import Place
from jblast.vehicle import PositionHold, State
from jblast.vehicle.rollout import FlightState, Simulator
from jblast.vehicle.state import four, joined

SYSTEM, COMPONENT = 1, 1
"""As sent by PX4: MAV_COMP_ID_AUTOPILOT1 of the first vehicle."""
QUADROTOR, PX4 = 2, 12
"""MAV_TYPE and MAV_AUTOPILOT."""
CUSTOM, GUIDED, SAFETY_ARMED = 1, 8, 128
"""Bits of the base mode."""
STANDBY, ACTIVE = 3, 4
"""MAV_STATE."""
AUTO = 4
"""PX4's main mode, third byte of the custom mode."""
MODE_TAKEOFF, MODE_HOLD, MODE_MISSION, MODE_RETURN, MODE_LAND = 2, 3, 4, 5, 6
"""PX4's sub-modes of AUTO, fourth byte of the custom mode."""
# MAV_CMD, besides those of missions.
SET_MODE, REPOSITION, PAUSE_CONTINUE, SET_ITEM = 176, 192, 193, 224
START, ARM, GET_HOME, SET_INTERVAL, REQUEST, CAPABILITIES = 300, 400, 410, 511, 512, 520
ACCEPTED, DENIED, UNSUPPORTED = 0, 2, 3
"""MAV_RESULT."""
WARNING = 4
"""MAV_SEVERITY."""
TELEMETRY_STEP_S = 0.1
"""Interval of the telemetry: 10 Hz, as usual over a radio link."""
STREAMS = {
    "HEARTBEAT": HEARTBEAT_S,
    "ATTITUDE": TELEMETRY_STEP_S,
    "ATTITUDE_QUATERNION": TELEMETRY_STEP_S,
    "GLOBAL_POSITION_INT": TELEMETRY_STEP_S,
    "LOCAL_POSITION_NED": TELEMETRY_STEP_S,
    "VFR_HUD": 2 * TELEMETRY_STEP_S,
    "EXTENDED_SYS_STATE": 2 * TELEMETRY_STEP_S,
    "SYS_STATUS": HEARTBEAT_S,
    "GPS_RAW_INT": HEARTBEAT_S,
    "HOME_POSITION": HEARTBEAT_S,
    "MISSION_CURRENT": HEARTBEAT_S,
    "AUTOPILOT_VERSION": math.inf,
}
"""Messages of the vehicle, and their default intervals [s]; infinite: by request."""
HEALTHY = 0x1 | 0x2 | 0x4 | 0x8 | 0x20 | 0x200000 | 0x2000000 | 0x10000000
"""MAV_SYS_STATUS_SENSOR: gyroscope, accelerometer, magnetometer, barometer, GPS, state
estimate, battery, checks before arming."""
PROTOCOLS = 0x4 | 0x8 | 0x10 | 0x2000
"""MAV_PROTOCOL_CAPABILITY: missions and commands with integer coordinates, parameters
by their bytes, MAVLink 2."""
ON_GROUND, IN_AIR = 1, 2
"""MAV_LANDED_STATE."""
IN_MOTION = {MODE_TAKEOFF: 3, MODE_LAND: 4}
"""The same for a vehicle in the air, by mode."""
LANDED_UP_M = 0.2
"""Height below which the vehicle is on the ground; its centre rests below this."""
NO_MISSION, NOT_STARTED, FLOWN, PAUSED, COMPLETE = 1, 2, 3, 4, 5
"""MISSION_STATE."""
BLOCK, BLOCK_S = 25, 25 * PERIOD_S
"""Steps of a program, and their duration: one interval of the telemetry."""
LEAST_LEGS = 64
"""Least length of a table of legs; a longer table is padded to a power of 2, because
each length compiles a program of its own."""
INSERTED = -1
"""Number of an item that is not part of the mission."""


class Unsupported(InputError):
    """A command, mode or message that the vehicle does not support."""


def heartbeat(*, armed: bool, mode: int) -> dict[str, int]:
    """Return the fields of the vehicle's heartbeat."""
    return {
        "type": QUADROTOR,
        "autopilot": PX4,
        "base_mode": CUSTOM | GUIDED | (SAFETY_ARMED if armed else 0),
        "custom_mode": AUTO << 16 | mode << 24,
        "system_status": ACTIVE if armed else STANDBY,
        "mavlink_version": 3,
    }


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
        mission: Path; None before the take-off.
        armed: True from the command on, until the end of a path on the ground.

    Args:
        simulator: Steps of the vehicle.
        start: Initial state.
        hold: Controller that follows the set point.
    """

    def __init__(self, simulator: Simulator, start: State, hold: PositionHold):
        self._simulator, self._start, self._hold = simulator, start, hold
        self.stand()

    def stand(self) -> None:
        """Return to the start, disarmed."""
        self.state, self.mission, self._steps = self._start, None, 0
        self.mission: Mission | None
        self.armed, self._now = False, self._simulator.start(self._start)
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
        return self.armed and self.mission is not None

    @property
    def over(self) -> bool:
        """True without a path, on the ground after one, and in its last hover."""
        if self.mission is None or not self.flies:
            return True
        hovers = math.isinf(float(self._legs.hold_s[self.progress.leg]))
        lands = self.mission.stops[-1].lands
        return hovers and not lands and float(self.progress.since_s) > 0

    @property
    def item(self) -> Item:
        """Current item of the path."""
        assert self.mission is not None
        visit = int(self._legs.visit[self.progress.leg])
        stop = next(stop for stop in self.mission.stops if stop.visit == visit)
        return self.mission.plan.items[stop.item]

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
        mean = float(np.mean(self.state.rotor_speed_rad_s))
        return mean / float(self._simulator.vehicle.rotor_speed_max_rad_s)

    @property
    def _legs(self) -> Legs:
        return self._control.guidance.legs

    def set_point(self) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]]:
        """Return position and velocity of the set point."""
        now = self.progress
        place, way, _ = self._legs.at(now.leg, now.along_m)
        return np.asarray(place), np.asarray(now.speed_m_s * way)

    def follow(self, mission: Mission) -> None:
        """Follow a path from the ground, or from the present set point."""
        guidance, legs = mission.guidance, mission.guidance.legs
        size = max(LEAST_LEGS, 1 << (legs.count - 1).bit_length())
        guidance = eqx.tree_at(lambda own: own.legs, guidance, legs.padded(size))
        self._control = MissionControl(guidance, self._hold)
        integral, fresh = self._control.start()
        if self.flies or self.in_air:
            fresh = fresh._replace(phase=jnp.full_like(fresh.phase, FLYING))
        if self.flies:
            integral, now = self._memory
            fresh = fresh._replace(speed_m_s=now.speed_m_s)
        self.mission, self.armed, self._memory = mission, True, (integral, fresh)

    def advance(self) -> None:
        """Take `BLOCK` steps.

        Raises:
            InputError: The vehicle's state diverges; it is at the start again.
        """
        self._move()
        self._steps += BLOCK
        self.armed = int(self.progress.phase) < ENDED
        if not np.isfinite(np.asarray(self.state.position_m)).all():
            self.stand()
            raise InputError("the state of the vehicle diverged")

    def _move(self) -> None:
        # NumPy's arrays have one type, where JAX's may be weak: one program for all.
        control, now, memory = jax.tree.map(
            lambda x: np.asarray(x) if eqx.is_array(x) else x,
            (self._control, self._now, self._memory),
        )
        self._now, self._memory, self.state = _advanced(
            self._simulator, control, now, memory, jnp.asarray(self._steps)
        )


class GroundStation:
    """Service of a vehicle for a ground station over a link.

    Attributes:
        missions: Mission of the vehicle, and its home.
        mode: PX4's sub-mode of AUTO.
        flights: Number of flights.
        ended: Reason of the end of the service.

    Args:
        link: Link to the ground station.
        craft: The vehicle.
        place: Geodetic position of the scene's origin.
        plan: Mission that arming starts; None: none.
        target_m: Target in the air that the vehicle flies to, once armed without a
            mission; None: arming does not start a flight.
        speed: Flight time per wall-clock time [-].
        report: Receives warnings, as the ground station does.

    Raises:
        InputError: The mission cannot be flown.
    """

    def __init__(
        self,
        link: Link,
        craft: Craft,
        place: Place,
        plan: Plan | None = None,
        *,
        target_m: Float[np.ndarray, "3"] | None = None,
        speed: float = 1.0,
        report: Callable[[str], object] = lambda text: None,
    ):
        self._link, self._craft, self._report = link, craft, report
        self._place, self._frame = place, Frame(*place)
        self._target_m, self._speed = target_m, speed
        self._home_m = np.asarray(craft.state.position_m) * [1.0, 1.0, 0.0]
        home = Place(*geodetic(self._frame, self._home_m).tolist())
        self.missions = Missions(plan, home, self.check, self.report)
        self.mode = MODE_HOLD if plan is None else MODE_MISSION
        self._parameters, self.flights, self.ended = Parameters(), 0, ""
        self._intervals, self._sent = dict(STREAMS), dict.fromkeys(STREAMS, -1e9)
        # Next item of the mission; their number after the last one.
        self._item = 0
        self._next_s = 0.0  # wall-clock time of the next steps
        self.commands: dict[int, Callable[..., None]] = {
            Nav.TAKEOFF: lambda *values: self._take_off(values[6]),
            Nav.LAND: lambda *_: self._change_mode(AUTO, MODE_LAND),
            Nav.RETURN: lambda *_: self._change_mode(AUTO, MODE_RETURN),
            Nav.LOITER: lambda *_: self._change_mode(AUTO, MODE_HOLD),
            START: lambda *_: self._start(),
            PAUSE_CONTINUE: lambda on, *_: (
                self._start() if on == 1 else self._change_mode(AUTO, MODE_HOLD)
            ),
            REPOSITION: lambda *values: self._go(*values[4:]),
            SET_MODE: lambda _, main, mode, *__: self._change_mode(
                int(main), int(mode)
            ),
            SET_ITEM: lambda item, *_: self._set_item(int(item)),
            ARM: lambda on, *_: self._arm() if on == 1 else self._disarm(),
            REQUEST: lambda number, *_: self._show(_name_of(number)),
            GET_HOME: lambda *_: self._show("HOME_POSITION"),
            CAPABILITIES: lambda *_: self._show("AUTOPILOT_VERSION"),
            SET_INTERVAL: lambda number, time_us, *_: self._stream(number, time_us),
        }
        if plan is not None:
            self.check(plan)

    def serve(self, seconds: float | None = None) -> None:
        """Serve until the ground station disconnects or the time is over.

        Args:
            seconds: Wall-clock time; None: no end.
        """
        start = time.monotonic()
        with ending(self):
            while seconds is None or time.monotonic() - start < seconds:
                # A fifth of the telemetry step: the loop stays responsive without busy
                # waiting.
                wait = TELEMETRY_STEP_S / 5
                if self._craft.flies:
                    wait = min(wait, max(self._next_s - time.monotonic(), 0.0))
                received = self._link.receive(wait)
                try:
                    if received is not None:
                        self.answer(received)
                    self._advance()
                except InputError as error:
                    # A rejected message without an answer, or a vehicle that diverges.
                    self.report(str(error))
                now = time.monotonic()
                due = [
                    name
                    for name, interval in self._intervals.items()
                    if now - self._sent[name] >= interval / max(self._speed, 1.0)
                ]
                if due:
                    self._show(*due)
                    self._sent |= dict.fromkeys(due, now)
            self.ended = "the time is over"

    def report(self, text: str) -> None:
        """Report a warning, to the operator in the 50 characters of STATUSTEXT."""
        self._report(text)
        self._link.send(message("STATUSTEXT", severity=WARNING, text=text[:50]))

    def answer(self, received: Any) -> None:
        """Answer a message.

        Raises:
            InputError: A message without an acknowledgement is rejected.
        """
        name = received.get_type()
        # Messages for other vehicles or components, such as cameras, have no answer.
        if getattr(received, "target_system", 0) not in (0, SYSTEM):
            return
        if getattr(received, "target_component", 0) not in (0, COMPONENT):
            return
        if name in ("COMMAND_LONG", "COMMAND_INT"):
            self._command(received)
        elif name == "SET_MODE":
            custom = received.custom_mode
            self._change_mode(custom >> 16 & 255, custom >> 24)
        elif name == "MISSION_SET_CURRENT":
            self._set_item(received.seq)
        elif name.startswith("PARAM_"):
            self._link.send(*self._parameters.answer(received))
        elif name.startswith("MISSION_"):
            plan, sent = self.missions.plan, self.missions.answer(received)
            if self.missions.plan is not plan:
                self._item = 0
                if self.missions.plan is None and not self._craft.armed:
                    self.mode = MODE_HOLD
            if sent is not None:
                self._link.send(sent)

    def _command(self, received: Any) -> None:
        """Execute a command and acknowledge it."""
        values = [getattr(received, f"param{n}") for n in range(1, 5)]
        # NaN is MAVLink's code for an unspecified number; of a position it is kept.
        values = [value if math.isfinite(value) else 0.0 for value in values]
        if received.get_type() == "COMMAND_INT":
            values += [received.x / 1e7, received.y / 1e7, received.z, received.frame]
        else:
            values += [received.param5, received.param6, received.param7, GLOBAL]
        result = ACCEPTED
        try:
            if received.command not in self.commands:
                raise Unsupported(f"command {received.command} is not supported")
            self.commands[received.command](*values)
        except Unsupported:
            result = UNSUPPORTED
        except InputError as error:
            self.report(str(error))
            result = DENIED
        fields = {"command": received.command, "result": result}
        self._link.send(answer(received, "COMMAND_ACK", **fields))

    def _stream(self, number: float, interval_us: float) -> None:
        """Set the interval of a message: 0 is the default, -1 disables it."""
        name = _name_of(number)
        if name not in STREAMS:
            raise Unsupported("the message is not supported")
        interval = math.inf if interval_us < 0 else interval_us / 1e6
        self._intervals[name] = interval or STREAMS[name]

    def _set_item(self, item: int) -> None:
        """Set the mission item to fly next."""
        if not self._craft.over or not 0 <= item < len(self.missions.items):
            words = "expected an item of the mission, after the end of a path"
            raise InputError(f"{words}, got item {item}")
        self._item = item
        self._show("MISSION_CURRENT")

    def _arm(self) -> None:
        """Arm, and start what arming starts."""
        craft = self._craft
        if craft.armed:
            return
        if self.mode == MODE_MISSION:
            self._start()
            return
        # After a landing the vehicle stays where it is until it is armed again.
        craft.stand()
        craft.armed = True
        if self.missions.plan is None and self._target_m is not None:
            self._fly([self._at(Nav.TAKEOFF, self._target_m)], MODE_HOLD)

    def _disarm(self) -> None:
        """Disarm on the ground."""
        # Disarming in flight would stop the rotors.
        flies = self._craft.flies and self._craft.in_air
        require(not flies, "disarming", "a vehicle on the ground")
        if self._craft.armed:
            self._craft.stand()

    def _change_mode(self, main: int, mode: int) -> None:
        """Change the mode, or the one that arming starts.

        Args:
            main: PX4's main mode.
            mode: PX4's sub-mode of AUTO.
        """
        craft = self._craft
        if main != AUTO or not MODE_TAKEOFF <= mode <= MODE_LAND:
            raise Unsupported(f"expected a mode of AUTO, 2 to 6, got {main}, {mode}")
        waits = mode == MODE_HOLD and not craft.flies
        if waits or (mode == MODE_MISSION and not craft.armed):
            self.mode = mode
        elif mode == MODE_MISSION:
            self._start()
        elif mode == MODE_TAKEOFF:
            self._take_off()
        else:
            added = {MODE_LAND: [_item(Nav.LAND)], MODE_RETURN: [_item(Nav.RETURN)]}
            self._fly(added.get(mode, []), mode)

    def _start(self) -> None:
        """Start or continue the mission, after arming if necessary."""
        plan, craft = self.missions.plan, self._craft
        if plan is None:
            raise InputError("mission: expected an uploaded one, got none")
        if self.mode == MODE_MISSION and self._is_followed and not craft.over:
            return
        first = self._item if self._item < len(plan.items) else 0
        # A vehicle in the air flies past a take-off.
        first += craft.flies and plan.items[first].command == Nav.TAKEOFF
        course = self._course(plan, first, grounded=not craft.flies)
        if not craft.armed:
            craft.stand()
            craft.armed = True
        self._fly(course, MODE_MISSION)
        self._item = first

    @property
    def _is_followed(self) -> bool:
        """True if the path is that of the mission; it has the mission's own items."""
        items, path = self.missions.items, self._craft.mission
        return bool(items) and path is not None and path.plan.items[-1] is items[-1]

    def _course(
        self, plan: Plan, first: int = 0, *, grounded: bool = True
    ) -> list[Item]:
        """Return the items to fly of a mission, with a take-off if it has none.

        Args:
            plan: The mission.
            first: Number of the first item to fly.
            grounded: True for a vehicle on the ground.

        Raises:
            InputError: The mission has jumps and does not start from its first item.
        """
        before, items = plan.items[:first], plan.items[first:]
        if first > 0 and any(item.command == Nav.JUMP for item in plan.items):
            raise InputError(
                "expected item 0 first, as the mission has jumps, got item "
                f"{first}: start it from the ground"
            )
        # Changes of speed hold for all following items.
        ahead = [item for item in before if item.command == Nav.SPEED]
        moving = (
            item.command
            for item in items
            if not (item.ignored or item.command in (Nav.SPEED, Nav.HEADING))
        )
        if grounded and next(moving, Nav.TAKEOFF) != Nav.TAKEOFF:
            ahead.append(_item(Nav.TAKEOFF, self._parameters.takeoff_up_m))
        return [*ahead, *items]

    def _take_off(self, up_m: float = 0.0) -> None:
        """Take off to a height above the sea; 0 or NaN: by default."""
        require(not self._craft.flies, "take-off", "a vehicle on the ground")
        home_m, up = self.missions.home.alt_m, self._parameters.takeoff_up_m
        up = up if math.isnan(up_m) or up_m == 0 else up_m - home_m
        require(up > 0, "take-off", f"more than {home_m:g} m")
        self._fly([_item(Nav.TAKEOFF, up)], MODE_TAKEOFF)

    def _go(self, lat: float, lon: float, alt: float, frame: int) -> None:
        """Fly to a position."""
        # NaN is MAVLink's code for the present value, as 0, 0 is in an item.
        lat, lon = (0.0 if math.isnan(value) else value for value in (lat, lon))
        if math.isnan(alt):
            frame = GLOBAL
            alt = float(self._frame.alt_m + self._craft.state.position_m[2])
        params = [0.0, 0.0, 0.0, None, lat, lon, alt]
        goal = checked_item("position", INSERTED, Nav.WAYPOINT, frame, params)
        self._fly([goal], MODE_HOLD)

    def _fly(self, items: Sequence[Item], mode: int) -> None:
        """Follow a path from the start, or from the present set point, in a mode."""
        craft, start_m = self._craft, np.asarray(self._craft.state.position_m)
        if not craft.armed:
            raise InputError("expected an armed vehicle, got a disarmed one")
        if craft.flies:
            if int(craft.progress.phase) < FLYING:
                raise InputError("expected a vehicle in flight, got one that takes off")
            start_m, velocity = craft.set_point()
            items = [*self._stop(start_m, velocity), *items]
        in_air = craft.flies or craft.in_air
        mission = self._mission(items, start_m if in_air else None)
        self.flights += not craft.flies
        # A longer table of legs compiles a program.
        beat = heartbeat(armed=craft.armed, mode=self.mode)
        with self._link.beating(message("HEARTBEAT", **beat)):
            craft.follow(mission)
            craft.advance()
        self.mode, self._next_s = mode, time.monotonic() + BLOCK_S / self._speed

    def _stop(
        self, place_m: Float[np.ndarray, "3"], velocity_m_s: Float[np.ndarray, "3"]
    ) -> list[Item]:
        """Return the items by which a set point stops."""
        limits, plan = self._parameters.limits, self.missions.plan
        speed, cruise = float(np.linalg.norm(velocity_m_s)), limits.speed_m_s
        if plan is not None:
            cruise = plan.hover_speed_m_s or cruise
        way = velocity_m_s * speed / (2 * limits.acceleration_m_s2)
        # It may brake from a speed above that of the following items.
        first, then = (
            Item(INSERTED, Nav.SPEED, RELATIVE, (1.0, one, -1.0, *[None] * 4))
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
        return self._mission(self._course(plan), plan=plan)

    def compile(self) -> None:
        """Compile the steps of a flight."""
        takeoff = _item(Nav.TAKEOFF, self._parameters.takeoff_up_m)
        self._craft.follow(self._mission([takeoff]))
        self._craft.advance()
        self._craft.stand()

    def _mission(
        self,
        items: Sequence[Item],
        start_m: Float[np.ndarray, "3"] | None = None,
        plan: Plan | None = None,
    ) -> Mission:
        return mission_of(
            replace(plan or self.missions.plan or Plan(()), items=tuple(items)),
            place=self._place,
            position_m=self._home_m,
            start_m=start_m,
            yaw_rad=self._craft.yaw_rad,
            limits=self._parameters.limits,
            may_hover_on=True,
        )

    def _advance(self) -> None:
        """Simulate up to the present, and send messages about reached mission items.

        Raises:
            InputError: The vehicle's state diverges.
        """
        craft = self._craft
        if not craft.flies or time.monotonic() < self._next_s:
            return
        self._next_s += BLOCK_S / self._speed
        was_over = craft.over
        craft.advance()
        item, items = self._item, self.missions.items
        if self._is_followed and not was_over:
            # An item that is not the mission's leads to the next one that is.
            numbers = [n for n, one in enumerate(items) if one is craft.item]
            self._item = len(items) if craft.over else (numbers or [item])[0]
            self._link.send(
                *(
                    message("MISSION_ITEM_REACHED", seq=n)
                    for n in range(item, self._item)
                )
            )
            if self._item != item:
                self._show("MISSION_CURRENT")
        if craft.over and self.mode != MODE_MISSION:
            self.mode = MODE_HOLD

    def _show(self, *names: str) -> None:
        """Send messages of `STREAMS`."""
        craft, home, items = self._craft, self.missions.home, self.missions.items
        if not set(names) <= set(STREAMS):
            raise Unsupported("the message is not supported")
        state, count = PAUSED if self._item else NOT_STARTED, len(items)
        if self._item == count:
            state = COMPLETE if items else NO_MISSION
        elif self.mode == MODE_MISSION and not craft.over:
            state = FLOWN
        landed = IN_MOTION.get(self.mode, IN_AIR) if craft.in_air else ON_GROUND
        sensors = ("present", "enabled", "health")
        fields = {
            "HEARTBEAT": heartbeat(armed=craft.armed, mode=self.mode),
            "AUTOPILOT_VERSION": {"capabilities": PROTOCOLS, "uid": SYSTEM},
            "EXTENDED_SYS_STATE": {"landed_state": landed},
            # After the last item the next start is the first one.
            "MISSION_CURRENT": {
                "seq": self._item % max(count, 1),
                "total": count,
                "mission_state": state,
            },
            "HOME_POSITION": {
                "latitude": round(1e7 * home.lat_deg),
                "longitude": round(1e7 * home.lon_deg),
                "altitude": round(1e3 * home.alt_m),
                "q": [1.0, 0.0, 0.0, 0.0],
            },
            # The model has no battery: the supply does not discharge, and its voltage
            # and current are unknown.
            "SYS_STATUS": {
                **{f"onboard_control_sensors_{one}": HEALTHY for one in sensors},
                "voltage_battery": UNKNOWN,
                "current_battery": -1,
                "battery_remaining": 100,
            },
            **motion_fields(
                craft.time_s, craft.state, craft.throttle, self._frame, home
            ),
        }
        self._link.send(*(message(name, **fields[name]) for name in names))


def _item(command: int, up_m: float | None = None) -> Item:
    """Return an item at the present position, outside of the mission.

    Args:
        command: MAV_CMD.
        up_m: Height above home; None: the present height.
    """
    params = (0.0, 0.0, 0.0, None, None, None, up_m)
    return Item(INSERTED, command, RELATIVE, params)


def _name_of(number: float) -> str:
    """Return the name of a message; empty for an unknown number."""
    kind = dialect().mavlink_map.get(int(number))
    return "" if kind is None else kind.msgname
