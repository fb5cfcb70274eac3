"""A flight as a ULog, its topics called and scaled as PX4 has them.

Where the vehicle was stands in the topics of ground truth; where it took itself to be,
in those of its estimate.
"""

import numpy as np
from jaxtyping import Int

from jblast.autopilot.logs.record import (
    Estimate,
    FlightRecord,
    down,
    right,
    scalar_first,
)
from jblast.autopilot.logs.ulog import Topic, ulog_bytes

ROW_S = 0.02
"""Between two rows, at least."""


def flight_ulog(record: FlightRecord) -> bytes:
    """Return the bytes of a flight's log."""
    rows = record.rows_each(ROW_S)
    time = record.time_s[rows]
    truth = Estimate(record.position_m, record.velocity_m_s, record.quaternion)
    topics = [
        *_motion(record, record.believed, rows, ""),
        *_motion(record, truth, rows, "_groundtruth"),
        Topic(
            "vehicle_angular_velocity",
            time,
            {"xyz": ("float[3]", right(record.body_rate_rad_s[rows]))},
        ),
        Topic(
            "actuator_motors", time, {"control": ("float[4]", record.controls[rows])}
        ),
        Topic(
            "vehicle_status",
            time,
            # 1: disarmed, 2: armed
            {"arming_state": ("uint8_t", 1 + record.armed[rows].astype(np.uint8))},
        ),
    ]
    if record.set_point_m is not None:
        aim = down(record.set_point_m[rows])
        fields = {name: ("float", aim[:, n]) for n, name in enumerate("xyz")}
        topics.append(Topic("vehicle_local_position_setpoint", time, fields))
    facts = {"sys_name": "jblast", "ver_hw": "simulation"}
    return ulog_bytes(topics, facts)


def _motion(
    record: FlightRecord,
    state: Estimate,
    rows: Int[np.ndarray, " row"],
    suffix: str,
) -> list[Topic]:
    """Return the topics of attitude, of local and of global position."""
    time = record.time_s[rows]
    place = state.position_m[rows]
    ned, moves = down(place), down(state.velocity_m_s[rows])
    local = {name: ("float", ned[:, n]) for n, name in enumerate("xyz")}
    local |= {f"v{name}": ("float", moves[:, n]) for n, name in enumerate("xyz")}
    origin = record.frame
    for name, value in (("ref_lat", origin.lat_deg), ("ref_lon", origin.lon_deg)):
        local[name] = ("double", np.full(time.size, value))
    local["ref_alt"] = ("float", np.full(time.size, origin.alt_m))
    for name in ("xy_valid", "z_valid", "v_xy_valid", "v_z_valid"):
        local[name] = ("bool", np.ones(time.size, bool))
    lat, lon, alt = record.geodetic(place).T
    return [
        Topic(
            f"vehicle_attitude{suffix}",
            time,
            {"q": ("float[4]", scalar_first(state.quaternion[rows]))},
        ),
        Topic(f"vehicle_local_position{suffix}", time, local),
        Topic(
            f"vehicle_global_position{suffix}",
            time,
            {"lat": ("double", lat), "lon": ("double", lon), "alt": ("float", alt)},
        ),
    ]
