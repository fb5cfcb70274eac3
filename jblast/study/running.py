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
from typing import Any, NamedTuple, Protocol, runtime_checkable

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Int, UInt8

from jblast.errors import InputError, argument
from jblast.kept_programs import kept_between_runs
from jblast.progress import Progress, reported
from jblast.scene import (
    Charge,
    Instrument,
    Place,
    Scene,
    UncertainScene,
    read_scene_or_world,
    scene_of,
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
from jblast.study.flight_results import (
    TOLERANCE_M,
    Encounter,
    FlightLoad,
    Flights,
    Options,
    Profile,
    target_of,
    trajectory_of,
)
from jblast.study.flights import fly
from jblast.study.missions import (
    MISSION_STEP_S,
    TOLERANCE_M as MISSION_TOLERANCE_M,
    MissionFlight,
    above_ground,
    fly_mission,
)
from jblast.vehicle import STEP_S, Trajectory, path_error, read_custom_profile
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
    with_nevers,
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


class Motion(NamedTuple):
    """Rows of the vehicle's motion, in order of time.

    Attributes:
        time_s: Time on the common clock.
        position_m: Position: east, north, up.
        velocity_m_s: Velocity: east, north, up.
        quaternion: Rotation from body (forward, left, up) to world axes, scalar last.
        body_rate_rad_s: Angular velocity along body axes.
        rotor_speed_rad_s: Speeds of the rotors.
        force_n: Sum of thrust, weight, air and blasts, world axes; without the ground.
        moment_n_m: Moment likewise, body axes.
        set_point_m: Set point of the position controller.
        path_error_m: Distance from the set point.
        estimate_m: Estimated position; the true one without an estimator.
    """

    time_s: Float[np.ndarray, " row"]
    position_m: Float[np.ndarray, "row 3"]
    velocity_m_s: Float[np.ndarray, "row 3"]
    quaternion: Float[np.ndarray, "row 4"]
    body_rate_rad_s: Float[np.ndarray, "row 3"]
    rotor_speed_rad_s: Float[np.ndarray, "row 4"]
    force_n: Float[np.ndarray, "row 3"]
    moment_n_m: Float[np.ndarray, "row 3"]
    set_point_m: Float[np.ndarray, "row 3"]
    path_error_m: Float[np.ndarray, " row"]
    estimate_m: Float[np.ndarray, "row 3"]


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


class Frames(NamedTuple):
    """Frames of the camera.

    Attributes:
        time_s: Beginning of each exposure, common clock.
        images: sRGB, 8 bits.
    """

    time_s: Float[np.ndarray, " frame"]
    images: UInt8[np.ndarray, "frame height width 3"]


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
        motion: Rows of the vehicle; None without one.
        samples: Samples of each sampling sensor, by name.
        frames: Frames; None without a camera.
        events: Camera events; None without a camera.
        detections: Detections that are reported at its end.
    """

    start_s: float
    end_s: float
    blasts: tuple[Charge, ...] = ()
    perceived: tuple[Perceived, ...] = ()
    motion: Motion | None = None
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
        flight: True path of the vehicle; None without one.
        motion: The same as rows of packets.
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
    flown: Flights | MissionFlight | None
    flight: Trajectory | None
    motion: Motion | None
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
    flown = flown_in(
        world,
        uncertain,
        seconds=seconds,
        estimator=estimator,
        controllers=controllers,
        load=load,
    )
    flight, motion, tracks = None, None, {}
    if flown is not None:
        flight = flight_of(flown)
        motion = _motion_of(flown, flight)
        tracks = tracks_of(world.scene, flight)
    if arrivals is None or tracks:
        arrivals = arrivals_of(world.scene, tracks)
    if seconds is None:
        assert flight is not None
        lands = math.ceil(float(flight.time_s[-1]))
        seconds = max(_seconds(world, arrivals), float(lands))
    if flight is not None and on_mission:
        flight = resting(flight, seconds)
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
        motion,
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


def scene_to_run(
    path: str | os.PathLike[str], *, seconds: float | None = None, seed: int = 0
) -> UncertainScene:
    """Read a scene for a simulation; random blasts are sampled as by `jblast world`.

    Args:
        path: Scene file; without [charge] its blast never detonates.
        seconds: End of the world [s].
        seed: Seed of random blasts.

    Returns:
        The scene; with random blasts all of its priors are sampled too.

    Raises:
        InputError: As in `read_scene` and `draw_world`.
    """
    uncertain, world = read_scene_or_world(path, needs_charge=False)
    if world is None:
        return uncertain
    until = math.inf if seconds is None else seconds
    drawn = draw_world(uncertain, world, seed, until_s=until)
    return replace(uncertain, scene=drawn.scene, beliefs={})


@kept_between_runs()
@reported("fly_scene")
def fly_scene(
    scene: UncertainScene | str | os.PathLike[str],
    *,
    vehicles: int = 1,
    controllers: Sequence[str] | None = None,
    seconds: float | None = None,
    step_s: float | None = None,
    backend: str = Options.backend,
    estimator: str = Options.estimator,
    load: Callable[[Scene], FlightLoad] = Options.load,
    tolerance_m: float | None = None,
    profile: str | os.PathLike[str] | None = None,
    profile_moments_about: tuple[float, float, float] | None = None,
    seed: int = 0,
    progress: Progress = False,
) -> Flights | MissionFlight:
    """Fly a scene's vehicle through its blasts, on its mission if it has one.

    Args:
        scene: Scene, or its file; parameters with a prior are sampled.
        vehicles: Number of sampled scenes.
        controllers: As for `jblast.fly`.
        seconds: Duration of the flight; default: until 5 s after the last arrival, of a
            mission until the vehicle is disarmed.
        step_s: Time step of the integrator; default: 0.5 ms, with an estimator or on a
            mission 4 ms.
        backend: "auto", "jax", "warp", "warp:cpu" or "warp:cuda:0".
        estimator: "ekf" for the state of a Kalman filter; "" for the true state.
        load: As in `Options`.
        tolerance_m: Path error within which the vehicle has recovered; default: 0.05 m,
            of a mission 0.2 m.
        profile: File of the impulses of blasts, in place of the laws.
        profile_moments_about: Vector from the reference point of the profile's moments
            to the centre of mass, body axes [m].
        seed: Seed of the samples.
        progress: As for `jblast.fit`.

    Returns:
        Flights by controller, or the flight of the mission.

    Raises:
        InputError: The scene cannot be flown, or an argument cannot be used.

    Example:
        `jblast.fly_scene("scene.toml", vehicles=100, controllers=["cascade"])`
    """
    if isinstance(scene, str | os.PathLike):
        scene = scene_to_run(scene, seconds=seconds, seed=seed)
    uncertain = scene_of(scene)
    on_mission = has_mission(uncertain)
    if on_mission and controllers is not None:
        raise InputError(
            f"{argument('controllers')}: expected none on a mission, which has its own "
            f"controller, got {','.join(controllers)}"
        )
    if on_mission and vehicles != 1:
        raise InputError(
            f"{argument('vehicles')}: expected 1 on a mission, got {vehicles}; for "
            "several use jblast.missions.MissionControl, in Python"
        )
    # an estimator samples its instruments at each step: PX4 has 250 Hz
    default_step = MISSION_STEP_S if on_mission or estimator else STEP_S
    default_tolerance = MISSION_TOLERANCE_M if on_mission else TOLERANCE_M
    options = Options(
        seconds=seconds,
        step_s=default_step if step_s is None else step_s,
        backend=backend,
        tolerance_m=default_tolerance if tolerance_m is None else tolerance_m,
        profile=_profile(profile, profile_moments_about),
        estimator=estimator,
        load=load,
    )
    if on_mission:
        return fly_mission(uncertain, options, seed=seed)
    return fly(
        uncertain, options, vehicles=vehicles, seed=seed, controllers=controllers
    )


def _profile(
    path: str | os.PathLike[str] | None, about: tuple[float, float, float] | None
) -> Profile | None:
    if path is None and about is not None:
        raise InputError(
            f"{argument('profile_moments_about')}: expected it with "
            f"{argument('profile')} only, got no profile"
        )
    return None if path is None else Profile(read_custom_profile(path), about)


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
    return Film(scene, camera, times, background, views, path=path)


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


def has_mission(uncertain: UncertainScene) -> bool:
    """Return whether the scene's vehicle has a mission."""
    vehicle = uncertain.scene.vehicle
    return vehicle is not None and vehicle.mission is not None


def _seconds(world: DrawnWorld, arrivals: Arrivals) -> float:
    """Return the duration of a world: until after its last wave, in tenths of seconds.

    With a flight it is whole seconds, as each duration compiles another program.
    """
    last = arrivals.last_s()
    if world.scene.vehicle is None:
        return math.ceil(10.0 * (last + AFTER_S)) / 10.0
    return float(math.ceil(last + AFTER_FLIGHT_S))


def flown_in(
    world: DrawnWorld,
    uncertain: UncertainScene,
    *,
    seconds: float | None,
    estimator: str = "",
    controllers: Sequence[str] | None = None,
    load: Callable[[Scene], FlightLoad] = Options.load,
) -> Flights | MissionFlight | None:
    """Fly the vehicle of a world through its blasts.

    Args:
        world: The world.
        uncertain: The scene before its parameters were sampled.
        seconds: Duration; None for a mission until it is disarmed.
        estimator: As for `prepare_run`.
        controllers: As for `prepare_run`.
        load: As in `Options`.

    Returns:
        The flight; None without a vehicle, or without a blast at a hovering one.

    Raises:
        InputError: The vehicle cannot be flown.
    """
    if world.scene.vehicle is None or not (world.shots or has_mission(uncertain)):
        return None
    padded = replace(uncertain, scene=with_nevers(world.scene), beliefs={})
    flown = fly_scene(
        padded,
        seconds=seconds,
        estimator=estimator,
        controllers=controllers,
        load=load,
        seed=world.seed,
    )
    if isinstance(flown, MissionFlight):
        return flown
    # `with_nevers` pads the charges, so that one program serves several counts
    count = len(world.scene.charges)
    holds = {
        name: replace(
            hold, encounter=Encounter(*(x[..., :count] for x in hold.encounter))
        )
        for name, hold in flown.holds.items()
    }
    blasts, places = flown.blasts[:count], flown.places_m[..., :count, :]
    return replace(flown, blasts=blasts, places_m=places, holds=holds)


def flight_of(flown: Flights | MissionFlight) -> Trajectory:
    """Return the path of a mission, or of the first controller, up to its loss."""
    if isinstance(flown, MissionFlight):
        flight = flown.trajectory
    else:
        flight = trajectory_of(flown, next(iter(flown.holds)))
    # negated: the speed of a diverged vehicle is NaN
    gone = ~(np.linalg.norm(flight.velocity_m_s, axis=-1) <= LOST_M_S)
    if not gone.any():
        return flight
    rows = int(np.argmax(gone))
    return replace(flight.of_rows(lambda x: x[:rows]), lost=jnp.asarray(True))


def resting(flight: Trajectory, seconds: float) -> Trajectory:
    """Return a flight that lasts to the end of the run: the vehicle stays at rest.

    That of a lost vehicle ends with its loss.
    """
    if bool(flight.lost) or not float(flight.time_s[-1]) < seconds:
        return flight
    longer = flight.of_rows(lambda x: jnp.concatenate([x, x[-1:]]))
    return replace(longer, time_s=longer.time_s.at[-1].set(seconds))


def _motion_of(flown: Flights | MissionFlight, flight: Trajectory) -> Motion:
    """Return the rows of a flight, up to its loss."""
    if isinstance(flown, MissionFlight):
        aim = above_ground(flown.guided.set_point_m)
        error, followed = flown.path_error_m, flown.followed
    else:
        aim = np.broadcast_to(target_of(flown.vehicle), flight.position_m.shape)
        error = np.asarray(path_error(flight, target_of(flown.vehicle)))
        followed = next(iter(flown.holds.values())).followed
    place = flight.position_m if followed is None else followed.shown.position_m
    columns = [getattr(flight, name) for name in Motion._fields[:8]]
    rows = flight.time_s.size
    return Motion(*(np.asarray(x)[:rows] for x in (*columns, aim, error, place)))


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
            None if run.motion is None else _within(run.motion, start, stop),
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
    for part in filmed_packets(run.film, bounds):
        columns = ("time", "x", "y", "polarity")
        yield (
            Frames(part.time_s, part.frames),
            CameraEvents(*(np.asarray(getattr(part.events, name)) for name in columns)),
        )


def _within(motion: Motion, start: float, stop: float) -> Motion:
    some = slice(*np.searchsorted(motion.time_s, [start, stop]).tolist())
    return Motion(*(column[some] for column in motion))


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
