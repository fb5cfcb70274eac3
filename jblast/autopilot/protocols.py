"""Protocols of MAVLink from the vehicle's side: telemetry, missions, parameters.

Constants are those of MAVLink's common.xml: MAV_TYPE_QUADROTOR, MAV_AUTOPILOT_PX4, and
PX4's modes of the main mode AUTO (px4_custom_mode.h).

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
from typing import Any, NamedTuple

import numpy as np

from jblast.autopilot.mavlink import (
    HEARTBEAT_S,
    answer,
    down,
    euler,
    message,
    place_fields,
    right,
    scalar_first,
)
from jblast.errors import InputError
from jblast.missions.plan import INTEGER_FRAMES, MISSION, Item, Plan, checked_item
from jblast.missions.route import Limits
from jblast.observations.places import Frame
from jblast.scene import Place
from jblast.vehicle import State

# As sent by PX4: MAV_COMP_ID_AUTOPILOT1 of the first vehicle.
SYSTEM, COMPONENT = 1, 1
# MAV_TYPE and MAV_AUTOPILOT
QUADROTOR, PX4 = 2, 12
CUSTOM, GUIDED, SAFETY_ARMED = 1, 8, 128
"""Bits of the base mode."""
AUTO = 4
"""PX4's main mode, third byte of the custom mode."""
MODE_TAKEOFF, MODE_HOLD, MODE_MISSION, MODE_RETURN, MODE_LAND = 2, 3, 4, 5, 6
"""PX4's sub-modes of AUTO, fourth byte of the custom mode."""
STANDBY, ACTIVE = 3, 4
"""MAV_STATE."""
TELEMETRY_STEP_S = 0.1
"""Interval of the telemetry: 10 Hz, as usual over a radio link."""
STREAMS = {
    "ATTITUDE": TELEMETRY_STEP_S,
    "ATTITUDE_QUATERNION": TELEMETRY_STEP_S,
    "GLOBAL_POSITION_INT": TELEMETRY_STEP_S,
    "LOCAL_POSITION_NED": TELEMETRY_STEP_S,
    "VFR_HUD": 2 * TELEMETRY_STEP_S,
    "EXTENDED_SYS_STATE": 2 * TELEMETRY_STEP_S,
    "SYS_STATUS": HEARTBEAT_S,
    "BATTERY_STATUS": HEARTBEAT_S,
    "GPS_RAW_INT": HEARTBEAT_S,
    "HOME_POSITION": HEARTBEAT_S,
    "MISSION_CURRENT": HEARTBEAT_S,
}
"""Messages that are sent periodically, and their default intervals [s]."""
HEALTHY = 0x1 | 0x2 | 0x4 | 0x8 | 0x20 | 0x200000 | 0x2000000 | 0x10000000
"""MAV_SYS_STATUS_SENSOR: gyroscope, accelerometer, magnetometer, barometer, GPS, state
estimate, battery, checks before arming."""
ON_GROUND, IN_AIR, TAKING_OFF, LANDING = 1, 2, 3, 4
"""MAV_LANDED_STATE."""
LANDED_UP_M = 0.2
"""Height below which the vehicle is on the ground; its centre rests below this."""
NO_MISSION, NOT_STARTED, FLOWN, PAUSED, COMPLETE = 1, 2, 3, 4, 5
"""MISSION_STATE."""
UNKNOWN = 65_535
"""MAVLink's code for an unknown 16-bit number."""
FIX_3D = 3
"""GPS_FIX_TYPE."""
SATELLITES = 10
"""Number of visible satellites; declared, the simulated GPS has a fix throughout."""
# MAV_PROTOCOL_CAPABILITY: MISSION_INT, COMMAND_INT, PARAM_ENCODE_BYTEWISE, MAVLINK2.
CAPABILITIES = 0x4 | 0x8 | 0x10 | 0x2000

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
TAKEOFF_UP_M = 2.5
"""Height of a take-off above home: PX4's default."""
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


def heartbeat(*, armed: bool, mode: int) -> Any:
    """Return the heartbeat of the vehicle."""
    return message(
        "HEARTBEAT",
        type=QUADROTOR,
        autopilot=PX4,
        base_mode=CUSTOM | GUIDED | (SAFETY_ARMED if armed else 0),
        custom_mode=AUTO << 16 | mode << 24,
        system_status=ACTIVE if armed else STANDBY,
        mavlink_version=3,
    )


class Status(NamedTuple):
    """State of a vehicle, as shown to a ground station.

    Attributes:
        time_s: Time of flight.
        state: Position, velocity, attitude, body rate and rotor speeds.
        throttle: Mean rotor speed as a share of the maximum.
        frame: Geodetic frame of the scene.
        armed: True if armed.
        mode: PX4's sub-mode of AUTO.
        item: Number of the current mission item.
        items: Number of mission items.
        mission_state: MISSION_STATE.
        home: Position of the take-off.
    """

    time_s: float
    state: State
    throttle: float
    frame: Frame
    armed: bool
    mode: int
    item: int
    items: int
    mission_state: int
    home: Place


def telemetry(now: Status) -> dict[str, dict[str, Any]]:
    """Return the fields of each message of `STREAMS`."""
    state = now.state
    quaternion = scalar_first(np.asarray(state.quaternion))
    roll, pitch, yaw = euler(quaternion).tolist()
    boot = {"time_boot_ms": round(1e3 * now.time_s)}
    turning = _named(
        ("rollspeed", "pitchspeed", "yawspeed"),
        right(np.asarray(state.body_rate_rad_s)),
    )
    position, moves = np.asarray(state.position_m), down(np.asarray(state.velocity_m_s))
    place = place_fields(now.frame, position)
    alt = place["alt"] / 1e3
    heading, speed = math.degrees(yaw) % 360, float(np.hypot(*moves[:2]))
    # Integer centimetres per second, north, east, down, in 16 bits.
    whole = np.clip(np.round(100 * moves), -32_767, 32_767).astype(int)
    moving = {MODE_TAKEOFF: TAKING_OFF, MODE_LAND: LANDING}
    landed = moving.get(now.mode, IN_AIR) if now.armed else IN_AIR
    names = ("present", "enabled", "health")
    return {
        "ATTITUDE": boot | turning | {"roll": roll, "pitch": pitch, "yaw": yaw},
        "ATTITUDE_QUATERNION": boot
        | turning
        | _named(("q1", "q2", "q3", "q4"), quaternion),
        "GLOBAL_POSITION_INT": {
            **(boot | place | _named(("vx", "vy", "vz"), whole)),
            "relative_alt": round(1e3 * (alt - now.home.alt_m)),
            "hdg": round(100 * heading) % 36_000,
        },
        "LOCAL_POSITION_NED": boot
        | _named(("x", "y", "z"), down(position))
        | _named(("vx", "vy", "vz"), moves),
        "VFR_HUD": {
            "airspeed": speed,
            "groundspeed": speed,
            "heading": round(heading) % 360,
            "throttle": round(100 * now.throttle),
            "alt": alt,
            "climb": -float(moves[2]),
        },
        "GPS_RAW_INT": {
            **place,
            **dict.fromkeys(("eph", "epv", "cog"), UNKNOWN),
            "time_usec": round(1e6 * now.time_s),
            "fix_type": FIX_3D,
            "vel": min(round(100 * speed), UNKNOWN - 1),
            "satellites_visible": SATELLITES,
        },
        "EXTENDED_SYS_STATE": {
            "landed_state": landed if position[2] > LANDED_UP_M else ON_GROUND
        },
        "MISSION_CURRENT": {
            "seq": now.item,
            "total": now.items,
            "mission_state": now.mission_state,
        },
        "HOME_POSITION": {
            "latitude": round(1e7 * now.home.lat_deg),
            "longitude": round(1e7 * now.home.lon_deg),
            "altitude": round(1e3 * now.home.alt_m),
            "q": [1.0, 0.0, 0.0, 0.0],
        },
        # The model has no battery: the supply does not discharge, and its voltage and
        # current are unknown.
        "BATTERY_STATUS": {
            "voltages": [UNKNOWN] * 10,
            "temperature": 32_767,
            "battery_function": 1,
            "current_battery": -1,
            "current_consumed": -1,
            "energy_consumed": -1,
            "battery_remaining": 100,
            "charge_state": 1,
        },
        "SYS_STATUS": {
            **{f"onboard_control_sensors_{one}": HEALTHY for one in names},
            "voltage_battery": UNKNOWN,
            "current_battery": -1,
            "battery_remaining": 100,
        },
    }


def _named(names: tuple[str, ...], numbers: np.ndarray) -> dict[str, Any]:
    return dict(zip(names, numbers.tolist(), strict=True))


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
        self._upload: Any = None  # first message of an upload

    @property
    def items(self) -> tuple[Item, ...]:
        """Items of the plan."""
        return () if self.plan is None else self.plan.items

    def answer(self, received: Any, now_s: float) -> list[Any]:
        """Return the answers to a message of the protocol.

        Args:
            received: Received message.
            now_s: Time on the wall clock.
        """
        name, kind = received.get_type(), getattr(received, "mission_type", FLIGHT_PLAN)
        # Of geofences and rally points none exist and none are accepted.
        mission = kind == FLIGHT_PLAN
        if name == "MISSION_REQUEST_LIST":
            count = len(self.items) if mission else 0
            return [answer(received, "MISSION_COUNT", count=count, mission_type=kind)]
        if name in ("MISSION_COUNT", "MISSION_CLEAR_ALL"):
            count = getattr(received, "count", 0)
            if mission:
                return [self._begin(received, count, now_s)]
            return [_ack(received, MISSION_UNSUPPORTED if count else MISSION_ACCEPTED)]
        if name in ("MISSION_REQUEST_INT", "MISSION_REQUEST"):
            if not (mission and received.seq < len(self.items)):
                return [_ack(received, SEQUENCE)]
            fields = item_fields(self.items[received.seq], received.seq)
            return [answer(received, "MISSION_ITEM_INT", **fields)]
        if name == "MISSION_ITEM_INT":
            return [self._take(received, now_s)]
        return []

    def remind(self, now_s: float) -> list[Any]:
        """Return a repeated request for a missing item, or an error after retries."""
        if self._items is None or now_s - self._requested_s < RETRY_S:
            return []
        self._tries += 1
        if self._tries > RETRIES:
            self._report_text(f"upload: item {len(self._items)} missing, given up")
            self._items = None
            return [_ack(self._upload, ERROR)]
        return [self._ask(now_s)]

    def _begin(self, received: Any, count: int, now_s: float) -> Any:
        """Begin an upload; one without items clears the mission."""
        if count > MAX_ITEMS:
            self._report_text(
                f"upload: expected at most {MAX_ITEMS} items, got {count}"
            )
            return _ack(received, NO_SPACE)
        if count == 0:
            self.plan, self._items = None, None
            return _ack(received, MISSION_ACCEPTED)
        self._items, self._count, self._upload, self._tries = [], count, received, 0
        return self._ask(now_s)

    def _take(self, received: Any, now_s: float) -> Any:
        """Take an item of an upload."""
        items = self._items
        if items is None:
            self._report_text("mission item: expected a requested item, got another")
            return _ack(received, SEQUENCE)
        # An item was lost or sent twice: the protocol repeats the request.
        if received.seq != len(items):
            return self._ask(now_s)
        try:
            items.append(item_of(received))
            if len(items) < self._count:
                self._tries = 0
                return self._ask(now_s)
            plan = Plan(items=tuple(items), home=self.home, source=UPLOADED)
            self._check(plan)
        except InputError as error:
            self._report_text(str(error))
            # A complete list means that the plan is invalid; before, a single item is.
            whole, self._items = len(items) == self._count, None
            return _ack(received, INVALID if whole else MISSION_UNSUPPORTED)
        # Only a complete and valid upload replaces the plan in use.
        self.plan, self._items = plan, None
        if plan.ignored:
            self._report_text(plan.ignored)
        return _ack(received, MISSION_ACCEPTED)

    def _ask(self, now_s: float) -> Any:
        self._requested_s = now_s
        return answer(self._upload, "MISSION_REQUEST_INT", seq=len(self._items or []))


class Parameters:
    """Parameters of a vehicle, and the vehicle's side of the parameter protocol."""

    def __init__(self):
        self._values = dict(DEFAULTS)

    @property
    def takeoff_up_m(self) -> float:
        """Height of a take-off above home."""
        return self._values[TAKEOFF_PARAMETER]

    def answer(self, received: Any) -> list[Any]:
        """Return the answers to a message of the protocol."""
        kind, names = received.get_type(), [*self._values]
        if kind == "PARAM_REQUEST_LIST":
            return [self._value(name) for name in names]
        if kind not in ("PARAM_REQUEST_READ", "PARAM_SET"):
            return []
        name, index = received.param_id, getattr(received, "param_index", -1)
        if 0 <= index < len(names):
            name = names[index]
        sent, known = [], name in self._values
        value = getattr(received, "param_value", None)
        if name == TAKEOFF_PARAMETER and value is not None and value > 0:
            self._values[name] = value
        elif value is not None or not known:
            error = READ_ONLY if known else NOT_FOUND
            fields = {"param_id": name, "param_index": index, "error": error}
            sent.append(answer(received, "PARAM_ERROR", **fields))
        # After an error, too: clients without that message expect the unchanged value.
        return [*sent, self._value(name)] if known else sent

    def _value(self, name: str) -> Any:
        value = self._values[name]
        whole = isinstance(value, int)
        # Integers are sent with their bits in the field of single precision.
        bits = struct.unpack("<f", struct.pack("<i", value))[0] if whole else value
        return message(
            "PARAM_VALUE",
            param_id=name,
            param_value=bits,
            param_type=PARAM_INT if whole else PARAM_FLOAT,
            param_count=len(self._values),
            param_index=[*self._values].index(name),
        )


def _ack(received: Any, result: int) -> Any:
    kind = getattr(received, "mission_type", FLIGHT_PLAN)
    return answer(received, "MISSION_ACK", type=result, mission_type=kind)


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


def item_of(received: Any) -> Item:
    """Return the item of a MISSION_ITEM_INT.

    Raises:
        InputError: As in `checked_item`.
    """
    # Without a position both are parameters, which have no scale.
    scale = 1 if received.frame == MISSION else 1e7
    place = [received.x / scale, received.y / scale, received.z]
    params = [*(getattr(received, f"param{n}") for n in range(1, 5)), *place]
    head = (received.seq, received.command, received.frame)
    return checked_item(UPLOADED, *head, params, bool(received.autocontinue))
