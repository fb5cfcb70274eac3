"""Records of the inertial units on a world's vehicle, and the jolts picked from them.

The true times set the search interval of each jolt, up to midway to the blasts before
and after it, and nothing else. The initial attitude and velocity of an interval and the
rotor speeds are those of the flight.
"""

import zlib
from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.constants import STANDARD_SOUND_SPEED
from jblast.observations import Observations, observed
from jblast.scene import Imu, Sensor
from jblast.sensors.imu import Felt, JoltPick, base_of, felt, pick_jolt, read
from jblast.vehicle import State, Trajectory, vehicle_of
from jblast.vehicle.quadrotor import required_body
from jblast.world.drawn import DrawnWorld
from jblast.world.perceived import Arrivals, stretch_about

AIR = "air_arrival_s"
POOR_RAD = 0.5
"""A direction known no better is none."""


class ImuRecord(NamedTuple):
    """What one unit wrote.

    Attributes:
        sensor: Which.
        imu: What it is.
        stamps_s: When each sample begins, by its own clock.
        samples: The samples.
        flight: Of the vehicle, up to where it was lost.
    """

    sensor: Sensor
    imu: Imu
    stamps_s: Float[np.ndarray, " sample"]
    samples: Felt
    flight: Trajectory

    @property
    def common_s(self) -> Float[np.ndarray, " sample"]:
        """When each sample begins, on the common clock."""
        return self.stamps_s - float(self.sensor.clock_offset_s)

    @property
    def clipped(self) -> bool:
        """Whether a sample stands at the end of its range."""
        step = 2.0 ** (1 - (self.imu.bits or 53))
        return any(
            bool(jnp.any(jnp.abs(column) >= full_scale * (1 - step) * (1 - 1e-6)))
            for column, full_scale in (
                (self.samples.force, self.imu.accelerometer_range),
                (self.samples.rate, self.imu.gyroscope_range),
            )
        )

    @property
    def row_s(self) -> float:
        """How far the rows of the flight are apart: between them it is straight."""
        times = self.flight.time_s
        return float(times[1] - times[0]) if times.size > 1 else np.inf


def picked_jolts(
    world: DrawnWorld, arrivals: Arrivals, records: Sequence[ImuRecord]
) -> tuple[Observations | None, int]:
    """Return the jolts of the units with a specified sampling.

    Args:
        world: What is there.
        arrivals: When and where waves come to whom.
        records: What the units wrote.

    Returns:
        Times, sizes and directions as a log, None where there is none; and the number
        of waves that were not picked.
    """
    rows: list[tuple[str, str, float, float, str, bool]] = []
    places: list[Float[np.ndarray, 3]] = []
    missed, crossing_s = 0, _crossing_s(world)
    for record in records:
        sensor = record.sensor
        if sensor.imu is None:
            continue
        row = arrivals.entities.index(sensor.name)
        comes = arrivals.times_s[AIR][row]
        ends = record.common_s[-1] + 1 / record.imu.rate
        for shot in np.flatnonzero(comes < ends).tolist():
            pick, first = _pick(world, record, comes, shot)
            if pick is None or not pick.found:
                missed += 1
                continue
            place = arrivals.places_m[AIR][row, shot]
            name = world.scene.charges[shot].name
            readings = _readings(record, pick, first, crossing_s)
            rows += [(sensor.name, *one[:3], name, one[3]) for one in readings]
            places += [place] * len(readings)
    if not rows:
        return None, missed
    names, quantities, values, sigmas, shots, bounds = zip(*rows, strict=True)
    log = observed(
        names,
        quantities,
        values,
        sigmas,
        position=np.stack(places),
        shot=shots,
        lower_bound=np.array(bounds),
        comments=("jolts of an imu that says how it samples are picked",),
    )
    return log, missed


def _pick(
    world: DrawnWorld, record: ImuRecord, comes_s: np.ndarray, shot: int
) -> tuple[JoltPick | None, int]:
    """Return the jolt of one blast, and the first sample that it was looked for in."""
    spec = world.scene.vehicle
    if spec is None:
        return None, 0
    start, stop = stretch_about(comes_s, shot)
    common = record.common_s
    some = np.flatnonzero((common >= start) & (common < stop))
    if not some.size:
        return None, 0
    part, flight = slice(some[0], some[-1] + 1), record.flight
    middle = jnp.asarray(common[part] + 0.5 / record.imu.rate)
    begin = jnp.asarray(common[part][:1])
    motion = State(
        *(
            _at(begin, flight.time_s, column)[0]
            for column in (
                flight.position_m,
                flight.velocity_m_s,
                flight.quaternion,
                flight.body_rate_rad_s,
                flight.rotor_speed_rad_s,
            )
        )
    )
    air = world.scene.air
    # the bias of the gyroscope is estimated by the vehicle's estimator; here, by the
    # mean difference from the truth over the first samples
    rates = record.samples.rate[part]
    base = base_of(len(rates))
    edges = jnp.asarray(common[some[0]] + np.arange(base + 1) / record.imu.rate)
    true = felt(flight, edges, record.sensor.offset_m, record.sensor.quaternion)
    off = jnp.mean(rates[:base] - true.rate[: len(rates)], axis=0)
    pick = pick_jolt(
        Felt(record.samples.force[part], rates - off[None]),
        record.imu,
        vehicle_of(spec),
        motion,
        _at(middle, flight.time_s, flight.rotor_speed_rad_s),
        record.sensor.offset_m,
        record.sensor.quaternion,
        wind_m_s=jnp.stack([air.wind_east, air.wind_north, 0 * air.wind_east]),
    )
    return pick, int(some[0])


def _crossing_s(world: DrawnWorld) -> float:
    """Return how long a weak front takes across the scene's vehicle."""
    spec = world.scene.vehicle
    if spec is None:
        return 0.0
    area = float(jnp.mean(required_body(vehicle_of(spec).body).area_m2))
    return float(np.sqrt(4 / np.pi * area)) / STANDARD_SOUND_SPEED


def _readings(
    record: ImuRecord, pick: JoltPick, first: int, crossing_s: float
) -> list[tuple[str, float, float, bool]]:
    """Return quantity, value, sigma and whether it is a lower bound."""
    step, row = 1 / record.imu.rate, record.row_s
    onset = float(record.stamps_s[first + pick.onset])
    # the start of a push within its sample and within its row of the flight is unknown;
    # the push of the front begins half a body before the front reaches the middle
    readings = [
        (
            AIR,
            onset + 0.5 * (step + row + crossing_s),
            float(np.hypot(step, row) / np.sqrt(12.0)),
            False,
        ),
        ("jolt_velocity_m_s", *pick.speed_m_s, pick.clipped),
    ]
    if not pick.clipped:
        readings += [
            (quantity, *value, False)
            for quantity, value in (
                ("jolt_bearing_rad", pick.bearing_rad),
                ("jolt_elevation_rad", pick.elevation_rad),
            )
            if value[1] < POOR_RAD
        ]
    return readings


def _at(
    when: Float[Array, " time"],
    times: Float[Array, " row"],
    rows: Float[Array, "row axis"],
) -> Float[Array, "time axis"]:
    return jax.vmap(jnp.interp, (None, None, 1), 1)(when, times, rows)


def imu_records(
    world: DrawnWorld, flight: Trajectory | None, seconds: float
) -> list[ImuRecord]:
    """Return what every inertial measurement unit on the vehicle writes.

    A record begins at 0 on its own clock; it ends where the vehicle is lost.

    Args:
        world: What is there.
        flight: Of its vehicle; None where nothing flew.
        seconds: When the world ends.
    """
    if flight is None:
        return []
    known = np.isfinite(np.asarray(flight.position_m)).all(axis=-1)
    whole = bool(np.all(known))
    flight = flight if whole else _first(flight, int(np.argmin(known)))
    records = []
    for sensor in world.scene.sensors:
        if sensor.kind != "imu" or not sensor.mount:
            continue
        imu = Imu() if sensor.imu is None else sensor.imu
        offset = float(sensor.clock_offset_s)
        lasts = seconds if whole else min(seconds, float(flight.time_s[-1]))
        count = max(0, int(np.floor((lasts + offset) * imu.rate + 1e-6)))
        edges = np.arange(count + 1) / imu.rate
        if not count:
            continue
        common = jnp.asarray(edges - offset)
        true = felt(flight, common, sensor.offset_m, sensor.quaternion)
        # by its name: another sensor in the scene changes nothing of it
        number = zlib.crc32(f"imu {sensor.name}".encode())
        key = jax.random.fold_in(world.noise_key, number)
        records.append(ImuRecord(sensor, imu, edges[:-1], read(key, imu, true), flight))
    return records


def _first(flight: Trajectory, rows: int) -> Trajectory:
    """Return the first rows of a flight."""
    lost = flight.lost
    columns = {
        name: getattr(flight, name)[:rows]
        for name in flight.__dataclass_fields__
        if name != "lost"
    }
    return Trajectory(**columns, lost=lost)
