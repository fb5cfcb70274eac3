"""Where what rides on a vehicle is over time."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.scene import Scene, quaternion_matrix
from jblast.sensors import Track
from jblast.vehicle import Trajectory
from jblast.world.drawn import CAMERA, VEHICLE


def tracks_of(scene: Scene, flight: Trajectory) -> dict[str, Track]:
    """Return where the vehicle, the sensors and the camera on it are, by name.

    Straight between the rows of the flight; of a vehicle that was lost, up to there.
    No sensor is below the ground.

    Args:
        scene: Has the sensors.
        flight: Of the scene's vehicle.
    """
    known = np.isfinite(np.asarray(flight.position_m)).all(axis=-1)
    time = jnp.asarray(flight.time_s)[known]
    place, turn = flight.position_m[known], flight.quaternion[known]
    found = {VEHICLE: Track(time, place)}
    for sensor in scene.sensors:
        if sensor.mount:
            rides = place + _turned(turn, sensor.offset_m)
            # of a vehicle that lies on its back, what was above it is on the ground
            found[sensor.name] = Track(time, rides.at[:, 2].max(0.0))
    if scene.camera is not None and scene.camera.mount:
        found[CAMERA] = Track(time, place + _turned(turn, scene.camera.position))
    return found


@jax.jit
def _turned(
    turn: Float[Array, "row 4"], offset_m: Float[Array, "3"]
) -> Float[Array, "row 3"]:
    """Return an offset in the axes of a body, in those of the world."""
    return jax.vmap(lambda one: quaternion_matrix(one) @ offset_m)(turn)
