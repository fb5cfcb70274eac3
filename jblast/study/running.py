"""A run of a world on one clock, in packets: what its senses record as time passes.

`prepare_run` reads a scene, samples its random blasts, and flies its vehicle through
them, hovering or on a mission. Blasts do not depend on the vehicle, and the vehicle not
on its sensors. So the flight is known before the first packet, and with it every
arrival. Samples, frames and events are computed packet by packet, in constant memory.

A subscriber takes the packets in order of time, for example to write files, to show
them or to search them for blasts. None of them changes what is recorded.
"""

import math
import os
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple, Protocol, runtime_checkable

import jax
import numpy as np
from jaxtyping import Float, Int, UInt8

from jblast.errors import InputError, argument
from jblast.scene import (
    Charge,
    Instrument,
    Place,
    Scene,
    UncertainScene,
    read_scene_or_world,
)
from jblast.scene.sensor_kinds import sampling_kinds
from jblast.sensors import Track
from jblast.sensors.camera import landscape
from jblast.sensors.camera.files.views import views_of
from jblast.sensors.camera.film import Film
from jblast.sensors.camera.image import BACKGROUND
from jblast.sensors.camera.run_film import filmed_packets
from jblast.sensors.listening import Listening, packets, plan, with_ambient
from jblast.signals.flash.fireball import Direction
from jblast.study.flight_results import FlightLoad, Flights, Options
from jblast.study.flights import fly, has_mission, lasting
from jblast.vehicle import Trajectory
from jblast.world import (
    Arrivals,
    DrawnWorld,
    ImuRecord,
    Perceived,
    arrivals_of,
    draw_world,
    imu_records,
    perceived,
    read_run_scene,
    tracks_of,
)
from jblast.world.perceived import camera_path, out_of_view

AFTER_S, AFTER_FLIGHT_S = 0.5, 5.0
"""Duration after the last wave [s] without and with a vehicle, which needs time to
recover."""
LOST_M_S = 150.0
"""Speed from which on a vehicle counts as lost [m/s]: multicopters fly at most half as
fast, and at the speed of sound it would meet its blasts several times."""
PACKET_S = 0.2
"""Duration of a packet [s]: 20 frames at 100 Hz, which are rendered together; the delay
of a live view is hardly noticed."""


class Samples(NamedTuple):
    """Contiguous samples of one sensor.

    Attributes:
        start_s: Beginning of the first sample, common clock.
        rate_hz: Samples per second.
        values: One column per component, in the unit of the sensor's kind; of an IMU
            specific force [m/s^2] and body rate [rad/s], its own axes.
    """

    start_s: float
    rate_hz: float
    values: Float[np.ndarray, "sample component"]


@dataclass(frozen=True)
class Frames:
    """Frames of the camera, rendered when they are looked at.

    Attributes:
        time_s: Beginning of each exposure, common clock.
        rendered: Returns the frames of some times, sRGB of 8 bits.
    """

    time_s: Float[np.ndarray, " frame"]
    rendered: Callable[[np.ndarray], np.ndarray]

    @cached_property
    def images(self) -> UInt8[np.ndarray, "frame height width 3"]:
        """The frames in sRGB of 8 bits."""
        return self.rendered(self.time_s)


class CameraEvents(NamedTuple):
    """Events of the camera, in order of time.

    Attributes:
        time_s: Times, common clock.
        x: Columns.
        y: Rows, down from the top.
        polarity: 1 brighter, -1 darker.
    """

    time_s: Float[np.ndarray, " event"]
    x: Int[np.ndarray, " event"]
    y: Int[np.ndarray, " event"]
    polarity: Int[np.ndarray, " event"]


@dataclass(frozen=True)
class RunDetection:
    """A blast that a detector of the run has reported.

    Attributes:
        sensor: Name of the sensor, or "camera".
        kind: "sound" or "flash".
        time_s: Estimated arrival of the wave at the sensor, or first light, common
            clock.
        sigma_s: Its standard deviation.
        reported_s: Time of the report: the end of the packet that completed it.
        statistic: Statistic of the detector.
        shot: Name of the blast whose true wave it agrees with; "" for a false alarm.
        true_s: Its true time; NaN for a false alarm.
        direction: Direction of a flash from the camera at first light; None for sound,
            and without the path of a carried camera.
    """

    sensor: str
    kind: str
    time_s: float
    sigma_s: float
    reported_s: float
    statistic: float
    shot: str
    true_s: float
    direction: Direction | None = None

    @property
    def latency_s(self) -> float:
        """Delay of the report after the wave reached the sensor [s]."""
        return self.reported_s - self.true_s


@dataclass
class Packet:
    """All that is recorded in one interval of the common clock.

    Attributes:
        start_s: Beginning.
        end_s: End, the beginning of the next packet.
        blasts: Charges that detonate within it.
        perceived: First perceptions within it.
        motion: Flight of the vehicle, as NumPy arrays; None without one.
        samples: Samples of each sampling sensor, by name.
        frames: Frames; None without a camera.
        events: Camera events; None without a camera.
        detections: Detections that are reported at its end.
    """

    start_s: float
    end_s: float
    blasts: tuple[Charge, ...] = ()
    perceived: tuple[Perceived, ...] = ()
    motion: Trajectory | None = None
    samples: dict[str, Samples] = field(default_factory=dict)
    frames: Frames | None = None
    events: CameraEvents | None = None
    detections: tuple[RunDetection, ...] = ()


@runtime_checkable
class Subscriber(Protocol):
    """Consumer of a run's packets. It must not change them."""

    def take(self, packet: Packet) -> None:
        """Process the next packet."""
        ...

    def finish(self) -> None:
        """Process the end of the run; called once, also after an error."""
        ...


@dataclass(frozen=True)
class Run:
    """A world and the flight through it, ready to be recorded.

    Attributes:
        world: The world, with its blasts sampled.
        seconds: Duration.
        flown: Flights with the controllers, or the mission; None without a vehicle.
        flight: The recorded flight, up to the loss of the vehicle; None without one.
        tracks: Paths of the vehicle and of all that it carries, by name.
        arrivals: Arrivals of all waves.
        perceived: First perceptions in order of time.
        late: Number of perceptions after the end.
        unseen: Blasts outside the camera's view.
        listening: Plan of the samples; None without a sampling sensor.
        imus: Records of the inertial units.
        film: Camera and times of all its frames; None without camera or blast.
        notes: Remarks on the scene.
        place: Geographic position of the origin; None: unknown.
    """

    world: DrawnWorld
    seconds: float
    flown: Flights | None
    flight: Trajectory | None
    tracks: Mapping[str, Track]
    arrivals: Arrivals
    perceived: tuple[Perceived, ...]
    late: int
    unseen: tuple[str, ...]
    listening: Listening | None
    imus: Sequence[ImuRecord]
    film: Film | None
    notes: Sequence[str]
    place: Place | None


def prepare_run(
    scene: str | os.PathLike[str],
    *,
    seconds: float | None = None,
    seed: int = 0,
    load: Callable[[Scene], FlightLoad] = Options.load,
    estimator: str = "",
    controllers: Sequence[str] | None = None,
    ambient: str | None = None,
) -> Run:
    """Sample a world and fly its vehicle; the result is ready to be recorded.

    Args:
        scene: File of the scene, with [world], [charge] or neither.
        seconds: Duration; default: until 5 s after the last wave and, on a mission,
            until the vehicle is disarmed; without a vehicle 0.5 s after the wave.
        seed: Seed of all samples.
        load: As in `Options`.
        estimator: "ekf" for control by a state estimate; "" for the true state.
        controllers: Names of controllers; the first one flies the recorded flight.
        ambient: Recording of the background sound.

    Raises:
        InputError: The scene or an argument cannot be used.

    Example:
        `run = prepare_run("scene.toml", seed=3)`
    """
    uncertain, spec = read_run_scene(scene)
    uncertain, notes = with_ambient(uncertain, ambient)
    for name, value in (("estimator", estimator), ("controllers", controllers)):
        if value and uncertain.scene.vehicle is None:
            raise InputError(
                f"{argument(name)}: expected a scene with a [vehicle], got {scene} "
                "without one"
            )
    until = math.inf if seconds is None else seconds
    world = draw_world(uncertain, spec, seed, until_s=until)
    on_mission = has_mission(uncertain)
    arrivals = None
    if seconds is None and not on_mission:
        arrivals = arrivals_of(world.scene)
        seconds = _seconds(world, arrivals)
    flown, flight, tracks = None, None, {}
    if world.scene.vehicle is not None and (world.shots or on_mission):
        flown = fly(
            replace(uncertain, scene=world.scene, beliefs={}),
            seconds=seconds,
            estimator=estimator,
            controllers=controllers,
            load=load,
            seed=world.seed,
        )
        flight = _until_lost(flown.trajectory)
        tracks = tracks_of(world.scene, flight)
    if arrivals is None or tracks:
        arrivals = arrivals_of(world.scene, tracks)
    if seconds is None:
        assert flown is not None
        seconds = max(_seconds(world, arrivals), float(math.ceil(flown.seconds)))
    if flown and flight is not None and float(flight.time_s[-1]) >= flown.seconds:
        # after its landing the vehicle stays at rest
        flight = lasting(flight, seconds)
    unseen = out_of_view(world.scene, flight)
    seen, late = perceived(world.scene, arrivals, seconds, unseen)
    listening = None
    if {sensor.kind for sensor in world.scene.sensors} & set(sampling_kinds()):
        sampled = UncertainScene(world.scene, source=world.source)
        listening = plan(sampled, seed, seconds, tracks)
    return Run(
        world,
        seconds,
        flown,
        flight,
        tracks,
        arrivals,
        seen,
        late,
        unseen,
        listening,
        imu_records(world, flight, arrivals, seconds, load),
        _film_of(world, seconds, flight),
        notes,
        uncertain.place,
    )


def _film_of(
    world: DrawnWorld, seconds: float, flight: Trajectory | None
) -> Film | None:
    """Return the film of a world's camera; frame 0 is at 0 on the common clock."""
    scene, camera = world.scene, world.scene.camera
    if camera is None or not world.shots:
        return None
    path, background = None, BACKGROUND
    if camera.mount and flight is not None:
        path, background = camera_path(flight), landscape()
        seconds = min(seconds, float(path.time[-1]))
    hz = float(camera.frames_hz)
    # 1e-6 of a frame: the product of a duration and a rate may round below an integer
    count = max(0, math.floor((seconds - float(camera.exposure_s)) * hz + 1e-6))
    times, views = np.arange(count + 1) / hz, views_of(scene, camera)
    return Film(scene, camera, times, background, views, path=path, dtype=np.float32)


def listening_of(
    scene: str | os.PathLike[str],
    seconds: float | None = None,
    seed: int = 0,
    ambient: str | None = None,
) -> tuple[Listening, tuple[str, ...]]:
    """Return the plan of a scene's records, and remarks; random blasts are sampled.

    A scene with random blasts, or with sampling sensors on its vehicle, is a run: its
    records are those of `jblast world`.

    Args:
        scene: File of the scene.
        seconds: Duration; default: until the last blast has passed every sensor.
        seed: Seed of all samples.
        ambient: Recording of the background sound.

    Raises:
        InputError: As in `prepare_run` and `sensors.listening.plan`.
    """
    uncertain, spec = read_scene_or_world(scene)
    kinds = sampling_kinds()
    rides = any(x.mount and x.kind in kinds for x in uncertain.scene.sensors)
    if spec is None and not (rides and uncertain.scene.vehicle is not None):
        uncertain, notes = with_ambient(uncertain, ambient)
        return plan(uncertain, seed, seconds), tuple(notes)
    run = prepare_run(scene, seconds=seconds, seed=seed, ambient=ambient)
    if run.listening is None:
        raise InputError(
            f"{scene}: expected at least one [[sensor]] of kind {', '.join(kinds)}"
        )
    return run.listening, tuple(run.notes)


def _seconds(world: DrawnWorld, arrivals: Arrivals) -> float:
    """Return the duration of a world: until after its last wave, in tenths of seconds.

    With a flight it is whole seconds, as each duration compiles another program.
    """
    last = arrivals.last_s()
    if world.scene.vehicle is None:
        return math.ceil(10.0 * (last + AFTER_S)) / 10.0
    return float(math.ceil(last + AFTER_FLIGHT_S))


def _until_lost(flight: Trajectory) -> Trajectory:
    """Return the rows of a flight before the loss of the vehicle."""
    speed = np.linalg.norm(flight.velocity_m_s, axis=-1)
    # negated, because NaN, after a divergence, compares as false
    lost = ~(speed <= LOST_M_S)
    return flight.at(slice(int(np.argmax(lost)))) if lost.any() else flight


def packets_of(run: Run, packet_s: float = PACKET_S) -> Iterator[Packet]:
    """Yield the packets of a run in order of time.

    Args:
        run: The run.
        packet_s: Duration of a packet; a sampling sensor has a sample in it at least.

    Raises:
        InputError: As in `sensors.listening.packets`.
    """
    count = max(math.ceil(run.seconds / packet_s - 1e-9), 1)
    streams = _streams(run, packet_s)
    film = _filmed(run, packet_s * np.arange(count + 1))
    # NumPy: JAX would compile a program for each packet; a copy, because SciPy does not
    # take read-only arrays
    flight = None if run.flight is None else jax.tree.map(np.array, run.flight)
    for number in range(count):
        # products, not sums: rounding does not accumulate
        start, end = number * packet_s, (number + 1) * packet_s
        last = number == count - 1
        stop = math.inf if last else end
        yield Packet(
            start,
            run.seconds if last else end,
            tuple(c for c in run.world.charges if start <= float(c.time_s) < stop),
            tuple(one for one in run.perceived if start <= one.time_s < stop),
            None if flight is None else _within(flight, start, stop),
            {
                name: samples
                for name, stream in streams.items()
                if (samples := next(stream, None)) is not None
            },
            *next(film, (None, None)),
        )


def _filmed(
    run: Run, bounds: Float[np.ndarray, " bound"]
) -> Iterator[tuple[Frames, CameraEvents]]:
    """Yield frames and camera events by packet; nothing without a camera."""
    if run.film is None:
        return
    bounds = np.append(bounds[:-1], math.inf)  # the last frame may be at the very end
    for times, found in filmed_packets(run.film, bounds):
        columns = found.time, found.x, found.y, found.polarity
        yield Frames(times, run.film.levels), CameraEvents(*map(np.asarray, columns))


def _within(flight: Trajectory, start: float, stop: float) -> Trajectory:
    time = np.asarray(flight.time_s)
    return flight.at(slice(*np.searchsorted(time, [start, stop]).tolist()))


def _streams(run: Run, packet_s: float) -> dict[str, Iterator[Samples]]:
    """Return the samples of each sampling sensor and inertial unit, by packet."""
    streams: dict[str, Iterator[Samples]] = {}
    if run.listening is not None:
        for sensor in run.listening.sensors:
            parts = packets(run.listening, sensor, 1.0 / packet_s)
            instrument = sensor.instrument or Instrument()
            offset = float(sensor.clock_offset_s)
            streams[sensor.name] = _numbered(parts, instrument.rate, offset)
    for record in run.imus:
        rows = np.column_stack([record.samples.force, record.samples.rate])
        parts = (
            rows[
                round(n * packet_s * record.imu.rate) : round(
                    (n + 1) * packet_s * record.imu.rate
                )
            ]
            for n in range(math.ceil(run.seconds / packet_s))
        )
        offset = float(record.sensor.clock_offset_s)
        streams[record.sensor.name] = _numbered(parts, record.imu.rate, offset)
    return streams


def _numbered(
    parts: Iterable[Any], rate_hz: float, offset_s: float
) -> Iterator[Samples]:
    """Yield parts with their beginning on the common clock."""
    first = 0
    for values in parts:
        yield Samples(first / rate_hz - offset_s, rate_hz, values)
        first += len(values)


class Paced:
    """Subscriber that makes a run as slow as a clock."""

    def __init__(self, speed: float):
        """Start the clock.

        Args:
            speed: Speed of the run over that of real time.
        """
        self._speed, self._began = speed, time.monotonic()

    def take(self, packet: Packet) -> None:
        """Wait until the end of a packet."""
        ahead = packet.end_s / self._speed - (time.monotonic() - self._began)
        time.sleep(max(ahead, 0.0))

    def finish(self) -> None:
        """Do nothing."""


@runtime_checkable
class Detectors(Protocol):
    """Detectors that search the packets of a run."""

    def take(self, packet: Packet) -> Sequence[RunDetection]:
        """Search the next packet; return what is reported at its end."""
        ...

    def finish(self) -> Sequence[RunDetection]:
        """Return the remaining reports after the last packet."""
        ...


def _ahead(parts: Iterator[Packet]) -> Iterator[Packet]:
    """Yield packets, and compute the next one while the last one is processed."""
    with ThreadPoolExecutor(1) as pool:
        coming = pool.submit(next, parts, None)
        while (packet := coming.result()) is not None:
            coming = pool.submit(next, parts, None)
            yield packet


def record_run(
    run: Run, subscribers: Sequence[Subscriber], detectors: Detectors | None = None
) -> None:
    """Compute the packets of a run, and pass each to all subscribers in turn.

    Args:
        run: The run.
        subscribers: Consumers of the packets.
        detectors: Detectors, whose reports are part of the packets.
    """
    with ExitStack() as stack:
        # all of them are finished, also after an error of one
        for subscriber in subscribers:
            stack.callback(subscriber.finish)
        for packet in _ahead(packets_of(run)):
            if detectors is not None:
                found = detectors.take(packet)
                if packet.end_s >= run.seconds:
                    found = (*found, *detectors.finish())
                packet.detections = tuple(found)
            for subscriber in subscribers:
                subscriber.take(packet)
