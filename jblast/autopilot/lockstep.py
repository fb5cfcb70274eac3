"""A simulator for PX4: sensors out, rotor controls in, in lockstep.

Until the first controls arrive, samples are sent by the wall clock, so that the
autopilot can start. From then on each step waits for the answer to its HIL_SENSOR.
Until the autopilot has armed, the vehicle does not move and the clock of the blasts is
stopped, so the flight does not depend on the start-up time.

Equations, pulses and steps are those of `vehicle.simulate`, so equal rotor speeds give
equal flights. Units, axes and bits of messages are those of MAVLink's HIL messages as
PX4 reads them (PX4-Autopilot, SimulatorMavlink.cpp and .hpp, commits 000f5fd and
002cb24). Integer fields are rounded, and single-precision fields lose digits when they
are packed. The temperature is sent with the barometer.

PX4's axes are north, east, down, and forward, right, down for the body, with the scalar
of a quaternion first. Axes here are east, north, up, and forward, left, up, with the
scalar last. PX4 numbers the motors of a quadrotor X: front right, rear left (both
counter-clockwise), front left, rear right (clockwise). A control is a share of the
maximum speed, 0 to 1. Thrust is proportional to its square (in PX4: THR_MDL_FAC = 1).

Latitudes and longitudes are computed within compiled programs, as in
`missions.mission.level` and `geodetic`, but with heights above the origin, over level
ground.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, PRNGKeyArray

from jblast.autopilot.mavlink import Link, LinkLost, Message, Sender
from jblast.constants import STANDARD_GRAVITY
from jblast.errors import InputError
from jblast.scene import Imu, Place, Scene, VehicleSpec
from jblast.scene.camera import quaternion_product
from jblast.sensors.flight_sensors import (
    Held,
    Magnetometer,
    Sample,
    Suite,
    dipole_field,
    height_of,
)
from jblast.vehicle import (
    BlastLoad,
    State,
    StepGust,
    Vehicle,
    blast_load,
    start_of,
    vehicle_of,
)
from jblast.vehicle.rollout import INWARD, Flight, FlightState, OneStep, Ticks
from jblast.vehicle.state import four, joined
from jblast.waves.propagation import ambient

SYSTEM, COMPONENT = 1, 51
"""MAVLink system and component of the simulator, as used by other simulators."""
FIRST_ANSWER_S = 1.0
"""Waiting time for the first answer [s]; an autopilot that is ready misses no step."""
FIX_3D, SATELLITES = 3, 12
"""GPS_FIX_TYPE_3D_FIX, and a number of satellites typical of an open sky."""
STATE_LENGTH = 17
"""Length of a state vector: 3 + 3 + 4 + 3 + 4."""
CORNERS = ((1, -1), (-1, 1), (1, 1), (-1, -1))
"""Signs of the forward and left coordinates of PX4's motors 1 to 4."""
MOTOR_WORDS = "1 ahead right, 2 behind left, 3 ahead left, 4 behind right"
ARMED, LOCKSTEP = 128, 1
"""Bits of the mode, and of the flags, of HIL_ACTUATOR_CONTROLS."""
PLACE = Place(47.397742, 8.545594, 0.0)
"""Default position of the origin: PX4's default home, at sea level."""
PERIOD_S = 0.004
"""Period of a step: PX4's simulators send 250 samples per second."""
PERIOD_US = round(1e6 * PERIOD_S)
"""The same [us], the unit of time stamps in messages."""
INERTIAL, FIELD, AIR = 0b111111, 0b111000000, 0b1101000000000
"""Bits of `fields_updated`: accelerometer and gyroscope, magnetometer, barometer with
its temperature."""
SENSOR = (
    *("xacc", "yacc", "zacc", "xgyro", "ygyro", "zgyro", "xmag", "ymag", "zmag"),
    *("abs_pressure", "pressure_alt", "temperature", "fields_updated"),
)
FIX = ("lat", "lon", "alt", "eph", "epv", "vel", "vn", "ve", "vd", "cog")
STATE = (
    *("q0", "q1", "q2", "q3", "rollspeed", "pitchspeed", "yawspeed", "lat", "lon"),
    *("alt", "vx", "vy", "vz", "ind_airspeed", "true_airspeed", "xacc", "yacc", "zacc"),
)
MAX_INT16 = 32_767.0
"""Largest signed 16-bit integer, the type of velocities in messages."""
TURN = np.array([1.0, 1.0, 0.0, 0.0]) / np.sqrt(2)
"""North-east-down to east-north-up (x, y, z, w): half a turn about (1, 1, 0)."""
FLIP = np.array([1.0, 0.0, 0.0, 0.0])
"""Forward-right-down to forward-left-up: half a turn about x."""
RADIUS_M, FLATTENING = 6_378_137.0, 1 / 298.257223563
"""Semi-major axis and flattening of WGS84."""
ECCENTRICITY_SQUARED = FLATTENING * (2 - FLATTENING)
"""Squared first eccentricity of the ellipsoid."""


class Row(NamedTuple):
    """One step of a flight.

    Attributes:
        time_s: Time on the clock of the blasts.
        state: Position, velocity, quaternion, body rate and rotor speeds, concatenated.
        command_rad_s: Rotor speed commands of the autopilot.
    """

    time_s: float
    state: Float[np.ndarray, "17"]
    command_rad_s: Float[np.ndarray, "4"]


@dataclass
class Lockstep:
    """Progress and result of a flight.

    Attributes:
        turns: Number of steps, sent and answered.
        flown: Number of steps since the autopilot armed.
        late: Number of ignored answers to earlier steps.
        ended: Reason of the end.
        rows: Rows of the flight.
    """

    turns: int = 0
    flown: int = 0
    late: int = 0
    ended: str = ""
    rows: list[Row] = field(default_factory=list)

    @property
    def seconds(self) -> float:
        """Duration of the flight so far [s]."""
        return self.flown * PERIOD_S


class Rotors(NamedTuple):
    """Assignment of PX4's motors to rotors.

    Attributes:
        of_motor: Index of the rotor of each motor.
        fastest_rad_s: Maximum rotor speed.
    """

    of_motor: Int[np.ndarray, "4"]
    fastest_rad_s: float

    def speeds(self, controls: Float[np.ndarray, "4"]) -> Float[np.ndarray, "4"]:
        """Return rotor speeds from motor controls; NaN is a motor at rest."""
        turned = np.zeros(4)
        # PX4 sends NaN for motors that are disarmed.
        turned[self.of_motor] = np.clip(np.nan_to_num(controls), 0.0, 1.0)
        return turned * self.fastest_rad_s


class SimulatorState(NamedTuple):
    """State of the simulator between two steps.

    Attributes:
        now: State of the flight.
        before: State of the vehicle one step earlier.
        held: Internal state of the instruments.
    """

    now: FlightState
    before: State
    held: Held


class Programs(NamedTuple):
    """Compiled steps of one vehicle; both return simulator state and message.

    Attributes:
        first: Function without arguments.
        after: Function of simulator state, step number, step number of the world's
            clock, a flag for a moving vehicle, and rotor speeds.
    """

    first: Callable[[], tuple[SimulatorState, Array]]
    after: Callable[..., tuple[SimulatorState, Array]]


def fly_lockstep(
    made: Programs,
    link: Link,
    rotors: Rotors,
    *,
    flight: Lockstep,
    seconds: float | None = None,
    patience_s: float = 60.0,
    each: Callable[[], object] = lambda: None,
) -> Lockstep:
    """Simulate until the autopilot disconnects, does not answer, or the time is over.

    Args:
        made: Compiled steps of the vehicle.
        link: Link to a connected autopilot.
        rotors: Assignment of motors to rotors.
        flight: Empty flight, filled during the simulation.
        seconds: Duration of the flight; None: no end.
        patience_s: Timeout of an answer.
        each: Called at the beginning of each step.

    Returns:
        The flight, with its rows up to its end, whatever the reason.
    """
    sender, still = Sender(SYSTEM, COMPONENT), np.zeros(4)
    carried, reported = made.first()
    numbers, heard = np.asarray(reported), False
    try:
        while seconds is None or flight.seconds < seconds - 0.5 * PERIOD_S:
            each()
            stamp = (flight.turns + 1) * PERIOD_US
            # One write for all messages of a step: PX4 then reads them together.
            link.send(*_frames(sender, numbers, stamp))
            wait = patience_s if heard else PERIOD_S if flight.turns else FIRST_ANSWER_S
            answer = _answer(link, flight, stamp, wait)
            if answer is None and heard:
                flight.ended = f"no answer came within {patience_s:g} s"
                break
            # Once in flight the vehicle keeps moving, also with disarmed rotors.
            goes, speeds = flight.flown > 0, still
            if answer is not None:
                heard = True
                armed = bool(answer.values["mode"] & ARMED)
                goes = goes or armed
                controls = np.array(answer.values["controls"][:4])
                speeds = rotors.speeds(controls) if armed else still
            if goes:
                flight.rows.append(Row(flight.seconds, numbers[-STATE_LENGTH:], speeds))
            carried, reported = made.after(
                carried, flight.turns, flight.flown, goes, speeds
            )
            numbers = np.asarray(reported)
            flight.turns += 1
            flight.flown += goes
        else:
            flight.ended = "the time is over"
    except (LinkLost, InputError) as end:
        flight.ended = str(end)
    except KeyboardInterrupt:
        flight.ended = "interrupted"
    flight.rows.append(Row(flight.seconds, numbers[-STATE_LENGTH:], still))
    return flight


def _answer(link: Link, flight: Lockstep, stamp: int, wait_s: float) -> Message | None:
    """Return the controls that answer a step; None after the waiting time.

    Raises:
        LinkLost: The autopilot has disconnected.
        InputError: It is not in lockstep, or answers a future step.
    """
    until = time.monotonic() + wait_s
    while (left := until - time.monotonic()) > 0:
        message = link.receive(left)
        if message is None:
            return None
        if message.name != "HIL_ACTUATOR_CONTROLS":
            continue
        values = message.values
        if not values["flags"] & LOCKSTEP:
            raise InputError(
                "expected an autopilot in lockstep, bit 0 of the flags of "
                f"HIL_ACTUATOR_CONTROLS, got flags {values['flags']}; build PX4 with "
                "lockstep, as its SITL is by default"
            )
        if values["time_usec"] > stamp:
            raise InputError(
                f"expected controls for the sent time, {stamp} us, or earlier, got "
                f"controls for {values['time_usec']} us: messages out of order"
            )
        # Answers to samples sent before the lockstep began; skipping them restores it.
        if values["time_usec"] < stamp:
            flight.late += 1
            continue
        return message
    return None


def _frames(
    sender: Sender, numbers: Float[np.ndarray, " number"], stamp: int
) -> list[bytes]:
    """Return the messages of a step; HIL_SENSOR is last, because PX4 answers it."""
    sensor, rest = numbers[: len(SENSOR)], numbers[len(SENSOR) :]
    fix, rest = rest[: len(FIX)], rest[len(FIX) :]
    state, has_fix = rest[: len(STATE)], rest[len(STATE)]
    integers = {name: int(x) for name, x in zip(STATE[7:], state[7:], strict=True)}
    speeds = dict(zip(STATE[4:7], state[4:7].tolist(), strict=True))
    frames = []
    if has_fix:
        whole = {name: int(x) for name, x in zip(FIX, fix, strict=True)}
        frames.append(
            sender.pack(
                "HIL_GPS",
                time_usec=stamp,
                fix_type=FIX_3D,
                satellites_visible=SATELLITES,
                **whole,
            )
        )
    frames.append(
        sender.pack(
            "HIL_STATE_QUATERNION",
            time_usec=stamp,
            attitude_quaternion=state[:4].tolist(),
            **speeds,
            **integers,
        )
    )
    values: dict[str, float | int] = dict(zip(SENSOR, sensor.tolist(), strict=True))
    values["fields_updated"] = int(values["fields_updated"])
    return [*frames, sender.pack("HIL_SENSOR", time_usec=stamp, **values)]


def rotors_of(vehicle: Vehicle) -> Rotors:
    """Return the assignment of PX4's motors to a vehicle's rotors.

    Raises:
        InputError: The rotors are not at the corners of an X.
    """
    signs = np.sign(np.asarray(vehicle.rotor_position_m))[:, :2].astype(int)
    places = [(int(x), int(y)) for x, y in signs]
    if sorted(places) != sorted(CORNERS):
        raise InputError(
            f"vehicle {vehicle.name!r}: expected rotors at the corners of an X, as "
            f"PX4's generic quadrotor has them, got the signs {places} of (x, y)"
        )
    # Motors are matched by the signs of their positions, because arms may differ in
    # length.
    order = np.array([places.index(corner) for corner in CORNERS])
    return Rotors(order, float(vehicle.rotor_speed_max_rad_s))


def suite_of(scene: Scene, place: Place | None, load: object, rate: float) -> Suite:
    """Return the instruments of a scene's vehicle.

    Args:
        scene: Scene with air and wind.
        place: Geodetic position of its origin; None: `PLACE`.
        load: Load of the blasts, whose overpressure acts on the barometer; loads of
            other laws have no overpressure.
        rate: Sampling rate of the instruments [Hz].
    """
    where = PLACE if place is None else place
    temperature, pressure = ambient(scene.air)
    return Suite(
        Magnetometer(dipole_field(where.lat_deg, where.lon_deg)),
        imu=Imu(rate=rate, bits=None),
        ground_pressure_pa=pressure,
        ground_temperature_k=temperature,
        wind_m_s=wind_of(scene),
        blasts=load if isinstance(load, BlastLoad) else None,
    )


def wind_of(scene: Scene) -> Float[Array, "3"]:
    """Return the velocity of a scene's air: east, north, up [m/s]."""
    air = scene.air
    return jnp.stack([air.wind_east, air.wind_north, 0 * air.wind_east])


class Origin(NamedTuple):
    """Origin of the east-north-up axes.

    Attributes:
        centred_m: Position relative to the Earth's centre.
        axes: Rows: directions of east, north and up in Earth-centred axes.
        height_m: Height above the ellipsoid.
    """

    centred_m: Float[np.ndarray, "3"]
    axes: Float[np.ndarray, "3 3"]
    height_m: float


class SimulatorSteps(eqx.Module):
    """Simulation steps of one vehicle.

    Attributes:
        flight: Vehicle, initial state, wind and loads, without a controller.
        suite: Instruments.
        origin: Geodetic origin of the scene.
        key: Key of the instruments' errors.
    """

    flight: Flight
    suite: Suite
    origin: Origin
    key: PRNGKeyArray

    def start(self) -> SimulatorState:
        """Return the state of the simulator before the first step."""
        state = self.flight.state
        return SimulatorState(
            self._step().start(), state, self.suite.start(self.key, state)
        )

    def reported(
        self, carried: SimulatorState, turn: Int[Array, ""], world_turn: Int[Array, ""]
    ) -> tuple[SimulatorState, Float[Array, " number"]]:
        """Return the simulator state after reading the instruments, and its message.

        Args:
            carried: State after the previous step.
            turn: Number of the step since the start of the instruments.
            world_turn: Number of the step since the start of the blasts' clock.

        Returns:
            The numbers of `Readings`, then the state: position, velocity, quaternion,
            body rate, rotor speeds.
        """
        state = joined(carried.now.motion)
        period = jnp.asarray(PERIOD_S, float)
        time_s = jnp.asarray(world_turn, float) * period
        sample, held = self.suite(
            self.key, turn, carried.held, carried.before, state, time_s, period
        )
        reported = readings_of(
            self.origin,
            sample,
            state,
            self.suite.wind_m_s,
            self.suite.ground_temperature_k,
            self.suite.gps.noise(),
        )
        true = (
            *(state.position_m, state.velocity_m_s, state.quaternion),
            *(state.body_rate_rad_s, state.rotor_speed_rad_s),
        )
        # One array: a single transfer from the device per step.
        numbers = jnp.concatenate([*map(jnp.ravel, reported), *map(jnp.ravel, true)])
        return SimulatorState(carried.now, state, held), numbers

    def moved(
        self,
        carried: SimulatorState,
        world_turn: Int[Array, ""],
        speeds_rad_s: Float[Array, "4"],
    ) -> SimulatorState:
        """Return the simulator state after a step of the vehicle.

        Args:
            carried: State returned by `reported`.
            world_turn: Number of the step since the start of the blasts' clock.
            speeds_rad_s: Rotor speed commands.
        """
        # Stages inside the step, as in `rollout.timetable`.
        start = jnp.asarray(world_turn, float) * PERIOD_S
        inward = jnp.maximum(
            INWARD * PERIOD_S, 2 * np.finfo(float).eps * (start + PERIOD_S)
        )
        stages = start + jnp.stack([inward, 0.5 * PERIOD_S, PERIOD_S - inward])
        none = jnp.zeros((3,), jnp.int32)
        length = jnp.asarray(PERIOD_S, float)
        # The commands are fixed within a step, so their rows are unused zeros.
        tick = Ticks(stages, start, length, none, jnp.asarray(True))
        now = carried.now._replace(command=four(speeds_rad_s))
        return carried._replace(now=self._step().advance_pushed(now, tick))

    def _step(self) -> OneStep:
        period = jnp.asarray(PERIOD_S, float)
        return OneStep(self.flight, period, False, None)


def turns_of(
    scene: Scene, spec: VehicleSpec, place: Place | None, seed: int, source: str = ""
) -> SimulatorSteps:
    """Return the simulation steps of a scene's vehicle; on the ground its rotors rest.

    Args:
        scene: Scene without unknown numbers.
        spec: The vehicle.
        place: Geodetic position of the origin; None: `PLACE`.
        seed: Seed of the instruments' errors.
        source: File of the scene, for messages.

    Raises:
        InputError: The vehicle starts below ground.
    """
    if float(spec.position[2]) < 0:
        raise InputError(
            f"{source or 'scene'}: [vehicle] position_m: expected a vehicle that is "
            f"not below ground, got up {float(spec.position[2]):g} m"
        )
    vehicle, load = vehicle_of(spec), blast_load(scene)
    start = start_of(spec)
    if float(spec.position[2]) == 0:
        start = replace(start, rotor_speed_rad_s=0 * start.rotor_speed_rad_s)
    wind = wind_of(scene)
    flight = Flight(
        vehicle, start, None, None, StepGust(wind, 0 * wind[0]), (load,), jnp.zeros(())
    )
    suite = suite_of(scene, place, load, 1 / PERIOD_S)
    where = PLACE if place is None else place
    return SimulatorSteps(flight, suite, origin_at(where), jax.random.key(seed))


def programs(turns: SimulatorSteps) -> Programs:
    """Compile the steps of a vehicle, before a client connects.

    Arrays are arguments of the programs, so a scene of the same shapes reuses them.
    """
    arrays, rest = eqx.partition(turns, eqx.is_array)

    def first(arrays: SimulatorSteps) -> tuple[SimulatorState, Array]:
        own = eqx.combine(arrays, rest)
        return own.reported(own.start(), jnp.asarray(0), jnp.asarray(0))

    def after(
        arrays: SimulatorSteps,
        carried: SimulatorState,
        turn: Any,
        world: Any,
        goes: Any,
        speeds: Any,
    ) -> tuple[SimulatorState, Array]:
        own = eqx.combine(arrays, rest)
        moved = own.moved(carried, world, speeds)
        carried = jax.tree.map(lambda a, b: jnp.where(goes, a, b), moved, carried)
        return own.reported(carried, turn + 1, world + jnp.asarray(goes, int))

    begin, goes_on = jax.jit(first), jax.jit(after)
    carried, _ = begin(arrays)
    goes_on(arrays, carried, 0, 0, False, np.zeros(4))
    return Programs(partial(begin, arrays), partial(goes_on, arrays))


class Readings(NamedTuple):
    """Numbers of three messages, in the order of `SENSOR`, `FIX` and `STATE`.

    Attributes:
        sensor: Fields of HIL_SENSOR.
        fix: Fields of HIL_GPS.
        state: Fields of HIL_STATE_QUATERNION.
        has_fix: 1 if this step has a fix, else 0.
    """

    sensor: Float[Array, "13"]
    fix: Float[Array, "10"]
    state: Float[Array, "18"]
    has_fix: Float[Array, ""]


def readings_of(
    origin: Origin,
    sample: Sample,
    now: State,
    air_velocity_m_s: Float[Array, "3"],
    temperature_k: Float[Array, ""],
    noise_m: Float[Array, "6"],
) -> Readings:
    """Return the message fields of a sample and of the vehicle's true state.

    Args:
        origin: Geodetic origin of the scene.
        sample: Sample of the instruments.
        now: True state of the vehicle.
        air_velocity_m_s: Wind, east, north, up.
        temperature_k: Air temperature.
        noise_m: Standard deviations of a fix's numbers.
    """
    updated = INERTIAL + jnp.where(sample.has_field, FIELD, 0)
    updated = updated + jnp.where(sample.has_pressure, AIR, 0)
    # The pressure altitude refers to the standard atmosphere, not to the scene's air.
    standard = height_of(sample.pressure_pa, *map(jnp.asarray, (101_325.0, 288.15)))
    force, rate = body(sample.force_m_s2), body(sample.rate_rad_s)
    sensor = [
        *(*force, *rate, *body(sample.field_gauss)),
        *(sample.pressure_pa / 100, standard, temperature_k - 273.15, updated),
    ]
    moves = world(sample.fix.velocity_m_s)
    course = jnp.degrees(jnp.arctan2(moves[1], moves[0])) % 360
    fix = [
        *_geodetic_whole(origin, sample.fix.position_m),
        *_whole(noise_m[jnp.array([0, 2])] * 100),
        jnp.round(100 * jnp.linalg.norm(moves[:2])),
        *_whole(100 * moves),
        jnp.round(100 * course) % 36_000,
    ]
    return Readings(
        jnp.stack([jnp.asarray(x, float) for x in sensor]),
        jnp.stack([jnp.asarray(x, float) for x in fix]),
        state_reported(origin, now, force, air_velocity_m_s),
        sample.has_fix.astype(float),
    )


def state_reported(
    origin: Origin,
    now: State,
    force_m_s2: Float[Array, "3"],
    air_velocity_m_s: Float[Array, "3"],
) -> Float[Array, "18"]:
    """Return the numbers of HIL_STATE_QUATERNION.

    Args:
        origin: Geodetic origin of the scene.
        now: True state of the vehicle.
        force_m_s2: Specific force, the autopilot's body axes.
        air_velocity_m_s: Wind, east, north, up.
    """
    through = jnp.linalg.norm(now.velocity_m_s - air_velocity_m_s)
    speed = jnp.round(100 * through)
    single = [*attitude_out(now.quaternion), *body(now.body_rate_rad_s)]
    return jnp.stack(
        [
            *(jnp.asarray(x, jnp.float32).astype(float) for x in single),
            *_geodetic_whole(origin, now.position_m),
            *_whole(100 * world(now.velocity_m_s)),
            *(speed, speed),
            *_whole(1000 / STANDARD_GRAVITY * force_m_s2),
        ]
    )


def _geodetic_whole(origin: Origin, place_m: Float[Array, "3"]) -> list[Array]:
    """Return latitude and longitude [1e-7 degree], height [mm]."""
    return [*jnp.round(geodetic_of(origin, place_m) * jnp.array([1e7, 1e7, 1e3]))]


def _whole(numbers: Float[Array, " n"]) -> list[Array]:
    # the fields have 16 bits: a larger number would wrap around
    return [*jnp.clip(jnp.round(numbers), -MAX_INT16, MAX_INT16)]


def world(vector: Float[Array, "3"]) -> Float[Array, "3"]:
    """Convert a vector between east-north-up and north-east-down; its own inverse."""
    return jnp.stack([vector[1], vector[0], -vector[2]])


def body(vector: Float[Array, "3"]) -> Float[Array, "3"]:
    """Convert a vector between the body axes of both conventions; its own inverse."""
    return jnp.stack([vector[0], -vector[1], -vector[2]])


def attitude_out(quaternion: Float[Array, "4"]) -> Float[Array, "4"]:
    """Return an attitude (x, y, z, w) in the autopilot's form (w, x, y, z), w >= 0."""
    turned = quaternion_product(
        quaternion_product(jnp.asarray(TURN), quaternion), jnp.asarray(FLIP)
    )
    # q and -q are one rotation; PX4 expects the scalar to be non-negative.
    turned = jnp.where(turned[3] < 0, -turned, turned)
    return jnp.roll(turned, 1)


def origin_at(place: Place) -> Origin:
    """Return the origin at a geodetic position."""
    lat, lon = np.radians(place.lat_deg), np.radians(place.lon_deg)
    sin, cos, sine, cosine = np.sin(lat), np.cos(lat), np.sin(lon), np.cos(lon)
    axes = np.array(
        [
            [-sine, cosine, 0.0],
            [-sin * cosine, -sin * sine, cos],
            [cos * cosine, cos * sine, sin],
        ]
    )
    # radius of curvature in the prime vertical
    normal = RADIUS_M / np.sqrt(1 - ECCENTRICITY_SQUARED * sin * sin)
    stretch = np.array([1.0, 1.0, 1 - ECCENTRICITY_SQUARED])
    return Origin((normal * stretch + place.alt_m) * axes[2], axes, float(place.alt_m))


def geodetic_of(origin: Origin, place_m: Float[Array, "3"]) -> Float[Array, "3"]:
    """Return latitude, longitude [degree] and height [m] of a position."""
    flat = jnp.asarray(place_m).at[2].set(0.0)
    # Project from the tangent plane to the ellipsoid: 2 iterations give 1 mm at 20 km.
    for _ in range(2):
        flat = flat.at[2].add(origin.height_m - _geodetic(origin, flat)[2])
    found = _geodetic(origin, flat)
    return found.at[2].set(place_m[2] + origin.height_m)


def _geodetic(origin: Origin, enu_m: Float[Array, "3"]) -> Float[Array, "3"]:
    """Return geodetic coordinates by Bowring (1976), to 1e-11 rad near the ground."""
    x, y, z = origin.centred_m + origin.axes.T @ enu_m
    across = jnp.hypot(x, y)
    short = 1 - FLATTENING
    reduced = jnp.arctan2(z, short * across)
    lat = jnp.arctan2(
        z
        + ECCENTRICITY_SQUARED
        / (1 - ECCENTRICITY_SQUARED)
        * short
        * RADIUS_M
        * jnp.sin(reduced) ** 3,
        across - ECCENTRICITY_SQUARED * RADIUS_M * jnp.cos(reduced) ** 3,
    )
    normal = RADIUS_M / jnp.sqrt(1 - ECCENTRICITY_SQUARED * jnp.sin(lat) ** 2)
    # no division by cos(lat), which is 0 at the poles
    height = across * jnp.cos(lat) + z * jnp.sin(lat) - RADIUS_M**2 / normal
    return jnp.stack([jnp.degrees(lat), jnp.degrees(jnp.arctan2(y, x)), height])
