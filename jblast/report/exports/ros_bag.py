"""A run as a bag of ROS 2: one MCAP file, with standard messages where there are any.

Axes are those of REP 103: the world `map` is east, north, up; the body `base_link` is
forward, left, up; `camera_optical_frame` is right, down, ahead. Stamps, log times and
publish times are the run's clock, from 0 s. The same packets give the same bytes.

Camera events are `event_camera_msgs` in the encoding evt3, whose decoders and renderer
are maintained for ROS 2; `dvs_msgs` is of ROS 1, and has a message for each event.
Sound is `foxglove_msgs/RawAudio`, which Foxglove plays.

`ros_messages.msg` has the type of each topic, by its last name, and the definitions,
without comments: of ROS 2 Jazzy, from the package rosbags, and of those two packages.
"""

import io
import json
import math
import re
from collections.abc import Iterable, Mapping
from contextlib import ExitStack
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np

from jblast.errors import InputError, needed
from jblast.files import replacing
from jblast.observations.places import Frame
from jblast.scene import Camera, Charge, Place, Scene, Sensor
from jblast.sensors.camera.files.evt3 import MAX_SIDE, Encoder
from jblast.sensors.camera.files.images import COMPRESSION
from jblast.study.running import CameraEvents, Frames, Packet, Samples
from jblast.study.thinning import first_of_each, largest
from jblast.vehicle import Trajectory
from jblast.waves.propagation import ambient

Message = dict[str, Any]
DEFINITIONS = Path(__file__).with_name("ros_messages.msg")
WORLD, BODY, LENS = "map", "base_link", "camera_optical_frame"
TAKEN = {"camera", "vehicle", "jblast", "tf", "clock", WORLD, BODY, LENS}
SAMPLES_HZ, MOTION_HZ = 1000, 100.0
"""Largest rates of messages of sensors, and of the vehicle and the clock; declared. ROS
has a message for each sample: 48 kHz would be 300 MB a minute."""
PATH_POSES, PATH_STEP_S = 200, 0.2
"""Number of poses in the path of a run, which is written whole each second, and their
smallest interval; declared."""
FULL_SCALE_PA = 1000.0
"""Pressure of the largest sample of audio without a blast, for a microphone without a
full scale: 154 dB, as of microphones for loud sounds; 16 bits then resolve 0.03 Pa."""
MARKER_S, SPHERE, INFO = 2.0, 2, 20
"""Duration for which a blast is shown (declared); numbers of the messages."""
LEVEL = np.eye(4)[3]


class RosBag:
    """Writer of a run's packets as a bag of ROS 2. `finish` completes the file."""

    def __init__(
        self,
        *,
        path: Path,
        scene: Scene,
        seconds: float,
        place: Place | None = None,
        peaks_pa: Mapping[str, float] = {},
    ):
        """Open the file and write what does not change.

        Args:
            path: The file, `NAME.mcap`; `finish` replaces an existing one.
            scene: Sensors, camera and air.
            seconds: Duration of the run.
            place: Position of the scene's origin; None: no latitudes are written.
            peaks_pa: Sum of the peaks of all blasts at each microphone, by name.

        Raises:
            InputError: The extra `ros` is missing, or the camera too large for evt3.
        """
        library = needed("mcap_ros2.writer", "ros", path, "a ROS 2 bag is written")
        camera = scene.camera
        if camera is not None and max(camera.width, camera.height) > MAX_SIDE:
            raise InputError(
                f"{path}: expected a camera of at most {MAX_SIDE} by {MAX_SIDE} px, "
                f"for events in EVT3, got {camera.width} by {camera.height} px"
            )
        parts = re.split(r"^=+\nMSG: (.*)\n", DEFINITIONS.read_text(), flags=re.M)
        self._kinds = dict(line.split() for line in parts[0].splitlines())
        self._texts = dict(zip(parts[1::2], parts[2::2], strict=True))
        self._camera = camera
        self._origin = None if place is None else Frame(*place)
        self._ambient_pa = float(ambient(scene.air)[1])
        self._names = _frame_names(sensor.name for sensor in scene.sensors)
        self._sensors = {sensor.name: sensor for sensor in scene.sensors}
        self._schemas: dict[str, Any] = {}
        self._rows: list[tuple[float, str, Message]] = []
        self._blasts, self._packets, self._event_steps = 0, 0, -1
        self._path: list[Message] = []
        self._path_step_s = max(PATH_STEP_S, seconds / PATH_POSES)
        self._next_pose_s = self._next_path_s = -math.inf
        self._open = ExitStack()
        temporary = self._open.enter_context(replacing(path, durable=False))
        self._writer = library.Writer(str(temporary))
        self._full_scale_pa = {
            sensor.name: _full_scale(sensor, peaks_pa.get(sensor.name, 0.0))
            for sensor in scene.sensors
            if sensor.kind == "microphone"
        }
        self._fixed = self._fixed_transforms()
        self._first(seconds)

    def take(self, packet: Packet) -> None:
        """Write a packet, its messages in order of time."""
        ticks = (round(t * MOTION_HZ) for t in (packet.start_s, packet.end_s))
        for tick in range(*ticks):
            self._add(tick / MOTION_HZ, "/clock", clock=_stamp(tick / MOTION_HZ))
        self._add(
            packet.start_s,
            "/tf",
            transforms=[_transform(packet.start_s, *one) for one in self._fixed],
        )
        for charge in packet.blasts:
            self._blast(charge)
        for seen in packet.perceived:
            text = f"{seen.entity}: {seen.sense} of blast {seen.shot}"
            self._report(seen.time_s, text, "perception", seen._asdict())
        if packet.motion is not None:
            self._motion(packet.motion)
        for name, samples in packet.samples.items():
            if len(samples.values):
                self._samples(self._sensors[name], samples)
        if self._camera is not None and packet.frames is not None:
            self._images(packet.frames, self._camera)
        if self._camera is not None and packet.events and len(packet.events.time_s):
            self._events(packet.events, self._camera)
        for found in packet.detections:
            # JSON has no NaN: a false alarm has no true time
            row = {key: value for key, value in vars(found).items() if value == value}
            text = f"{found.sensor}: {found.kind} at {found.time_s:.6f} s detected, "
            text += f"blast {found.shot}" if found.shot else "a false alarm"
            self._report(found.reported_s, text, "detection", row)
        self._flush()

    def finish(self) -> None:
        """Complete the file."""
        with self._open:
            self._flush()
            self._writer.finish()

    def _fixed_transforms(self) -> list[tuple[str, str, Any, Any]]:
        """Return carrier, frame, position and attitude of sensors and camera."""
        fixed: list[tuple[str, Any, Any]] = [
            (self._names[s.name], s.offset_m if s.mount else s.position_m, s)
            for s in self._sensors.values()
        ]
        if self._camera is not None:
            fixed.append((LENS, self._camera.position, self._camera))
        return [
            (BODY if at.mount else WORLD, name, place, at.quaternion)
            for name, place, at in fixed
            if np.isfinite(np.asarray(place)).all()  # others were given no position
        ]

    def _first(self, seconds: float) -> None:
        """Write origin and scales of audio, at 0 s."""
        self._fix(0.0, "/jblast/origin", WORLD, np.zeros(3))
        row = {"seconds": seconds, "audio_full_scale_pa": self._full_scale_pa}
        self._report(0.0, f"run of {seconds:g} s", "run", row)

    def _blast(self, charge: Charge) -> None:
        """Write a blast: a sphere of scaled radius 1 m/kg^(1/3), and a report."""
        time, mass = float(charge.time_s), float(charge.mass_kg)
        place = np.array([float(axis) for axis in charge.position_m])
        self._blasts += 1
        marker = {"header": _header(time, WORLD), "ns": "blasts", "id": self._blasts}
        marker |= {"type": SPHERE, "color": {"r": 1.0, "g": 0.4, "b": 0.1, "a": 0.6}}
        marker |= {"pose": {"position": place, "orientation": LEVEL}}
        marker |= {"scale": np.full(3, 2 * mass ** (1 / 3))}
        marker |= {"lifetime": _stamp(MARKER_S)}
        self._add(time, "/jblast/blasts", markers=[marker])
        row = {"shot": charge.name, "time_s": time, "mass_kg": mass}
        row |= {"explosive": charge.explosive, "position_m": place.tolist()}
        text = f"blast {charge.name}: {mass:g} kg of {charge.explosive}"
        self._report(time, text, "blast", row)

    def _report(self, time: float, text: str, what: str, row: Message) -> None:
        """Write a line for people, and its numbers as JSON for programs."""
        line = {"stamp": _stamp(time), "level": INFO, "name": "jblast", "msg": text}
        self._add(time, "/jblast/log", **line)
        self._add(time, "/jblast/records", data=json.dumps({"type": what} | row))

    def _motion(self, rows: Trajectory) -> None:
        """Write the vehicle, thinned; velocity and load along its own axes."""
        # imported here: it takes 0.1 s, which a scene without a vehicle saves
        from scipy.spatial.transform import Rotation

        if not rows.time_s.size:
            return
        inverse = Rotation.from_quat(rows.quaternion).inv()
        velocity, force = inverse.apply(rows.velocity_m_s), inverse.apply(rows.force_n)
        times, error = np.asarray(rows.time_s), np.asarray(rows.path_error_m)
        places, turns = np.asarray(rows.position_m), np.asarray(rows.quaternion)
        targets, estimates = np.asarray(rows.set_point_m), np.asarray(rows.estimate_m)
        for n in first_of_each(times, MOTION_HZ):
            time, place = float(times[n]), places[n]
            self._pose(time, place, turns[n])
            twist = {"linear": velocity[n], "angular": rows.body_rate_rad_s[n]}
            self._add(time, "/vehicle/twist", BODY, twist=twist)
            target = {"position": targets[n], "orientation": LEVEL}
            self._add(time, "/vehicle/set_point", WORLD, pose=target)
            self._add(time, "/vehicle/estimate", WORLD, point=estimates[n])
            self._add(time, "/vehicle/path_error", data=error[n])
        group = np.floor((times + 1e-6) * MOTION_HZ)
        for n in largest(np.linalg.norm(force, axis=1), group):
            wrench = {"force": force[n], "torque": rows.moment_n_m[n]}
            self._add(float(times[n]), "/vehicle/wrench", BODY, wrench=wrench)

    def _pose(self, time: float, place: np.ndarray, turn: np.ndarray) -> None:
        """Write a pose; and the path and the latitude, if a second has passed."""
        pose = {"position": place, "orientation": turn}
        moved = _transform(time, WORLD, BODY, place, turn)
        self._add(time, "/tf", transforms=[moved])
        self._add(time, "/vehicle/pose", WORLD, pose=pose)
        if time >= self._next_pose_s - 1e-6:  # times are sums of steps
            self._path.append({"header": _header(time, WORLD), "pose": pose})
            self._next_pose_s = time + self._path_step_s
        if time >= self._next_path_s - 1e-6:
            self._add(time, "/vehicle/path", WORLD, poses=[*self._path])
            self._fix(time, "/vehicle/fix", BODY, place)
            self._next_path_s = time + 1.0

    def _fix(self, time: float, topic: str, frame: str, place: np.ndarray) -> None:
        if self._origin is not None:
            lat, lon, alt = self._origin.to_geodetic(place).tolist()
            fix = {"latitude": lat, "longitude": lon, "altitude": alt}
            self._add(time, topic, frame, **fix)

    def _samples(self, sensor: Sensor, samples: Samples) -> None:
        """Write samples of a sensor; of more than 1,000 a second the largest ones."""
        # with a clock that is ahead the first samples are before the run's beginning
        early = max(math.ceil(-samples.start_s * samples.rate_hz - 1e-6), 0)
        start_s = samples.start_s + early / samples.rate_hz
        values, name, fixed = samples.values[early:], self._names[sensor.name], {}
        if not len(values):
            return
        frame = name
        if sensor.kind in ("microphone", "pressure"):
            topic = "pressure"
            columns = {"fluid_pressure": self._ambient_pa + values[:, 0]}
        elif sensor.kind == "anemometer":
            # its components are east, north, up, however it is turned
            topic, frame, columns = "wind", WORLD, {"vector": values}
        elif sensor.kind == "geophone":
            topic, columns = "velocity", {"vector": values * np.eye(3)[2]}
        elif sensor.kind == "imu":
            topic, fixed = "imu", {"orientation_covariance": [-1.0, *[0.0] * 8]}
            columns = {"linear_acceleration": values[:, :3]}
            columns |= {"angular_velocity": values[:, 3:]}
        else:  # kinds that others register
            return
        group = np.arange(len(values)) // math.ceil(samples.rate_hz / SAMPLES_HZ - 1e-9)
        for n in largest(np.linalg.norm(values[:, :3], axis=1), group):
            time = start_s + float(n) / samples.rate_hz
            row = {field: column[n] for field, column in columns.items()}
            self._add(time, f"/{name}/{topic}", frame, **row, **fixed)
        if sensor.kind == "microphone":
            # as a recorder is overloaded; pressure is not limited
            level = values[:, 0] / self._full_scale_pa[sensor.name]
            level = np.clip(level, -1.0, 1.0)
            sound: Message = {"data": np.round(32767 * level).astype("<i2").tobytes()}
            sound |= {"format": "pcm-s16", "sample_rate": round(samples.rate_hz)}
            sound |= {"timestamp": _stamp(start_s), "number_of_channels": 1}
            self._add(start_s, f"/{name}/audio", **sound)

    def _images(self, frames: Frames, camera: Camera) -> None:
        """Write all frames as PNG, which is lossless, each with the calibration."""
        from PIL import Image

        (fx, fy), (cx, cy) = camera.focal.tolist(), camera.center.tolist()
        # plumb_bob has its coefficients in OpenCV's order, as a scene
        lens = {"distortion_model": "plumb_bob", "d": camera.distortion.tolist()}
        lens |= {"width": camera.width, "height": camera.height}
        lens |= {"k": [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]}
        lens |= {"p": [fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0]}
        lens |= {"r": np.eye(3).ravel().tolist()}
        for time, pixels in zip(frames.time_s.tolist(), frames.images, strict=True):
            file = io.BytesIO()
            Image.fromarray(pixels).save(file, "PNG", compress_level=COMPRESSION)
            image = {"format": "rgb8; png compressed bgr8", "data": file.getvalue()}
            self._add(time, "/camera/image_raw/compressed", LENS, **image)
            self._add(time, "/camera/camera_info", LENS, **lens)

    def _events(self, events: CameraEvents, camera: Camera) -> None:
        """Write camera events; the stamp is the time of the first one."""
        micro = np.round(events.time_s * 1e6).astype(np.int64)
        columns = {"t": micro, "x": events.x, "y": events.y, "p": events.polarity > 0}
        # A message states time and row at its beginning, so that a decoder can start
        # with any. Steps of the time without events are counted, as by cameras.
        encoder = Encoder(high=max(self._event_steps - 1, -1))
        words = encoder.words(columns).astype("<u2").tobytes()
        packet = {"encoding": "evt3", "events": words, "seq": self._packets}
        packet |= {"width": camera.width, "height": camera.height}
        self._packets, self._event_steps = self._packets + 1, encoder.high
        self._add(1e-6 * float(micro[0]), "/camera/events", LENS, **packet)

    def _add(self, time: float, topic: str, frame: str = "", **fields: Any) -> None:
        """Add a message to those of this packet; with a header if it has a frame."""
        if frame:
            fields["header"] = _header(time, frame)
        self._rows.append((time, topic, fields))

    def _flush(self) -> None:
        """Write the messages of this packet, in order of time."""
        for time, topic, message in sorted(self._rows, key=itemgetter(0)):
            kind = self._kinds[topic.rpartition("/")[2]]
            if kind not in self._schemas:
                self._schemas[kind] = self._schema(kind)
            self._writer.write_message(
                topic, self._schemas[kind], _plain(message), round(time * 1e9)
            )
        self._rows.clear()

    def _schema(self, kind: str) -> Any:
        """Register a type with the definitions of all types in it."""
        used = [kind]
        for one in used:  # grows on the way
            fields = re.findall(r"^(\w+/\w+)", self._texts[one], flags=re.M)
            used += [field for field in dict.fromkeys(fields) if field not in used]
        rest = (f"{'=' * 80}\nMSG: {one}\n{self._texts[one]}" for one in used[1:])
        text = self._texts[kind] + "".join(rest)
        return self._writer.register_msgdef(kind.replace("/", "/msg/"), text)


def _frame_names(names: Iterable[str]) -> dict[str, str]:
    """Return names for frames and topics, of letters, digits and "_", all different."""
    found: dict[str, str] = {}
    for name in names:
        plain = re.sub(r"\W", "_", name, flags=re.ASCII)
        # no part of a topic may begin with a digit
        plain = plain if plain[:1].isalpha() else f"sensor_{plain}"
        while plain in TAKEN | {*found.values()}:
            plain += "_"
        found[name] = plain
    return found


def _full_scale(sensor: Sensor, peaks_pa: float) -> float:
    """Return the pressure of the largest sample of audio [Pa]."""
    own = None if sensor.instrument is None else sensor.instrument.full_scale
    return FULL_SCALE_PA + peaks_pa if own is None else float(own)


def _plain(value: Any) -> Any:
    """Return a message with its arrays of three or four numbers as x, y, z, w."""
    if isinstance(value, np.ndarray):
        return dict(zip("xyzw", value.tolist(), strict=False))
    if isinstance(value, dict):
        return {name: _plain(field) for name, field in value.items()}
    return [_plain(one) for one in value] if isinstance(value, list) else value


def _stamp(time: float) -> Message:
    second, rest = divmod(round(time * 1e9), 10**9)
    return {"sec": second, "nanosec": rest}


def _header(time: float, frame: str) -> Message:
    return {"stamp": _stamp(time), "frame_id": frame}


def _transform(time: float, parent: str, child: str, place, quaternion) -> Message:
    turn = np.asarray(quaternion) / np.linalg.norm(np.asarray(quaternion))
    moved = {"translation": np.asarray(place), "rotation": turn}
    header = _header(time, parent)
    return {"header": header, "child_frame_id": child, "transform": moved}
