"""Logs of flights: MAVLink's `.tlog` and PX4's ULog.

A `.tlog` is a sequence of times and frames. A time has the format of MAVLink's tools:
microseconds in eight bytes, big-endian.

A ULog (docs.px4.io/main/en/dev_log/ulog_file_format.html, version 1) has a header;
definitions (formats of topics, information); then subscriptions and rows. Fields are
ordered from the widest to the narrowest, so that none needs padding. Names and units of
topics are those of PX4: the true state is in the topics of ground truth, the estimated
one in those of the estimate.
"""

import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from jblast.errors import InputError
from jblast.missions.mission import geodetic
from jblast.observations.places import Frame

ROW_S = 0.02
"""Minimum interval between two rows: 50 Hz, PX4's order for these topics."""
MAGIC = b"ULog\x01\x12\x35\x01"
_TYPES = {"float": "<f4", "double": "<f8", "bool": "?", "uint8_t": "u1"}
_WIDTH = {"double": 8, "float": 4, "bool": 1, "uint8_t": 1}


@dataclass(frozen=True)
class Estimate:
    """Estimated state of a vehicle at each row.

    Attributes:
        position_m: East, north, up.
        velocity_m_s: East, north, up.
        quaternion: Body to world (x, y, z, w).
    """

    position_m: Float[np.ndarray, "time 3"]
    velocity_m_s: Float[np.ndarray, "time 3"]
    quaternion: Float[np.ndarray, "time 4"]


@dataclass(frozen=True)
class FlightRecord:
    """A flight.

    Attributes:
        time_s: Times of the rows, from 0 on.
        position_m: East, north, up.
        velocity_m_s: East, north, up.
        quaternion: Body to world (x, y, z, w).
        body_rate_rad_s: About the body's axes: forward, left, up.
        controls: Rotor speeds as shares of the maximum speed.
        armed: True where the vehicle is armed.
        item: Number of the current mission item; 0 without a mission.
        frame: Geodetic frame of the origin.
        set_point_m: Position set point; None: unknown.
        estimate: Estimated state; None: the true state is used.
    """

    time_s: Float[np.ndarray, " time"]
    position_m: Float[np.ndarray, "time 3"]
    velocity_m_s: Float[np.ndarray, "time 3"]
    quaternion: Float[np.ndarray, "time 4"]
    body_rate_rad_s: Float[np.ndarray, "time 3"]
    controls: Float[np.ndarray, "time 4"]
    armed: Bool[np.ndarray, " time"]
    item: Int[np.ndarray, " time"]
    frame: Frame
    set_point_m: Float[np.ndarray, "time 3"] | None = None
    estimate: Estimate | None = None

    @property
    def estimated(self) -> Estimate:
        """Estimated state, or the true state without an estimate."""
        return self.estimate or Estimate(
            self.position_m, self.velocity_m_s, self.quaternion
        )

    def geodetic(
        self, position_m: Float[np.ndarray, "*place 3"]
    ) -> Float[np.ndarray, "*place 3"]:
        """Return latitude, longitude [degree] and height [m] of positions."""
        return geodetic(self.frame, position_m)

    def rows_each(self, step_s: float) -> Int[np.ndarray, " row"]:
        """Return the rows that follow multiples of a step, including first and last."""
        times = np.arange(0.0, self.time_s[-1], step_s)
        rows = np.searchsorted(self.time_s, times - 1e-9)
        return np.unique(np.append(rows, self.time_s.size - 1))


def flight_ulog(record: FlightRecord) -> bytes:
    """Return the bytes of a flight's log."""
    rows = record.rows_each(ROW_S)
    time = record.time_s[rows]
    truth = Estimate(record.position_m, record.velocity_m_s, record.quaternion)
    topics = [
        *_motion(record, record.estimated, rows, ""),
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


class Topic(NamedTuple):
    """Rows of one ULog topic.

    Attributes:
        name: PX4's name of the topic.
        time_s: Times of the rows.
        fields: Type, such as "float" or "float[4]", and values, by name.
    """

    name: str
    time_s: Float[np.ndarray, " row"]
    fields: Mapping[str, tuple[str, np.ndarray]]


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


def ulog_bytes(
    topics: Sequence[Topic],
    facts: Mapping[str, str],
    messages: Sequence[tuple[float, str]] = (),
) -> bytes:
    """Return the bytes of a log.

    Args:
        topics: Topics with their rows.
        facts: Information texts by name, such as `sys_name`.
        messages: Logged messages with their times [s].
    """
    # Flag bits (B) must be the first message: no compatibility flags, no appended data.
    parts = [MAGIC, struct.pack("<Q", 0), _message("B", bytes(40))]
    for name, text in facts.items():
        value = text.encode()
        key = f"char[{len(value)}] {name}".encode()
        parts.append(_message("I", bytes([len(key)]) + key + value))

    def width(item: tuple[str, tuple[str, np.ndarray]]) -> int:
        return -_WIDTH[item[1][0].partition("[")[0]]

    # widest fields first, so that they need no padding
    ordered = [
        topic._replace(fields=dict(sorted(topic.fields.items(), key=width)))
        for topic in topics
    ]
    for topic in ordered:
        text = f"{topic.name}:uint64_t timestamp;"
        text += "".join(f"{kind} {name};" for name, (kind, _) in topic.fields.items())
        parts.append(_message("F", text.encode()))
    for number, topic in enumerate(ordered):
        # Subscriptions (A): multi-instance id 0, then the number that rows of the topic
        # refer to.
        head = struct.pack("<BH", 0, number)
        parts.append(_message("A", head + topic.name.encode()))
    rows = [row for n, topic in enumerate(ordered) for row in _rows(topic, n)]
    for time_s, text in messages:
        stamp = _stamp(time_s)
        logged = struct.pack("<BQ", ord("6"), stamp) + text.encode()
        rows.append((stamp, _message("L", logged)))
    # stable: rows of equal time keep the order of the topics
    rows.sort(key=lambda row: row[0])
    return b"".join([*parts, *(data for _, data in rows)])


def _rows(topic: Topic, number: int) -> list[tuple[int, bytes]]:
    """Return each row's time [us] and message."""
    parts: list[tuple] = [
        ("size", "<u2"),
        ("kind", "u1"),
        ("number", "<u2"),
        ("timestamp", "<u8"),
    ]
    for name, (kind, _) in topic.fields.items():
        plain, bracket, count = kind.partition("[")
        shape = (int(count.removesuffix("]")),) if bracket else ()
        parts.append((name, _TYPES[plain], shape))
    layout = np.dtype(parts)
    rows = np.zeros(topic.time_s.size, layout)
    # the size excludes the header: two bytes of size and one of kind
    rows["size"], rows["kind"], rows["number"] = layout.itemsize - 3, ord("D"), number
    rows["timestamp"] = [_stamp(t) for t in topic.time_s]
    for name, (_, values) in topic.fields.items():
        rows[name] = values
    whole, size = rows.tobytes(), layout.itemsize
    stamps = rows["timestamp"].tolist()
    return [(t, whole[n * size : (n + 1) * size]) for n, t in enumerate(stamps)]


def _message(kind: str, content: bytes) -> bytes:
    return struct.pack("<HB", len(content), ord(kind)) + content


def _stamp(time_s: float) -> int:
    return round(1e6 * float(time_s))


def stamped(time_s: float, frame: bytes) -> bytes:
    """Return a frame of a log with its time in front [s]."""
    return struct.pack(">Q", round(1e6 * time_s)) + frame


class TelemetryLog:
    """A log written during a flight, so that an interruption leaves a valid file.

    Args:
        path: The file, which is overwritten.

    Raises:
        InputError: The file cannot be written.
    """

    def __init__(self, path: str | Path):
        self.now_s = 0.0
        try:
            self._file = Path(path).open("wb")  # noqa: SIM115 - closed by the context
        except OSError as error:
            raise InputError(
                f"{path}: cannot be written: {error.strerror or error}"
            ) from None

    def keep(self, frame: bytes) -> None:
        """Write a frame with the current time."""
        self._file.write(stamped(self.now_s, frame))

    def __enter__(self) -> "TelemetryLog":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._file.close()


def down(vectors: Float[np.ndarray, "*row 3"]) -> Float[np.ndarray, "*row 3"]:
    """Return north, east, down of east, north, up."""
    return np.stack([vectors[..., 1], vectors[..., 0], -vectors[..., 2]], axis=-1)


def right(vectors: Float[np.ndarray, "*row 3"]) -> Float[np.ndarray, "*row 3"]:
    """Return forward, right, down of forward, left, up."""
    return vectors * np.array([1.0, -1.0, -1.0])


def scalar_first(
    quaternion: Float[np.ndarray, "*row 4"],
) -> Float[np.ndarray, "*row 4"]:
    """Return attitudes (x, y, z, w) as an autopilot's (w, x, y, z), w >= 0.

    The product of half a turn about (1, 1, 0) (world axes), the attitude, and half a
    turn about x (body axes).
    """
    x, y, z, w = np.moveaxis(quaternion, -1, 0)
    whole = np.stack([-w - z, -x - y, y - x, z - w], axis=-1) * np.sqrt(0.5)
    return np.where(whole[..., :1] < 0, -whole, whole)


def euler(attitude: Float[np.ndarray, "*row 4"]) -> Float[np.ndarray, "*row 3"]:
    """Return roll, pitch and yaw of an autopilot's attitude (w, x, y, z) [rad]."""
    w, x, y, z = np.moveaxis(attitude, -1, 0)
    return np.stack(
        [
            np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)),
            np.arcsin(np.clip(2 * (w * y - z * x), -1.0, 1.0)),
            np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)),
        ],
        axis=-1,
    )
