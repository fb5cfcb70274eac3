"""Readings of a world that are picked from the records of its sensors.

The true arrival times are used only for the search interval of each blast, which
extends up to midway to the previous and next blasts.

Inertial units on the vehicle record jolts. The initial attitude and velocity of an
interval and the rotor speeds are those of the flight.

A microphone or pressure sensor with sampling options (`rate_hz`, noise, bits) has its
arrivals and peaks picked from its record, as by `jblast pick`, with their errors. A
sample is the mean over its interval, which begins at its stamp. A pick assigns it to
the stamp, so half a sampling interval is added to an arrival. The position of a steep
front within its interval is unknown: 1/12 of the squared interval is added to the
variance of an arrival, and to that of a peak the corresponding decay of the pulse.
"""

import math
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from jblast.constants import STANDARD_SOUND_SPEED
from jblast.observations import Observations, observed
from jblast.observations.records.recording import PressureRecord, Recording
from jblast.observations.table import stacked
from jblast.scene import Imu, Scene, Sensor
from jblast.scene.sensor_kinds import SENSOR_KINDS
from jblast.sensors.imu import (
    Inertial,
    clipped,
    inertial_of,
    states_at,
    with_errors,
    with_wave_rows,
)
from jblast.sensors.jolt_pick import JoltPick, base_of, pick_jolt
from jblast.signals.picks import RecordPick, pick_records
from jblast.signals.picks.pick import LEAST_SAMPLES
from jblast.signals.picks.pick_log import kept_quantities, log_value
from jblast.vehicle import BlastLoad, State, Trajectory, Vehicle, blast_load, vehicle_of
from jblast.vehicle.control.allocation import hover_in_wind
from jblast.vehicle.loads.load import Pulse
from jblast.vehicle.quadrotor import required_body
from jblast.world.drawn import VEHICLE, DrawnWorld, with_nevers
from jblast.world.perceived import Arrivals, interval_about

MAX_DIRECTION_ERROR_RAD = 0.5
"""Standard error above which a direction is not reported; 29 degrees, declared."""


class ImuRecord(NamedTuple):
    """Record of one inertial measurement unit.

    Attributes:
        sensor: Position, mount and clock of the unit.
        imu: Ranges, noise and sampling of the unit.
        stamps_s: Beginning of each sample, by the unit's clock.
        samples: Specific force and body rate.
        flight: Flight of the vehicle, up to its loss.
    """

    sensor: Sensor
    imu: Imu
    stamps_s: Float[np.ndarray, " sample"]
    samples: Inertial
    flight: Trajectory

    @property
    def common_s(self) -> Float[np.ndarray, " sample"]:
        """Beginning of each sample, on the common clock."""
        return self.stamps_s - float(self.sensor.clock_offset_s)

    @property
    def clipped(self) -> bool:
        """True if a sample is at a limit of the unit's range."""
        return bool(clipped(self.samples, self.imu).any())


class Reading(NamedTuple):
    """A reading of a blast, picked from a record.

    Attributes:
        sensor: Name of the sensor.
        quantity: Quantity.
        value: Value, times on the sensor's clock.
        sigma: Its standard deviation.
        shot: Name of the blast.
        position: Position of the sensor at the reading [m].
        lower_bound: True if the value is a lower bound.
    """

    sensor: str
    quantity: str
    value: float
    sigma: float
    shot: str
    position: Float[np.ndarray, "3"]
    lower_bound: bool = False


def log_of(rows: Sequence[Reading]) -> Observations | None:
    """Return a log of picked readings; None without any."""
    if not rows:
        return None
    names, quantities, values, sigmas, shots, places, bounds = zip(*rows, strict=True)
    return observed(
        names,
        quantities,
        values,
        sigmas,
        shot=shots,
        position=np.stack(places),
        lower_bound=np.array(bounds),
        comments=("picked: readings of sensors with samples",),
    )


def picked_jolts(
    world: DrawnWorld, arrivals: Arrivals, records: Sequence[ImuRecord]
) -> tuple[list[Reading], int]:
    """Return the jolts of the units with a specified sampling.

    Args:
        world: The world.
        arrivals: Times and positions of arrivals.
        records: Records of the units.

    Returns:
        Times, sizes and directions; and the number of waves without a pick.
    """
    rows: list[Reading] = []
    spec = world.scene.vehicle
    if spec is None:
        return rows, 0
    load, vehicle = blast_load(with_nevers(world.scene)), vehicle_of(spec)
    yaw, missed, crossing_s = jnp.asarray(spec.yaw), 0, _crossing_s(vehicle)
    for record in records:
        if record.sensor.imu is None:
            continue
        row = arrivals.entities.index(record.sensor.name)
        comes = arrivals.times_s[AIR][row]
        ends = record.common_s[-1] + 1 / record.imu.rate
        for shot in np.flatnonzero(comes < ends).tolist():
            pick, first = _pick(world, record, vehicle, comes, shot)
            if not isinstance(pick, JoltPick):
                # Waves below the noise are counted, so that a report can state how many
                # were lost.
                missed += 1
                continue
            place = arrivals.places_m[AIR][row, shot]
            charge = world.scene.charges[shot]
            state = states_at(record.flight, jnp.asarray([comes[shot]]))
            state = jax.tree.map(lambda column: column[0], state)
            law = _jolt_law(load, jnp.asarray(shot), state, vehicle, yaw)
            rows += [
                Reading(record.sensor.name, what, x, sd, charge.name, place, bound)
                for what, x, sd, bound in _readings(
                    record, pick, first, crossing_s, law
                )
            ]
    return rows, missed


def _pick(
    world: DrawnWorld,
    record: ImuRecord,
    vehicle: Vehicle,
    comes_s: np.ndarray,
    shot: int,
) -> tuple[JoltPick | str, int]:
    """Return the jolt of one blast and the first sample of its search interval."""
    start, stop = interval_about(comes_s, shot)
    common = record.common_s
    some = np.flatnonzero((common >= start) & (common < stop))
    if not some.size:
        return "expected samples within the search interval", 0
    part, flight = slice(some[0], some[-1] + 1), record.flight
    middle = jnp.asarray(common[part] + 0.5 / record.imu.rate)
    first = states_at(flight, jnp.asarray(common[part][:1]))
    begin = jax.tree.map(lambda column: column[0], first)
    air = world.scene.air
    # The vehicle's estimator would remove the gyroscope's bias; here it is the mean
    # difference from the truth over the first samples.
    rates = record.samples.rate[part]
    base = base_of(len(rates))
    edges = jnp.asarray(common[some[0]] + np.arange(base + 1) / record.imu.rate)
    true = inertial_of(flight, edges, record.sensor.offset_m, record.sensor.quaternion)
    off = jnp.mean(rates[:base] - true.rate[: len(rates)], axis=0)
    pick = pick_jolt(
        Inertial(record.samples.force[part], rates - off[None]),
        record.imu,
        vehicle,
        begin,
        states_at(flight, middle).rotor_speed_rad_s,
        record.sensor.offset_m,
        record.sensor.quaternion,
        wind_m_s=jnp.stack([air.wind_east, air.wind_north, 0 * air.wind_east]),
    )
    return pick, int(some[0])


class JoltLaw(NamedTuple):
    """Jolts that the law of flights gives a vehicle.

    Attributes:
        hovering_m_s: Change of velocity if it hovers, as the law of jolts supposes.
        flying_m_s: Change of velocity with its velocity, attitude and rotor speeds.
    """

    hovering_m_s: Float[Array, "3"]
    flying_m_s: Float[Array, "3"]

    @property
    def error_m_s(self) -> float:
        """Error of the law of jolts by the vehicle's motion."""
        return float(jnp.linalg.norm(self.flying_m_s - self.hovering_m_s))

    @property
    def direction_error_rad(self) -> float:
        """The same for the direction, at most; infinite without a jolt."""
        size = float(jnp.linalg.norm(self.hovering_m_s))
        return self.error_m_s / size if size else math.inf


@eqx.filter_jit
def _jolt_law(
    load: BlastLoad,
    shot: Int[Array, ""],
    state: State,
    vehicle: Vehicle,
    yaw: Float[Array, ""],
) -> JoltLaw:
    """Return the jolts by the front of one blast at the state of a flight."""
    waves = jax.tree.map(lambda x: x[shot][None], load.waves)
    load = replace(load, waves=waves, charges=1)
    (begins_s,), (ends_s,) = load.span_s(state.position_m, vehicle)
    hovers = hover_in_wind(vehicle, state.position_m, yaw, load.wind_m_s)
    return JoltLaw(
        *(
            load.impulse(begins_s, ends_s, one, vehicle)[0] / vehicle.mass_kg
            for one in (hovers, state)
        )
    )


def _crossing_s(vehicle: Vehicle) -> float:
    """Return the crossing time of a weak front over a vehicle."""
    area = float(jnp.mean(required_body(vehicle.body).area_m2))
    return float(np.sqrt(4 / np.pi * area)) / STANDARD_SOUND_SPEED


def _readings(
    record: ImuRecord, pick: JoltPick, first: int, crossing_s: float, law: JoltLaw
) -> list[tuple[str, float, float, bool]]:
    """Return rows of quantity, value, sigma and a flag for lower bounds.

    Args:
        record: Record of the unit.
        pick: Its jolt.
        first: First sample of the search interval.
        crossing_s: Crossing time of the front over the vehicle [s].
        law: Jolts of the vehicle by the law.
    """
    step = 1 / record.imu.rate
    onset = float(record.stamps_s[first + pick.onset])
    # The start of a force within its sample is unknown: a uniform error of variance
    # step^2 / 12. The force begins when the front reaches the body, half a crossing
    # time before it reaches the centre.
    readings = [
        (
            AIR,
            onset + 0.5 * (step + crossing_s),
            step / math.sqrt(12.0),
            False,
        ),
        (
            "jolt_velocity_m_s",
            pick.speed_m_s[0],
            math.hypot(pick.speed_m_s[1], law.error_m_s),
            pick.clipped,
        ),
    ]
    # A clipped axis biases the direction, whereas the size remains a lower bound.
    if not pick.clipped:
        readings += [
            (quantity, value, math.hypot(sd, law.direction_error_rad), False)
            for quantity, (value, sd) in (
                ("jolt_bearing_rad", pick.bearing_rad),
                ("jolt_elevation_rad", pick.elevation_rad),
            )
            if math.hypot(sd, law.direction_error_rad) < MAX_DIRECTION_ERROR_RAD
        ]
    return readings


def imu_records(
    world: DrawnWorld,
    flight: Trajectory | None,
    arrivals: Arrivals,
    seconds: float,
    load: Callable[[Scene], Any] = blast_load,
) -> list[ImuRecord]:
    """Return the record of every inertial measurement unit on the vehicle.

    A record begins at 0 on the unit's clock and ends where the vehicle is lost.

    Args:
        world: The world.
        flight: Flight of its vehicle, up to its loss; None without one.
        arrivals: Times of arrivals at the vehicle.
        seconds: Duration of the world.
        load: Returns the load that a scene's blasts had on the flight.
    """
    spec = world.scene.vehicle
    if flight is None or spec is None:
        return []
    lasts = min(seconds, float(flight.time_s[-1]))
    comes = arrivals.times_s[AIR][arrivals.entities.index(VEHICLE)]
    records = []
    for sensor in world.scene.sensors:
        if sensor.kind != "imu" or not sensor.mount:
            continue
        imu = Imu() if sensor.imu is None else sensor.imu
        offset = float(sensor.clock_offset_s)
        # 1e-6 of a sample: the product of a duration and a rate may round below an
        # integer.
        count = max(0, int(np.floor((lasts + offset) * imu.rate + 1e-6)))
        edges = np.arange(count + 1) / imu.rate
        if not count:
            continue
        acting = load(with_nevers(world.scene))
        path = flight
        if isinstance(acting, Pulse):
            path = with_wave_rows(flight, acting, vehicle_of(spec), comes, 1 / imu.rate)
        common = jnp.asarray(edges - offset)
        # Evaluated at the edges of samples, because a sample is the mean over its
        # interval.
        true = inertial_of(path, common, sensor.offset_m, sensor.quaternion)
        # The key follows from the name, so other sensors do not change the noise.
        number = zlib.crc32(f"imu {sensor.name}".encode())
        key = jax.random.fold_in(world.noise_key, number)
        records.append(
            ImuRecord(sensor, imu, edges[:-1], with_errors(key, imu, true), path)
        )
    return records


AIR, PEAK = PICKED_QUANTITIES = ("air_arrival_s", "peak_overpressure_pa")
"""Quantities of a pick that are used."""


def picked_readings(
    world: DrawnWorld,
    arrivals: Arrivals,
    recordings: Mapping[str, Recording],
    seconds: float,
) -> tuple[list[Reading], int]:
    """Pick the records of the sensors of a world that have sampling options.

    Args:
        world: The world.
        arrivals: Times and places of arrivals.
        recordings: By sensor.
        seconds: Duration of the records.

    Returns:
        The readings, and the number of air shocks without a pick, or with a poor one.
    """
    records: list[PressureRecord] = []
    of: list[tuple[Sensor, int]] = []
    for sensor in sampled_sensors(world):
        own = arrivals.times_s[AIR][arrivals.entities.index(sensor.name)]
        comes = own + float(sensor.clock_offset_s)
        for shot in np.flatnonzero(comes < seconds).tolist():
            recording = recordings[sensor.name]
            records.append(_interval_record(recording, sensor, comes, shot))
            of.append((sensor, shot))
    rows: list[Reading] = []
    missed = 0
    for (sensor, shot), one in zip(of, pick_records(records), strict=True):
        kept = [q for q in kept_quantities(one)[0] if q in PICKED_QUANTITIES]
        missed += not kept
        name = world.scene.charges[shot].name
        place = arrivals.places_m[AIR][arrivals.entities.index(sensor.name), shot]
        for quantity in kept:
            bound = quantity == PEAK and one.pick.lower_bound
            value = _value(one, quantity)
            rows.append(Reading(sensor.name, quantity, *value, name, place, bound))
    return rows, missed


def sampled_sensors(world: DrawnWorld) -> tuple[Sensor, ...]:
    """Return the sensors whose readings are picked: those with sampling options."""
    return tuple(
        sensor
        for sensor in world.scene.sensors
        if sensor.instrument is not None
        and sensor.kind
        and SENSOR_KINDS[sensor.kind].is_picked
    )


def joined(one: Observations | None, other: Observations | None) -> Observations | None:
    """Return both logs concatenated."""
    logs = [log for log in (one, other) if log is not None]
    if len(logs) < 2:
        return logs[0] if logs else None
    comments = tuple(line for log in logs for line in log.comments)
    return Observations(**stacked(logs), comments=comments)


def _interval_record(
    recording: Recording, sensor: Sensor, comes_s: np.ndarray, shot: int
) -> PressureRecord:
    """Return the interval of a record about one blast."""
    first, last = interval_about(comes_s, shot)
    start, stop = (round(recording.rate_hz * t) for t in (max(first, 0.0), last))
    # The picker needs a minimum of samples, also at the end of a recording.
    stop = min(max(stop, start + LEAST_SAMPLES), recording.length)
    record = recording.record(0, min(start, stop - LEAST_SAMPLES), stop)
    instrument = sensor.instrument
    if instrument is None or instrument.high_pass is None:
        return record
    # A known high-pass filter lets the pick correct its droop of the positive phase.
    return replace(record, high_pass_hz=float(instrument.high_pass))


def _value(one: RecordPick, quantity: str) -> tuple[float, float]:
    """Return a quantity of a pick and its sigma, both for means over samples."""
    value, sigma = log_value(one, quantity)
    step = 1.0 / one.record.rate_hz
    unknown = step / math.sqrt(12.0)
    if quantity == AIR:
        return value + 0.5 * step, math.hypot(sigma, unknown)
    # Slope of Friedlander's pulse at its peak, relative to the peak: (1 + b) / t_d.
    fall = (1.0 + one.pick.decay) / one.pick.positive_duration_s
    return value, math.hypot(sigma, value * fall * unknown)
