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

PX4 numbers the motors of a quadrotor X: front right, rear left (both
counter-clockwise), front left, rear right (clockwise). A control is a share of the
maximum speed, 0 to 1. Thrust is proportional to its square (in PX4: THR_MDL_FAC = 1).
"""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

from jblast.autopilot.mavlink import (
    FIX,
    Link,
    down,
    ending,
    message,
    named,
    place_fields,
    right,
    scalar_first,
    whole,
)
from jblast.errors import require
from jblast.observations.places import Frame
from jblast.scene import Imu, Place, Scene, VehicleSpec
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
    Gust,
    State,
    Vehicle,
    blast_load,
    start_of,
    vehicle_of,
)
from jblast.vehicle.from_scene import wind_of
from jblast.vehicle.rollout import FlightState, Simulator
from jblast.vehicle.state import four, joined
from jblast.waves.propagation import ambient

SYSTEM, COMPONENT = 1, 51
"""MAVLink system and component of the simulator, as used by other simulators."""
HEARTBEAT = {"autopilot": 8, "mavlink_version": 3}
"""Fields of the simulator's heartbeat: MAV_AUTOPILOT_INVALID is not an autopilot."""
FIRST_ANSWER_S = 1.0
"""Waiting time for the first answer [s]; an autopilot that is ready misses no step."""
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


@dataclass
class Lockstep:
    """Progress and result of a flight.

    Attributes:
        turns: Number of steps, sent and answered.
        flown: Number of steps since the autopilot armed.
        late: Number of ignored answers to earlier steps.
        ended: Reason of the end.
        position_m: Last position: east, north, up.
    """

    turns: int = 0
    flown: int = 0
    late: int = 0
    ended: str = ""
    position_m: tuple[float, ...] = ()

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
        state: State of the vehicle, at which its instruments were read.
        held: Internal state of the instruments.
        turn: Number of their last sample; -1 before the first one.
        flown: Number of steps on the clock of the blasts.
    """

    now: FlightState
    state: State
    held: Held
    turn: Int[Array, ""]
    flown: Int[Array, ""]


Turn = Callable[
    [SimulatorState, bool, Float[np.ndarray, "4"]], tuple[SimulatorState, Sample]
]
"""Compiled `SimulatorSteps.step`."""


def fly_lockstep(
    turn: Turn,
    carried: SimulatorState,
    link: Link,
    rotors: Rotors,
    messages: Callable[[Sample, State, int], list[Any]],
    *,
    flight: Lockstep,
    seconds: float | None = None,
    patience_s: float = 60.0,
) -> Lockstep:
    """Simulate until the autopilot disconnects, does not answer, or the time is over.

    Args:
        turn: Compiled step of the vehicle.
        carried: State of the simulator.
        link: Link to a connected autopilot.
        rotors: Assignment of motors to rotors.
        messages: Messages of a sample and a true state with a time stamp [us].
        flight: Empty flight, filled during the simulation.
        seconds: Duration of the flight; None: no end.
        patience_s: Timeout of an answer.
    """
    still, heard = np.zeros(4), False
    carried, sample = turn(carried, False, still)
    with ending(flight):
        while seconds is None or flight.seconds < seconds - 0.5 * PERIOD_S:
            # Simulated time: stamps of the wall clock would depend on the speed of the
            # machine and of the autopilot.
            link.now_s = flight.turns * PERIOD_S
            stamp = (flight.turns + 1) * PERIOD_US
            link.send(*messages(sample, carried.state, stamp))
            wait = patience_s if heard else PERIOD_S if flight.turns else FIRST_ANSWER_S
            answer = _answer(link, flight, stamp, wait)
            if answer is None and heard:
                flight.ended = f"no answer came within {patience_s:g} s"
                break
            heard = answer is not None
            # Once in flight the vehicle keeps moving, also with disarmed rotors.
            goes, speeds = flight.flown > 0, still
            if answer is not None and answer.mode & ARMED:
                goes, speeds = True, rotors.speeds(np.array(answer.controls[:4]))
            carried, sample = turn(carried, goes, speeds)
            flight.turns += 1
            flight.flown += goes
        else:
            flight.ended = "the time is over"
    flight.position_m = tuple(float(x) for x in carried.state.position_m)
    return flight


def _answer(link: Link, flight: Lockstep, stamp: int, wait_s: float) -> Any | None:
    """Return the controls that answer a step; None after the waiting time.

    Raises:
        LinkLost: The autopilot has disconnected.
        InputError: It is not in lockstep, or answers a future step.
    """
    until = time.monotonic() + wait_s
    while (left := until - time.monotonic()) > 0:
        came = link.receive(left)
        if came is None:
            return None
        if came.get_type() != "HIL_ACTUATOR_CONTROLS":
            continue
        words = "an autopilot in lockstep, bit 0 of the flags"
        got = f"{came.flags}; build PX4 with lockstep, as its SITL is by default"
        require(came.flags & LOCKSTEP, "HIL_ACTUATOR_CONTROLS", words, got)
        words = f"controls for the sent time, {stamp} us, or earlier"
        got = f"controls for {came.time_usec} us: messages out of order"
        require(came.time_usec <= stamp, "HIL_ACTUATOR_CONTROLS", words, got)
        # Answers to samples sent before the lockstep began; skipping them restores it.
        if came.time_usec == stamp:
            return came
        flight.late += 1
    return None


def messages_of(
    suite: Suite, frame: Frame, sample: Sample, state: State, stamp: int
) -> list[Any]:
    """Return the messages of a step; HIL_SENSOR is last, because PX4 answers it.

    Args:
        suite: The instruments.
        frame: Geodetic frame of the scene.
        sample: Sample of the instruments.
        state: True state of the vehicle.
        stamp: Time stamp [us].
    """
    read, true = jax.tree.map(np.asarray, (sample, state))
    sent = []
    if read.has_fix:
        moves = down(read.fix.velocity_m_s)
        course = np.degrees(np.arctan2(moves[1], moves[0])) % 360
        noise = np.asarray(suite.gps.noise())
        speeds = [*noise[[0, 2]], *moves, np.hypot(*moves[:2])]
        sent.append(
            message(
                "HIL_GPS",
                time_usec=stamp,
                **FIX,
                **place_fields(frame, read.fix.position_m),
                **whole(
                    ("eph", "epv", "vn", "ve", "vd", "vel"), 100 * np.array(speeds)
                ),
                cog=round(100 * course) % 36_000,
            )
        )
    sent.append(state_message(frame, true, stamp))
    standard = height_of(*map(jnp.asarray, (read.pressure_pa, 101_325.0, 288.15)))
    axes = [f"{axis}{kind}" for kind in ("acc", "gyro", "mag") for axis in "xyz"]
    inertial = map(right, (read.force_m_s2, read.rate_rad_s, read.field_gauss))
    has = FIELD * bool(read.has_field) + AIR * bool(read.has_pressure)
    sent.append(
        message(
            "HIL_SENSOR",
            time_usec=stamp,
            abs_pressure=float(read.pressure_pa) / 100,
            # It refers to the standard atmosphere, not to the scene's air.
            pressure_alt=float(standard),
            temperature=float(suite.ground_temperature_k) - 273.15,
            fields_updated=INERTIAL + has,
            **named(axes, np.concatenate([*inertial])),
        )
    )
    return sent


def state_message(frame: Frame, now: State, stamp: int) -> Any:
    """Return HIL_STATE_QUATERNION, without accelerations and airspeeds.

    Args:
        frame: Geodetic frame of the scene.
        now: True state of the vehicle.
        stamp: Time stamp [us].
    """
    turning = ("rollspeed", "pitchspeed", "yawspeed")
    return message(
        "HIL_STATE_QUATERNION",
        time_usec=stamp,
        attitude_quaternion=scalar_first(np.asarray(now.quaternion)).tolist(),
        **named(turning, right(np.asarray(now.body_rate_rad_s))),
        **place_fields(frame, np.asarray(now.position_m)),
        **whole(("vx", "vy", "vz"), 100 * down(np.asarray(now.velocity_m_s))),
    )


def rotors_of(vehicle: Vehicle) -> Rotors:
    """Return the assignment of PX4's motors to a vehicle's rotors.

    Raises:
        InputError: The rotors are not at the corners of an X.
    """
    signs = np.sign(np.asarray(vehicle.rotor_position_m))[:, :2].astype(int)
    places = [(int(x), int(y)) for x, y in signs]
    words = "rotors at the corners of an X, as PX4's generic quadrotor has them"
    crossed, got = sorted(places) == sorted(CORNERS), f"the signs {places} of (x, y)"
    require(crossed, f"vehicle {vehicle.name!r}", words, got)
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


def flight_of(
    scene: Scene, spec: VehicleSpec, load: Any, source: str = ""
) -> tuple[Simulator, State]:
    """Return the steps of a scene's vehicle without a controller, and its start.

    Args:
        scene: Scene without unknown numbers.
        spec: The vehicle; on the ground its rotors rest.
        load: Load of the blasts.
        source: File of the scene, for messages.

    Raises:
        InputError: The vehicle starts below ground.
    """
    up, start = float(spec.position[2]), start_of(spec)
    where = f"{source or 'scene'}: [vehicle] position_m"
    require(up >= 0, where, "a vehicle that is not below ground", f"up {up:g} m")
    if up == 0:
        start = replace(start, rotor_speed_rad_s=0 * start.rotor_speed_rad_s)
    wind = wind_of(scene)
    simulator = Simulator(
        vehicle_of(spec),
        jnp.asarray(PERIOD_S),
        wind=Gust(wind, 0 * wind[0]),
        loads=(load,),
        ground_up_m=jnp.zeros(()),
    )
    return simulator, start


class SimulatorSteps(eqx.Module):
    """Simulation steps of one vehicle.

    Attributes:
        simulator: Steps of the vehicle, without a controller.
        initial: Initial state.
        suite: Instruments.
        key: Key of the instruments' errors.
    """

    simulator: Simulator
    initial: State
    suite: Suite
    key: PRNGKeyArray

    def start(self) -> SimulatorState:
        """Return the state of the simulator before the first sample."""
        now, held = (
            self.simulator.start(self.initial),
            self.suite.start(self.key, self.initial),
        )
        turn, flown = jnp.array(-1, int), jnp.array(0, int)
        return SimulatorState(now, self.initial, held, turn, flown)

    def step(
        self, carried: SimulatorState, goes: Bool[Array, ""], speeds: Float[Array, "4"]
    ) -> tuple[SimulatorState, Sample]:
        """Move the vehicle and read its instruments.

        Args:
            carried: State after the previous step.
            goes: False for a vehicle that does not move yet.
            speeds: Commanded rotor speeds [rad/s].
        """
        simulator, (now, before, held, turn, flown) = self.simulator, carried
        moved = simulator.step(now, flown, command=four(speeds))
        now = jax.tree.map(lambda a, b: jnp.where(goes, a, b), moved, now)
        state, turn, flown = (
            joined(now.motion),
            turn + 1,
            flown + jnp.asarray(goes, int),
        )
        period = jnp.asarray(PERIOD_S, float)
        sample, held = self.suite(
            self.key,
            turn,
            held,
            before,
            state,
            jnp.asarray(flown, float) * period,
            period,
        )
        return SimulatorState(now, state, held, turn, flown), sample


def turns_of(
    scene: Scene, spec: VehicleSpec, place: Place, seed: int, source: str = ""
) -> SimulatorSteps:
    """Return the simulation steps of a scene's vehicle.

    Args:
        scene: Scene without unknown numbers.
        spec: The vehicle.
        place: Geodetic position of the origin.
        seed: Seed of the instruments' errors.
        source: File of the scene, for messages.

    Raises:
        InputError: The vehicle starts below ground.
    """
    load = blast_load(scene)
    suite = suite_of(scene, place, load, 1 / PERIOD_S)
    simulator, state = flight_of(scene, spec, load, source)
    return SimulatorSteps(simulator, state, suite, jax.random.key(seed))


def compiled(turns: SimulatorSteps) -> tuple[Turn, SimulatorState]:
    """Return the compiled step of a vehicle, and the state before the first one.

    Arrays are arguments of the program, so a scene of the same shapes reuses it.
    """
    arrays, rest = eqx.partition(turns, eqx.is_array)
    program = jax.jit(lambda arrays, *given: eqx.combine(arrays, rest).step(*given))
    carried = turns.start()
    program(arrays, carried, False, np.zeros(4))
    return partial(program, arrays), carried
