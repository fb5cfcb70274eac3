"""Where what rides on a vehicle is while that hovers at the place that it holds."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.scene import Scene, VehicleSpec


def hovering(scene: Scene) -> Scene:
    """Return a scene whose riding sensors stand where its vehicle holds, level.

    Of a wind, against which a vehicle tilts, nothing is counted: it moves what rides
    by a part of its offset.

    Args:
        scene: Its sensors with a mount have no place; without a vehicle it stays.
    """
    if scene.vehicle is None:
        return scene
    vehicle = scene.vehicle
    sensors = tuple(
        replace(one, position_m=place_on(vehicle, one.offset_m))
        if one.mount and not np.isfinite(np.asarray(one.position_m)).all()
        else one
        for one in scene.sensors
    )
    return replace(scene, sensors=sensors)


def place_on(vehicle: VehicleSpec, offset_m: Float[Array, "3"]) -> Float[Array, "3"]:
    """Return where a point of a level vehicle is at the place it holds.

    Args:
        vehicle: Its yaw is from east to north.
        offset_m: Forward, left, up [m].
    """
    forward, left, up = jnp.asarray(offset_m, float)
    cos, sin = jnp.cos(vehicle.yaw), jnp.sin(vehicle.yaw)
    turned = [cos * forward - sin * left, sin * forward + cos * left, up]
    return vehicle.held + jnp.stack(turned)
