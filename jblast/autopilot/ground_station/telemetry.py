"""What a vehicle tells a ground station of itself, as messages.

Numbers are those of MAVLink's common.xml: MAV_TYPE_QUADROTOR, MAV_AUTOPILOT_PX4, and
PX4's modes of the main mode AUTO (px4_custom_mode.h).
"""

from collections.abc import Iterator

import numpy as np
from jaxtyping import Float

from jblast.autopilot.logs.record import FlightRecord, down, euler, right, scalar_first
from jblast.autopilot.logs.tlog import stamped
from jblast.autopilot.mavlink.wire import Sender

SYSTEM, COMPONENT = 1, 1
QUADROTOR, PX4 = 2, 12
CUSTOM, GUIDED, SAFETY_ARMED = 1, 8, 128
"""Bits of the base mode."""
MODE_MISSION, MODE_LOITER = 4 << 16 | 4 << 24, 4 << 16 | 3 << 24
STANDBY, ACTIVE = 3, 4
EACH_S = 0.1
"""Between two rows of telemetry."""
HEARTBEAT_S = 1.0


def heartbeat(sender: Sender, *, armed: bool, has_mission: bool) -> bytes:
    """Return the message that says a vehicle is there."""
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
        record: The flight; what it tells is what the vehicle takes for its state.
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
                **_speeds(self._moves[row]),
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


def _speeds(ned_m_s: Float[np.ndarray, "3"]) -> dict[str, int]:
    """Return whole centimetres a second, north, east, down."""
    whole = np.clip(np.round(100 * ned_m_s), -32_767, 32_767).astype(int)
    return dict(zip(("vx", "vy", "vz"), whole.tolist(), strict=True))
