"""Whether a camera ever sees anything of a blast, wherever in the image."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jblast.scene import Camera, Charge, Scene
from jblast.sensors.camera.geometry.pixel_rays import Rays, pixel_rays
from jblast.sensors.camera.geometry.projection import to_camera
from jblast.sensors.camera.rendering.fireball_image import cloud
from jblast.sensors.camera.rendering.view_set import ViewSet
from jblast.waves.fireball import fireball_duration

INSTANTS = 16
"""Of a fireball's life at which it is looked for."""


def in_view(
    scene: Scene, camera: Camera, views: ViewSet | None = None
) -> Bool[Array, ""]:
    """Return whether any ray of the image meets a fireball, at any time of its life.

    A fireball smaller than a pixel counts. What stands before it is not looked at.

    Args:
        scene: What explodes.
        camera: Who looks.
        views: Pictures shown in place of the procedural fireball.
    """
    return _in_view(scene, camera, views)


@eqx.filter_jit
def _in_view(scene: Scene, camera: Camera, views: ViewSet | None) -> Bool[Array, ""]:
    rays = pixel_rays(camera, ground=False)
    shown = [
        _meets(scene, charge, rays, 0.71 / jnp.min(camera.focal))  # to a pixel's corner
        if views is None
        else views.is_met(scene, charge, rays)
        for charge in scene.charges
    ]
    happens = [~charge.never for charge in scene.charges]
    return jnp.any(jnp.stack(shown) & jnp.stack(happens))


def off_axis(scene: Scene, camera: Camera) -> Float[Array, ""]:
    """Angle between the camera's axis and the first charge, 0 to pi [rad]."""
    charge = scene.charge
    right, down, ahead = to_camera(camera, jnp.stack(charge.position_m))
    return jnp.arctan2(jnp.hypot(right, down), ahead)


def _meets(
    scene: Scene, charge: Charge, rays: Rays, margin: Float[Array, ""]
) -> Bool[Array, ""]:
    """Return whether a ray meets the sphere, or passes it within an angle [rad]."""
    charge = charge.as_if_at_zero()
    life = fireball_duration(charge.tnt_mass("fireball_radius_m"))

    def at(part):
        ball = cloud(scene, charge, charge.time_s + part * life)
        offset = ball.centre - rays.origin
        along = jnp.tensordot(offset, rays.direction, 1)
        square = jnp.sum(jnp.square(offset))
        reach = ball.radius + margin * jnp.sqrt(square)
        met = (square - jnp.square(along) < jnp.square(reach)) & (along > -ball.radius)
        return jnp.any(met & (rays.farthest > 0.0))

    return jnp.any(jax.lax.map(at, jnp.linspace(1 / INSTANTS, 1.0, INSTANTS)))
