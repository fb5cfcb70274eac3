"""The rows of a flight, as logs and ground stations are told of it."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from jblast.missions.frame import geodetic
from jblast.observations.places.frame import Frame


@dataclass(frozen=True)
class Estimate:
    """What a vehicle took for its own state, at each row.

    Attributes:
        position_m: East, north, up.
        velocity_m_s: East, north, up.
        quaternion: Body to world (x, y, z, w).
    """

    position_m: Float[np.ndarray, "time 3"]
    velocity_m_s: Float[np.ndarray, "time 3"]
    quaternion: Float[np.ndarray, "time 4"]


@dataclass(frozen=True)
class FlightRecord:
    """A flight.

    Attributes:
        time_s: Of its rows, from 0 on.
        position_m: East, north, up.
        velocity_m_s: East, north, up.
        quaternion: Body to world (x, y, z, w).
        body_rate_rad_s: About the body's axes: ahead, left, up.
        controls: Of the rotors: shares of their greatest speed, as they turn.
        armed: Whether it was.
        item: Number of the mission's item that it was on the way to; 0 without one.
        frame: Where the origin lies.
        set_point_m: Where it should have been; None: not known.
        estimate: What it took for its state; None: the truth.
    """

    time_s: Float[np.ndarray, " time"]
    position_m: Float[np.ndarray, "time 3"]
    velocity_m_s: Float[np.ndarray, "time 3"]
    quaternion: Float[np.ndarray, "time 4"]
    body_rate_rad_s: Float[np.ndarray, "time 3"]
    controls: Float[np.ndarray, "time 4"]
    armed: Bool[np.ndarray, " time"]
    item: Int[np.ndarray, " time"]
    frame: Frame
    set_point_m: Float[np.ndarray, "time 3"] | None = None
    estimate: Estimate | None = None

    @property
    def believed(self) -> Estimate:
        """What it took for its state, the truth where nothing was estimated."""
        return self.estimate or Estimate(
            self.position_m, self.velocity_m_s, self.quaternion
        )

    def geodetic(
        self, position_m: Float[np.ndarray, "*place 3"]
    ) -> Float[np.ndarray, "*place 3"]:
        """Return latitude, longitude [degree] and height [m] of places."""
        return geodetic(self.frame, position_m)

    def rows_each(self, step_s: float) -> Int[np.ndarray, " row"]:
        """Return the rows that come next after even times, the first and last too."""
        times = np.arange(0.0, self.time_s[-1], step_s)
        rows = np.searchsorted(self.time_s, times - 1e-9)
        return np.unique(np.append(rows, self.time_s.size - 1))


def down(vectors: Float[np.ndarray, "*row 3"]) -> Float[np.ndarray, "*row 3"]:
    """Return north, east, down of east, north, up."""
    return np.stack([vectors[..., 1], vectors[..., 0], -vectors[..., 2]], axis=-1)


def right(vectors: Float[np.ndarray, "*row 3"]) -> Float[np.ndarray, "*row 3"]:
    """Return ahead, right, down of ahead, left, up."""
    return vectors * np.array([1.0, -1.0, -1.0])


def scalar_first(
    quaternion: Float[np.ndarray, "*row 4"],
) -> Float[np.ndarray, "*row 4"]:
    """Return attitudes (x, y, z, w) as an autopilot's (w, x, y, z), w >= 0.

    Half a turn about the middle of north and east before, half a one about ahead after.
    """
    x, y, z, w = np.moveaxis(quaternion, -1, 0)
    whole = np.stack([-w - z, -x - y, y - x, z - w], axis=-1) * np.sqrt(0.5)
    return np.where(whole[..., :1] < 0, -whole, whole)


def euler(attitude: Float[np.ndarray, "*row 4"]) -> Float[np.ndarray, "*row 3"]:
    """Return roll, pitch and yaw of an autopilot's attitude (w, x, y, z) [rad]."""
    w, x, y, z = np.moveaxis(attitude, -1, 0)
    return np.stack(
        [
            np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)),
            np.arcsin(np.clip(2 * (w * y - z * x), -1.0, 1.0)),
            np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)),
        ],
        axis=-1,
    )
