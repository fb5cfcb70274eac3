"""Telemetry of a vehicle for a ground station.

Constants are those of MAVLink's common.xml: MAV_TYPE_QUADROTOR, MAV_AUTOPILOT_PX4, and
PX4's modes of the main mode AUTO (px4_custom_mode.h).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from jblast.autopilot.flight_record import (
    FlightRecord,
    down,
    euler,
    right,
    scalar_first,
)
from jblast.autopilot.mavlink import Sender
from jblast.scene import Place

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
"""Interval between two rows of telemetry: 10 Hz, as usual over a radio link."""
HEARTBEAT_S = 1.0
"""Interval between two heartbeats: the protocol's rate."""
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


@dataclass(frozen=True)
class VehicleStatus:
    """Status of the vehicle besides its motion.

    Attributes:
        armed: True if armed.
        mode: PX4's sub-mode of AUTO.
        item: Number of the current mission item.
        items: Number of mission items.
        mission_state: MISSION_STATE.
        home: Position of the take-off.
    """

    armed: bool
    mode: int
    item: int
    items: int
    mission_state: int
    home: Place


def heartbeat(sender: Sender, *, armed: bool, mode: int) -> bytes:
    """Return the heartbeat of the vehicle."""
    return sender.pack(
        "HEARTBEAT",
        type=QUADROTOR,
        autopilot=PX4,
        base_mode=CUSTOM | GUIDED | (SAFETY_ARMED if armed else 0),
        custom_mode=AUTO << 16 | mode << 24,
        system_status=ACTIVE if armed else STANDBY,
        mavlink_version=3,
    )


class Telemetry:
    """Telemetry messages of a flight's rows.

    Attributes:
        record: The flight.
        last: Last row to send.

    Args:
        record: As above.
        last: As above; None: the last row of the flight.
    """

    def __init__(self, record: FlightRecord, last: int | None = None):
        self.record = record
        self.last = record.time_s.size - 1 if last is None else last
        self._quaternions = scalar_first(record.quaternion)
        self._angles = euler(self._quaternions)
        self._rates = right(record.body_rate_rad_s)
        self._places = record.geodetic(record.position_m)
        self._ups = record.position_m[:, 2] - record.position_m[0, 2]
        self._moves = down(record.velocity_m_s)
        self._positions = down(record.position_m)

    @property
    def end_s(self) -> float:
        """Time of the last row to send."""
        return float(self.record.time_s[self.last])

    def row_at(self, time_s: float) -> int:
        """Return the last row up to a time."""
        # 1e-9 s for the rounding of a product of speed and clock time.
        after = np.searchsorted(self.record.time_s, time_s + 1e-9, side="right")
        return int(np.clip(after - 1, 0, self.last))

    def frame(self, sender: Sender, name: str, row: int, now: VehicleStatus) -> bytes:
        """Return a message of `STREAMS`.

        Args:
            sender: Packs the message.
            name: Name of the message.
            row: Row of the flight.
            now: Status of the vehicle.
        """
        values = self._of_row(name, row) or self._of_status(name, row, now)
        return sender.pack(name, **values)

    def _of_row(self, name: str, row: int) -> dict[str, Any]:
        """Return the fields of a message about the motion; {} for others."""
        boot = round(1e3 * float(self.record.time_s[row]))
        angles, rates = self._angles[row].tolist(), self._rates[row].tolist()
        turning = dict(zip(("rollspeed", "pitchspeed", "yawspeed"), rates, strict=True))
        lat, lon, alt = self._places[row].tolist()
        north, east, below = self._moves[row].tolist()
        heading = float(np.degrees(angles[2]) % 360)
        if name == "ATTITUDE":
            roll, pitch, yaw = angles
            return {
                **{"time_boot_ms": boot, "roll": roll, "pitch": pitch, "yaw": yaw},
                **turning,
            }
        if name == "ATTITUDE_QUATERNION":
            parts = self._quaternions[row].tolist()
            whole = dict(zip(("q1", "q2", "q3", "q4"), parts, strict=True))
            return {"time_boot_ms": boot, **whole, **turning}
        if name == "GLOBAL_POSITION_INT":
            # Integer centimetres per second, north, east, down, in 16 bits.
            moves = np.clip(np.round(100 * self._moves[row]), -32_767, 32_767)
            return {
                "time_boot_ms": boot,
                "lat": round(1e7 * lat),
                "lon": round(1e7 * lon),
                "alt": round(1e3 * alt),
                "relative_alt": round(1e3 * float(self._ups[row])),
                "hdg": round(100 * heading) % 36_000,
                **dict(zip(("vx", "vy", "vz"), map(int, moves), strict=True)),
            }
        if name == "LOCAL_POSITION_NED":
            both = [*self._positions[row].tolist(), north, east, below]
            fields = ("x", "y", "z", "vx", "vy", "vz")
            return {"time_boot_ms": boot, **dict(zip(fields, both, strict=True))}
        if name == "VFR_HUD":
            return {
                "airspeed": float(np.hypot(north, east)),
                "groundspeed": float(np.hypot(north, east)),
                "heading": round(heading) % 360,
                "throttle": round(100 * float(self.record.controls[row].mean())),
                "alt": alt,
                "climb": -below,
            }
        if name == "GPS_RAW_INT":
            return {
                "time_usec": 1000 * boot,
                "fix_type": FIX_3D,
                "lat": round(1e7 * lat),
                "lon": round(1e7 * lon),
                "alt": round(1e3 * alt),
                **dict.fromkeys(("eph", "epv", "cog"), UNKNOWN),
                "vel": min(round(100 * float(np.hypot(north, east))), UNKNOWN - 1),
                "satellites_visible": SATELLITES,
            }
        return {}

    def _of_status(self, name: str, row: int, now: VehicleStatus) -> dict[str, Any]:
        """Return the fields of a message about the vehicle's status."""
        if name == "EXTENDED_SYS_STATE":
            moving = {MODE_TAKEOFF: TAKING_OFF, MODE_LAND: LANDING}
            state = moving.get(now.mode, IN_AIR) if now.armed else IN_AIR
            return {"landed_state": state if self.in_air(row) else ON_GROUND}
        if name == "MISSION_CURRENT":
            return {
                "seq": now.item,
                "total": now.items,
                "mission_state": now.mission_state,
            }
        if name == "HOME_POSITION":
            return {
                "latitude": round(1e7 * now.home.lat_deg),
                "longitude": round(1e7 * now.home.lon_deg),
                "altitude": round(1e3 * now.home.alt_m),
                "q": [1.0, 0.0, 0.0, 0.0],
            }
        # The model has no battery: the supply does not discharge, and its voltage and
        # current are unknown.
        if name == "BATTERY_STATUS":
            return {
                "voltages": [UNKNOWN] * 10,
                "temperature": 32_767,
                "battery_function": 1,
                "current_battery": -1,
                "current_consumed": -1,
                "energy_consumed": -1,
                "battery_remaining": 100,
                "charge_state": 1,
            }
        names = ("present", "enabled", "health")
        return {
            **{f"onboard_control_sensors_{one}": HEALTHY for one in names},
            "voltage_battery": UNKNOWN,
            "current_battery": -1,
            "battery_remaining": 100,
        }

    def item(self, row: int) -> int:
        """Return the index of the current item of the plan as flown."""
        return int(self.record.item[row])

    def armed(self, row: int) -> bool:
        """Return whether the vehicle is armed."""
        return bool(self.record.armed[row])

    def in_air(self, row: int) -> bool:
        """Return whether the vehicle is above the ground."""
        return bool(self.record.position_m[row, 2] > LANDED_UP_M)
