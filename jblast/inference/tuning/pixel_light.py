"""Light of single pixels at single instants, for the prediction of events."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float

from jblast.scene import Camera, Scene
from jblast.sensors.camera.fireball import Appearance, fireballs_seen
from jblast.sensors.camera.geometry import Rays, Surfaces, pixel_rays, surfaces_seen
from jblast.sensors.camera.image import BACKGROUND, luminance
from jblast.sensors.camera.pixel import log_intensity
from jblast.sensors.camera.rendering import check_stands
from jblast.sensors.camera.surroundings import flash
from jblast.types import as_float_array


class PixelLight(eqx.Module):
    """Logarithm of the grey light of single pixels at single instants.

    Attributes:
        scene: Charges and air.
        rays: One ray per pixel.
        background: Light behind the fireballs, without theirs, full scale 1.
        appearance: Exposure, and distribution of the smoke.
        lit: Surfaces of the background that fireballs light; None if they light none.
    """

    scene: Scene
    rays: Rays
    background: Float[Array, "height width 3"]
    appearance: Appearance
    lit: Surfaces | None

    def __call__(
        self, time: Float[Array, " at"], x: Float[Array, " at"], y: Float[Array, " at"]
    ) -> Float[Array, " at"]:
        """Return the logarithm of light at times, columns and rows."""
        at = y.astype(int), x.astype(int)

        def seen(time, direction, farthest, end):
            rays = Rays(
                self.rays.origin, direction[:, None, None], farthest[None, None]
            )
            light = fireballs_seen(self.scene, rays, time, self.appearance)
            if end is None:
                return light[:, 0, 0], jnp.zeros((3,), light.dtype)
            there = Surfaces(*(part[..., None, None] for part in end))
            gained = flash(self.scene, there, time, self.appearance)
            return light[:, 0, 0], gained[:, 0, 0]

        ends, axes = None, None
        if self.lit is not None:
            ends = [part[..., *at] for part in jax.tree.leaves(self.lit)]
            axes = [1, 1, 0]
        lanes = self.rays.direction[:, *at], self.rays.farthest[at], ends
        colour, gained = jax.vmap(seen, (0, 1, 0, axes))(time, *lanes)
        behind = luminance(self.background[at] * (1.0 + gained))
        return log_intensity(luminance(colour[:, :3]) + (1.0 - colour[:, 3]) * behind)


def pixel_light(
    scene: Scene,
    camera: Camera,
    *,
    background: Float[ArrayLike, "..."] = BACKGROUND,
    appearance: Appearance | None = None,
) -> PixelLight:
    """Return the light of a scene for a camera at rest; arguments as of `render`."""
    check_stands(camera)
    appearance = Appearance() if appearance is None else appearance
    rays, behind = pixel_rays(camera), as_float_array(background)
    light = PixelLight(
        scene,
        rays,
        jnp.broadcast_to(behind, (camera.height, camera.width, 3)),
        appearance,
        surfaces_seen(rays, image=False) if appearance.flash else None,
    )
    # as arrays without weak types: Python's numbers would compile programs of their own
    return jax.tree.map(
        lambda v: jax.lax.convert_element_type(v, v.dtype) if v.dtype != bool else v,
        light,
    )
