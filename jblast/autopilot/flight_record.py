"""Record of a flight for telemetry, and the axes of autopilots."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from jblast.missions.mission import geodetic
from jblast.observations.places import Frame


@dataclass(frozen=True)
class FlightRecord:
    """A flight.

    Attributes:
        time_s: Times of the rows, from 0 on.
        position_m: East, north, up.
        velocity_m_s: East, north, up.
        quaternion: Body to world (x, y, z, w).
        body_rate_rad_s: About the body's axes: forward, left, up.
        controls: Rotor speeds as shares of the maximum speed.
        armed: True where the vehicle is armed.
        item: Number of the current mission item; 0 without a mission.
        frame: Geodetic frame of the origin.
        set_point_m: Position set point; None: unknown.
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

    def geodetic(
        self, position_m: Float[np.ndarray, "*place 3"]
    ) -> Float[np.ndarray, "*place 3"]:
        """Return latitude, longitude [degree] and height [m] of positions."""
        return geodetic(self.frame, position_m)


def down(vectors: Float[np.ndarray, "*row 3"]) -> Float[np.ndarray, "*row 3"]:
    """Return north, east, down of east, north, up."""
    return np.stack([vectors[..., 1], vectors[..., 0], -vectors[..., 2]], axis=-1)


def right(vectors: Float[np.ndarray, "*row 3"]) -> Float[np.ndarray, "*row 3"]:
    """Return forward, right, down of forward, left, up."""
    return vectors * np.array([1.0, -1.0, -1.0])


def scalar_first(
    quaternion: Float[np.ndarray, "*row 4"],
) -> Float[np.ndarray, "*row 4"]:
    """Return attitudes (x, y, z, w) as an autopilot's (w, x, y, z), w >= 0.

    The product of half a turn about (1, 1, 0) (world axes), the attitude, and half a
    turn about x (body axes).
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
