"""What the inertial measurement units on a world's vehicle write."""

import zlib
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jblast.scene import Imu, Sensor
from jblast.sensors.imu.errors import read
from jblast.sensors.imu.motion import Felt, felt
from jblast.vehicle import Trajectory
from jblast.world.drawn import DrawnWorld


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
