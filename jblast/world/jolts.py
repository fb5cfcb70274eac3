"""The jolts of a world's blasts, picked from what the vehicle's IMU wrote.

The truth says in which stretch a jolt is looked for, up to midway to the blasts before
and after, and nothing else. What the vehicle knows of itself is taken from its flight:
attitude and velocity where the stretch begins, and the speeds of its rotors.
"""

from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.constants import STANDARD_SOUND_SPEED
from jblast.observations import Observations, observed
from jblast.sensors.imu.motion import Felt, felt
from jblast.sensors.imu.pick import JoltPick, base_of, pick_jolt
from jblast.vehicle import State, vehicle_of
from jblast.vehicle.quadrotor.body import required_body
from jblast.world.arrivals import Arrivals, stretch_about
from jblast.world.drawn import DrawnWorld
from jblast.world.imus import ImuRecord

AIR = "air_arrival_s"
POOR_RAD = 0.5
"""A direction known no better is none."""


def picked_jolts(
    world: DrawnWorld, arrivals: Arrivals, records: Sequence[ImuRecord]
) -> tuple[Observations | None, int]:
    """Return the jolts of the units that say how they sample.

    Args:
        world: What is there.
        arrivals: When and where waves come to whom.
        records: What the units wrote.

    Returns:
        When, how much and whereto, as a log, None where there is none; and how many
        waves were not picked.
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
    # a vehicle's estimator knows what its gyroscope is off by, as well as it may be
    # told within the first of the samples
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
    # where in its sample, and in its row of the flight, a push begins nobody knows;
    # that of the front begins half a body before it comes to the middle
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
