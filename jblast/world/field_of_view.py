"""Which blasts stand in the picture of a world's camera as they go off."""

from dataclasses import replace

import jax.numpy as jnp

from jblast.scene import Scene
from jblast.sensors.camera.geometry.camera_path import CameraPath, carried_camera
from jblast.sensors.camera.rendering.visibility import in_view
from jblast.vehicle import Trajectory


def out_of_view(scene: Scene, flight: Trajectory | None = None) -> tuple[str, ...]:
    """Return the blasts of which no ray of the camera ever meets the fireball.

    A camera that flies is taken where it is, and turned as it is, when a blast goes
    off. Without a camera there is nothing out of its view.

    Args:
        scene: What explodes, and the camera.
        flight: Of the vehicle; None: a camera on it looks level from where it holds.
    """
    camera = scene.camera
    if camera is None:
        return ()
    bare = replace(scene, sensors=(), clocks=(), ambient=None)
    path = _path(scene, flight) if camera.mount else None
    unseen = []
    for charge in scene.charges:
        if charge.never:
            continue
        here = camera
        if path is not None:
            here = carried_camera(camera, path, jnp.asarray(charge.time_s))
        alone = replace(bare, charge=replace(charge, name=""), others=(), camera=None)
        if not in_view(alone, here):
            unseen.append(charge.name)
    return tuple(unseen)


def _path(scene: Scene, flight: Trajectory | None) -> CameraPath:
    """Return where the vehicle is; of one that was lost, up to there."""
    if flight is None:
        held = jnp.zeros(3) if scene.vehicle is None else scene.vehicle.held
        level = jnp.array([0.0, 0.0, 0.0, 1.0])
        return CameraPath(
            jnp.array([0.0, 1.0]), jnp.stack([held, held]), jnp.stack([level, level])
        )
    known = jnp.isfinite(flight.position_m).all(axis=-1)
    rows = (flight.time_s, flight.position_m, flight.quaternion)
    return CameraPath(*(row[known] for row in rows))
