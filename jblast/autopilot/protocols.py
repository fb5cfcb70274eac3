"""Protocols of MAVLink from the vehicle's side: missions, parameters, motion.

The mission protocol is mavlink.io/en/services/mission.html. To upload, a station sends
the number of items, which the vehicle then requests one by one. An item out of sequence
is ignored and the right one requested again. On loopback no message is lost, so that
nothing is repeated after a time. An invalid mission is rejected as a whole, and the
previous one remains.

The parameter protocol is mavlink.io/en/services/parameter.html, with PX4's names.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from jblast.autopilot.mavlink import (
    FIX,
    answer,
    down,
    euler,
    message,
    named,
    place_fields,
    right,
    scalar_first,
    whole,
)
from jblast.errors import InputError
from jblast.missions.plan import INTEGER_FRAMES, MISSION, Item, Plan, checked_item
from jblast.missions.route import Limits
from jblast.observations.places import Frame
from jblast.scene import Place
from jblast.vehicle import State

UNKNOWN = 65_535
"""MAVLink's code for an unknown 16-bit number."""
MISSION_ACCEPTED, MISSION_UNSUPPORTED, INVALID, SEQUENCE = 0, 3, 5, 13
"""MAV_MISSION_RESULT."""
FLIGHT_PLAN = 0
"""MAV_MISSION_TYPE of a mission; geofences and rally points have other numbers."""
FRAME_CODES = {frame: code for code, frame in INTEGER_FRAMES.items()}
"""Frames of sent items, whose coordinates are integers. PX4 sends the same, and MAVSDK
3 accepts no others."""
UPLOADED = "uploaded mission"
NOT_FOUND, OUT_OF_RANGE = 1, 2
"""MAV_PARAM_ERROR."""
PARAM_FLOAT = 9
"""MAV_PARAM_TYPE of single precision."""
TAKEOFF_PARAMETER, TAKEOFF_UP_M = "MIS_TAKEOFF_ALT", 2.5
"""Height of a take-off above home: PX4's name and default."""
LIMITS = {
    "MPC_ACC_HOR": "acceleration_m_s2",
    "MPC_LAND_ALT2": "slow_below_m",
    "MPC_LAND_SPEED": "landing_m_s",
    "MPC_XY_CRUISE": "speed_m_s",
    "MPC_Z_V_AUTO_DN": "descent_m_s",
    "MPC_Z_V_AUTO_UP": "climb_m_s",
    "RTL_RETURN_ALT": "return_m",
}
"""Limits of missions by PX4's names."""


def motion_fields(
    time_s: float, state: State, throttle: float, frame: Frame, home: Place
) -> dict[str, dict[str, Any]]:
    """Return the fields of each message about the motion of a vehicle.

    Args:
        time_s: Time of flight.
        state: State of the vehicle.
        throttle: Mean rotor speed as a share of the maximum.
        frame: Geodetic frame of the scene.
        home: Position of the take-off.
    """
    quaternion = scalar_first(np.asarray(state.quaternion))
    roll, pitch, yaw = euler(quaternion).tolist()
    rates = ("rollspeed", "pitchspeed", "yawspeed")
    turning = {
        "time_boot_ms": round(1e3 * time_s),
        **named(rates, right(np.asarray(state.body_rate_rad_s))),
    }
    position, moves = np.asarray(state.position_m), down(np.asarray(state.velocity_m_s))
    place = place_fields(frame, position)
    alt, speed = place["alt"] / 1e3, float(np.hypot(*moves[:2]))
    heading = math.degrees(yaw) % 360
    local = np.concatenate([down(position), moves])
    return {
        "ATTITUDE": turning | {"roll": roll, "pitch": pitch, "yaw": yaw},
        "ATTITUDE_QUATERNION": turning | named(("q1", "q2", "q3", "q4"), quaternion),
        "GLOBAL_POSITION_INT": {
            "time_boot_ms": turning["time_boot_ms"],
            **place,
            **whole(("vx", "vy", "vz"), 100 * moves),
            "relative_alt": round(1e3 * (alt - home.alt_m)),
            "hdg": round(100 * heading) % 36_000,
        },
        "LOCAL_POSITION_NED": {
            "time_boot_ms": turning["time_boot_ms"],
            **named(("x", "y", "z", "vx", "vy", "vz"), local),
        },
        "VFR_HUD": {
            "airspeed": speed,
            "groundspeed": speed,
            "heading": round(heading) % 360,
            "throttle": round(100 * throttle),
            "alt": alt,
            "climb": -float(moves[2]),
        },
        "GPS_RAW_INT": {
            **FIX,
            **place,
            **dict.fromkeys(("eph", "epv", "cog"), UNKNOWN),
            "time_usec": round(1e6 * time_s),
            "vel": min(round(100 * speed), UNKNOWN - 1),
        },
    }


class Missions:
    """Mission of a vehicle, and the vehicle's side of the mission protocol.

    Attributes:
        plan: Current mission; None: no mission.
        home: Position of the vehicle before take-off.

    Args:
        plan: Initial mission.
        home: As above.
        check: Raises `InputError` for an invalid plan.
        report: Receives text for the ground station.
    """

    def __init__(
        self,
        plan: Plan | None,
        home: Place,
        check: Callable[[Plan], object],
        report: Callable[[str], object],
    ):
        self.plan, self.home = plan, home
        self._check, self._report = check, report
        self._uploaded: list[Item] | None = None
        self._count = 0

    @property
    def items(self) -> tuple[Item, ...]:
        """Items of the plan."""
        return () if self.plan is None else self.plan.items

    def answer(self, received: Any) -> Any | None:
        """Return the answer to a message of the protocol; None: it has none."""
        name, kind = received.get_type(), getattr(received, "mission_type", FLIGHT_PLAN)
        # Of geofences and rally points none exist and none are accepted.
        items = self.items if kind == FLIGHT_PLAN else tuple[Item, ...]()
        if name == "MISSION_REQUEST_LIST":
            count = {"count": len(items), "mission_type": kind}
            return answer(received, "MISSION_COUNT", **count)
        if name in ("MISSION_REQUEST_INT", "MISSION_REQUEST"):
            if received.seq >= len(items):
                return _ack(received, SEQUENCE)
            fields = item_fields(items[received.seq], received.seq)
            return answer(received, "MISSION_ITEM_INT", **fields)
        if name in ("MISSION_COUNT", "MISSION_CLEAR_ALL"):
            count = getattr(received, "count", 0)
            if kind != FLIGHT_PLAN:
                result = MISSION_UNSUPPORTED if count else MISSION_ACCEPTED
                return _ack(received, result)
            self._uploaded, self._count = [], count
            return self._next(received, [])
        if name != "MISSION_ITEM_INT":
            return None
        if self._uploaded is None:
            return _ack(received, SEQUENCE)
        try:
            if received.seq == len(self._uploaded):
                self._uploaded.append(item_of(received))
            return self._next(received, self._uploaded)
        except InputError as error:
            self._report(str(error))
            self._uploaded = None
            return _ack(received, INVALID)

    def _next(self, received: Any, items: list[Item]) -> Any:
        """Request the next item of an upload, or replace the mission by a whole one.

        Raises:
            InputError: The mission is invalid.
        """
        if len(items) < self._count:
            return answer(received, "MISSION_REQUEST_INT", seq=len(items))
        plan = None
        if items:
            plan = Plan(items=tuple(items), home=self.home, source=UPLOADED)
            self._check(plan)
            if plan.ignored:
                self._report(plan.ignored)
        self.plan, self._uploaded = plan, None
        return _ack(received, MISSION_ACCEPTED)


class Parameters:
    """Parameters of a vehicle, and the vehicle's side of the parameter protocol."""

    def __init__(self):
        defaults = Limits()
        self._values: dict[str, float] = {TAKEOFF_PARAMETER: TAKEOFF_UP_M}
        self._values |= {
            name: getattr(defaults, field) for name, field in LIMITS.items()
        }

    @property
    def takeoff_up_m(self) -> float:
        """Height of a take-off above home."""
        return self._values[TAKEOFF_PARAMETER]

    @property
    def limits(self) -> Limits:
        """Limits of missions."""
        return Limits(**{field: self._values[name] for name, field in LIMITS.items()})

    def answer(self, received: Any) -> list[Any]:
        """Return the answers to a message of the protocol."""
        kind, names = received.get_type(), [*self._values]
        if kind == "PARAM_REQUEST_LIST":
            return [self._value(name) for name in names]
        if kind not in ("PARAM_REQUEST_READ", "PARAM_SET"):
            return []
        index = getattr(received, "param_index", -1)
        name = names[index] if 0 <= index < len(names) else received.param_id
        error = 0 if name in names else NOT_FOUND
        if kind == "PARAM_SET" and not error:
            if (
                received.param_type == PARAM_FLOAT
                and 0 < received.param_value < math.inf
            ):
                self._values[name] = received.param_value
            else:
                error = OUT_OF_RANGE
        fields = {"param_id": name, "param_index": index, "error": error}
        sent = [answer(received, "PARAM_ERROR", **fields)] if error else []
        # After an error, too: clients without that message expect the unchanged value.
        return [*sent, self._value(name)] if name in names else sent

    def _value(self, name: str) -> Any:
        return message(
            "PARAM_VALUE",
            param_id=name,
            param_value=self._values[name],
            param_type=PARAM_FLOAT,
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
