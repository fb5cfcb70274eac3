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
from collections.abc import Callable, Iterator, Mapping, Sequence
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
from jblast.vehicle.from_scene import wind_of
from jblast.vehicle.loads.load import Pulse
from jblast.vehicle.quadrotor import required_body
from jblast.world.drawn import VEHICLE, DrawnWorld, with_nevers
from jblast.world.perceived import Arrivals, interval_about

AIR, PEAK = "air_arrival_s", "peak_overpressure_pa"
"""Quantities of a pick of a pressure record that are used."""
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


def with_picked(
    log: Observations | None, rows: Sequence[Reading]
) -> Observations | None:
    """Return a log with picked readings appended; None without any."""
    if not rows:
        return log
    names, quantities, values, sigmas, shots, places, bounds = zip(*rows, strict=True)
    picked = observed(
        names,
        quantities,
        values,
        sigmas,
        shot=shots,
        position=np.stack(places),
        lower_bound=np.array(bounds),
        comments=("picked: readings of sensors with samples",),
    )
    if log is None:
        return picked
    both = stacked([log, picked])
    return Observations(**both, comments=(*log.comments, *picked.comments))


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
    spec, missed = world.scene.vehicle, 0
    if spec is None:
        return rows, missed
    load, vehicle = blast_load(with_nevers(world.scene)), vehicle_of(spec)
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
            state = _state_at(record.flight, comes[shot])
            number, yaw = jnp.asarray(shot), jnp.asarray(spec.yaw)
            jolts = _law_jolts(load, number, state, vehicle, yaw)
            onset_s = float(record.stamps_s[first + pick.onset])
            found = _values(record, pick, onset_s, vehicle, *np.asarray(jolts))
            name = world.scene.charges[shot].name
            place = arrivals.places_m[AIR][row, shot]
            rows += [
                Reading(record.sensor.name, what, x, sd, name, place, bound)
                for what, x, sd, bound in found
            ]
    return rows, missed


def _state_at(flight: Trajectory, time_s: float) -> State:
    """Return the state of a flight at a time."""
    states = states_at(flight, jnp.asarray([time_s]))
    return jax.tree.map(lambda column: column[0], states)


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
        _state_at(flight, float(common[some[0]])),
        states_at(flight, middle).rotor_speed_rad_s,
        record.sensor.offset_m,
        record.sensor.quaternion,
        wind_m_s=wind_of(world.scene),
    )
    return pick, int(some[0])


@eqx.filter_jit
def _law_jolts(
    load: BlastLoad,
    shot: Int[Array, ""],
    state: State,
    vehicle: Vehicle,
    yaw: Float[Array, ""],
) -> Float[Array, "2 3"]:
    """Return the changes of velocity by the front of one blast [m/s].

    They are those of the law of flights: if the vehicle hovers, as the law of jolts
    supposes, and with its velocity, attitude and rotor speeds.
    """
    waves = jax.tree.map(lambda x: x[shot][None], load.waves)
    load = replace(load, waves=waves, charges=1)
    (begins_s,), (ends_s,) = load.span_s(state.position_m, vehicle)
    hovers = hover_in_wind(vehicle, state.position_m, yaw, load.wind_m_s)
    gained = (load.impulse(begins_s, ends_s, x, vehicle)[0] for x in (hovers, state))
    return jnp.stack([*gained]) / vehicle.mass_kg


def _values(
    record: ImuRecord,
    pick: JoltPick,
    onset_s: float,
    vehicle: Vehicle,
    hovering_m_s: Float[np.ndarray, "3"],
    flying_m_s: Float[np.ndarray, "3"],
) -> Iterator[tuple[str, float, float, bool]]:
    """Yield quantity, value, sigma and a flag for lower bounds of a jolt.

    Args:
        record: Record of the unit.
        pick: Its jolt.
        onset_s: Time of the jolt's first sample, by the unit's clock [s].
        vehicle: The vehicle.
        hovering_m_s: Its jolt by the law if it hovers.
        flying_m_s: The same with its motion.
    """
    step_s = 1 / record.imu.rate
    area = float(jnp.mean(required_body(vehicle.body).area_m2))
    crossing_s = math.sqrt(4 / math.pi * area) / STANDARD_SOUND_SPEED
    # The start of a force within its sample is unknown: a uniform error of variance
    # step^2 / 12. The force begins when the front reaches the body, half the crossing
    # time of a weak front before it reaches the centre.
    yield AIR, onset_s + 0.5 * (step_s + crossing_s), step_s / math.sqrt(12.0), False
    # The vehicle's motion is an error of the law of jolts.
    error, size = math.dist(flying_m_s, hovering_m_s), math.hypot(*hovering_m_s)
    speed, sd = pick.speed_m_s
    yield "jolt_velocity_m_s", speed, math.hypot(sd, error), pick.clipped
    # A clipped axis biases the direction, whereas the size remains a lower bound.
    if pick.clipped or not size:
        return
    turns = (
        ("jolt_bearing_rad", pick.bearing_rad),
        ("jolt_elevation_rad", pick.elevation_rad),
    )
    for quantity, (value, sd) in turns:
        sigma = math.hypot(sd, error / size)
        if sigma < MAX_DIRECTION_ERROR_RAD:
            yield quantity, value, sigma, False


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
    of: list[tuple[str, int]] = []
    for sensor in sampled_sensors(world):
        row = arrivals.entities.index(sensor.name)
        comes = arrivals.times_s[AIR][row] + float(sensor.clock_offset_s)
        for shot in np.flatnonzero(comes < seconds).tolist():
            recording = recordings[sensor.name]
            records.append(_interval_record(recording, sensor, comes, shot))
            of.append((sensor.name, shot))
    rows: list[Reading] = []
    missed = 0
    for (sensor, shot), one in zip(of, pick_records(records), strict=True):
        kept = [q for q in kept_quantities(one)[0] if q in (AIR, PEAK)]
        missed += not kept
        name = world.scene.charges[shot].name
        place = arrivals.places_m[AIR][arrivals.entities.index(sensor), shot]
        for quantity in kept:
            bound = quantity == PEAK and one.pick.lower_bound
            value = _value(one, quantity)
            rows.append(Reading(sensor, quantity, *value, name, place, bound))
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
