r"""Pictures of an explosion from several sides, in place of the procedural fireball.

The picture shown is that of the view nearest by direction on the unit sphere about the
blast: the largest $d \cdot u$, $d$ towards the camera, $u$ towards the viewer. It is on
a billboard: a plane through the burst, across the line of sight. A ray from the camera
meets it at a point in metres, so that range, focal length, roll and distortion act on
it as on any point.

Each view has its own up, a fixed vector $v$ of the world that is up in its pictures.
The billboard's up is the part of $v - (d \cdot v)^3\,u$ across the line of sight. Near
the view it is $v$. As the camera climbs to where $v$ points, it turns away from the
view's side, because $v$ alone would turn with every step. A picture has to turn
somewhere, as no field of directions on a sphere is without such a point. It turns at
two points behind the view, 58 degrees from straight behind, towards $v$ and away from
it. A set should have other views there.

A charge other than the one in the pictures is shown as the fireball's law scales it:
lengths by the cube root of the mass, times by `fireball_duration`.

Limits of a flat picture: it hides, and is hidden, at the billboard's distance as a
whole. Where rays end at the ground, all of it below the ground is cut off: seen from
above, also the foot of a fireball, which is nearer than its middle. A picture made on
the ground already ends there and needs rays that do not. A camera nearer than the
fireball's radius is not inside it.

References:
    Parab's thesis (camera plugin), for the nearest view.
"""

import abc
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, UInt8

from jblast.scene.charge import Charge
from jblast.scene.scene import Scene
from jblast.sensors.camera.fireball import Appearance
from jblast.sensors.camera.geometry import Rays
from jblast.sensors.camera.image import (
    laid_over,
    premultiplied,
    resampled,
    srgb_to_linear,
)
from jblast.types import as_float_array
from jblast.waves.fireball import fireball_duration

GRAZING = 1e-4
"""Cosine between ray and line of sight below which a ray misses the billboard (89.994
degrees): nearly parallel rays would meet it arbitrarily far away."""


class ViewSet(eqx.Module):
    """Pictures of an explosion from several sides, in place of the smooth fireball.

    Attributes:
        glows: True if its fire is as bright as the law's and lights its surroundings.
    """

    glows: ClassVar[bool] = False

    @abc.abstractmethod
    def duration(self, charge: Charge) -> Float[Array, ""]:
        """Return the duration of the pictures of a charge [s]."""

    @abc.abstractmethod
    def instants(self, charge: Charge) -> Float[np.ndarray, " instant"]:
        """Return the times of a charge's frames, since the burst [s]."""

    @abc.abstractmethod
    def seen(
        self,
        scene: Scene,
        rays: Rays,
        time: Float[Array, ""],
        appearance: Appearance,
    ) -> Float[Array, "4 row column"]:
        """Return the image of a scene's charges along rays, nearer ones in front.

        Args:
            scene: Positions and times of the charges.
            rays: Camera rays, which end at the background.
            time: Time on the common clock [s].
            appearance: Exposure, for pictures without their own.

        Returns:
            Linear red, green and blue times alpha, and alpha.
        """

    @abc.abstractmethod
    def is_met(self, scene: Scene, charge: Charge, rays: Rays) -> Bool[Array, ""]:
        """Return True if a ray ever meets a charge's picture, hidden or not."""


class Views(ViewSet):
    """Pictures indexed by the direction from which they were taken.

    Attributes:
        frames: Red, green, blue and straight alpha of 8 bits.
        direction: Unit vector from the blast to the viewer: east, north, up.
        up: Unit vector that is up in each view's pictures, across its direction:
            `upright(direction)` for a level camera.
        metres_per_pixel: Scale of each view's pictures at the burst [m/px].
        anchor: (x, y) of the burst in each view's pictures [px].
        frames_hz: Frame k shows the blast k / frames_hz after the burst [1/s].
        charge_mass: TNT-equivalent mass of the charge that they show [kg].
        srgb: True if colours are sRGB, false for linear light.
    """

    frames: UInt8[Array, "view frame height width 4"]
    direction: Float[Array, "view 3"] = eqx.field(converter=as_float_array)
    up: Float[Array, "view 3"] = eqx.field(converter=as_float_array)
    metres_per_pixel: Float[Array, " view"] = eqx.field(converter=as_float_array)
    anchor: Float[Array, "view 2"] = eqx.field(converter=as_float_array)
    frames_hz: Float[Array, ""] = eqx.field(converter=as_float_array)
    charge_mass: Float[Array, ""] = eqx.field(converter=as_float_array)
    srgb: bool = eqx.field(static=True, default=True)

    def duration(self, charge: Charge) -> Float[Array, ""]:
        """Return the duration of the pictures of a charge [s]."""
        return self.frames.shape[1] / self.frames_hz * self.stretch(charge)

    def instants(self, charge: Charge) -> Float[np.ndarray, " instant"]:
        """Return the times of the frames and of the end of the last [s]."""
        pace = float(self.stretch(charge) / self.frames_hz)
        return pace * np.arange(self.frames.shape[1] + 2)

    def seen(
        self,
        scene: Scene,
        rays: Rays,
        time: Float[Array, ""],
        appearance: Appearance,
    ) -> Float[Array, "4 row column"]:
        """Return the image of the pictures along rays; their exposure is their own.

        Differentiable in the position of a charge, the camera and the size of the
        picture, except for a kink where a ray passes a pixel's centre, and a jump where
        the view changes or something hides it. Light is linear between two frames; it
        begins at the burst with the first, and fades out within a frame after the last.
        """
        del appearance
        return laid_over(
            [_picture_seen(self, charge, rays, time) for charge in scene.charges]
        )

    def is_met(self, scene: Scene, charge: Charge, rays: Rays) -> Bool[Array, ""]:
        """Return True if a ray meets the picture."""
        board = billboard(self, rays, charge)
        height, width = self.frames.shape[2:4]
        inside = (board.x > -1) & (board.x < width)
        inside &= (board.y > -1) & (board.y < height)
        return jnp.any(inside & jnp.isfinite(board.distance))

    def stretch(self, charge: Charge) -> Float[Array, ""]:
        """Return the duration of a charge's fireball over that of the pictures [-]."""
        mass = charge.tnt_mass("fireball_radius_m")
        return fireball_duration(mass) / fireball_duration(self.charge_mass)

    def size(self, charge: Charge) -> Float[Array, ""]:
        """Return the radius of a charge's fireball over that of the pictures [-]."""
        return jnp.cbrt(charge.tnt_mass("fireball_radius_m") / self.charge_mass)


def upright(direction: np.ndarray) -> np.ndarray:
    """Return the unit vector that is up in the picture of a level camera.

    From straight above or below that is north, as on a map.

    Args:
        direction: Unit vector from the blast to the viewer: east, north, up.
    """
    up = np.array([0.0, 0.0, 1.0])
    across = up - direction[2] * direction
    # below 1e-9 only rounding errors are left of the vertical
    length = float(np.linalg.norm(across))
    return across / length if length > 1e-9 else np.array([0.0, 1.0, 0.0])


class Billboard(eqx.Module):
    """Intersections of rays with a view's picture.

    Attributes:
        view: The nearest view.
        x: Column in the picture [px], also outside it; -2 for a ray that misses.
        y: Row, likewise.
        distance: Distance along each ray [m]; infinite for a ray that misses.
    """

    view: Int[Array, ""]
    x: Float[Array, "row column"]
    y: Float[Array, "row column"]
    distance: Float[Array, "row column"]


def nearest_view(views: Views, direction: Float[Array, "3"]) -> Int[Array, ""]:
    """Return the view nearest to a direction from the blast; the first of equals.

    Args:
        views: The pictures.
        direction: Vector from the blast: east, north, up, of any length.
    """
    return jnp.argmax(views.direction @ direction)


def billboard(views: Views, rays: Rays, charge: Charge) -> Billboard:
    """Return the intersections of rays with the picture of a charge.

    Args:
        views: The pictures.
        rays: Camera rays.
        charge: Position and size of the burst.
    """
    sight = jnp.stack(charge.position_m) - rays.origin
    apart = jnp.any(sight != 0.0)
    sight = jnp.where(apart, sight, 1.0)
    far = jnp.sqrt(jnp.sum(jnp.square(sight)))
    forward = sight / far
    view = nearest_view(views, -sight)
    axes = billboard_axes(forward, views.direction[view], views.up[view])
    right, down, ahead = jnp.tensordot(axes, rays.direction, 1)
    met = (ahead > GRAZING) & (rays.farthest > 0.0) & apart
    ahead = jnp.where(met, ahead, 1.0)
    distance = far / ahead
    pixel = views.metres_per_pixel[view] * views.size(charge)
    x, y = (
        jnp.where(met, anchor + part * distance / pixel, -2.0)
        for anchor, part in zip(views.anchor[view], (right, down), strict=True)
    )
    return Billboard(view, x, y, jnp.where(met, distance, jnp.inf))


def billboard_axes(
    forward: Float[Array, "3"], towards: Float[Array, "3"], up: Float[Array, "3"]
) -> Float[Array, "3 3"]:
    """Return right, down and forward of a billboard, as rows.

    Args:
        forward: Direction of the line of sight, from the camera.
        towards: Direction of the view, from the blast.
        up: Unit vector that is up in its pictures.
    """
    tilted_up = up - (-jnp.dot(forward, up)) ** 3 * towards
    right = jnp.cross(forward, tilted_up)
    square = jnp.sum(jnp.square(right))
    turned = square > 0.0  # otherwise a pole of the field: any right will do
    right = jnp.where(turned, right, jnp.cross(forward, up))
    right = right / jnp.sqrt(jnp.where(turned, square, 1.0))
    return jnp.stack([right, jnp.cross(forward, right), forward])


def _picture_seen(
    views: Views, charge: Charge, rays: Rays, time: Float[Array, ""]
) -> tuple[Float[Array, "4 row column"], Float[Array, ""]]:
    """Return the premultiplied light of one charge's picture, and squared distance."""
    burst = jnp.stack(charge.position_m)
    board = billboard(views, rays, charge)
    since = charge.since(time) / views.stretch(charge)
    layer = resampled(_picture(views, board.view, since), board.x, board.y)
    # hidden as a whole by anything nearer along the ray
    visible = board.distance < rays.farthest
    return (
        jnp.where(visible[None], layer, 0.0),
        jnp.sum(jnp.square(burst - rays.origin)),
    )


def _picture(
    views: Views, view: Int[Array, ""], since: Float[Array, ""]
) -> Float[Array, "height width 4"]:
    """Return a view's picture at a time since its own burst.

    Premultiplied linear light.
    """
    last = views.frames.shape[1] - 1
    position = since * views.frames_hz
    before = jnp.floor(position)
    # -1 and last + 1 are blank frames: nothing before the burst and after the end
    frame = jnp.clip(before, -1, last + 1).astype(int)

    def shown(frame):
        values = views.frames[view, jnp.clip(frame, 0, last)].astype(since.dtype)
        image = values / 255.0
        light = srgb_to_linear(image[..., :3]) if views.srgb else image[..., :3]
        light = premultiplied(jnp.concatenate([light, image[..., 3:]], axis=-1))
        return jnp.where((since >= 0.0) & (frame <= last), light, 0.0)

    part = position - before
    return (1.0 - part) * shown(frame) + part * shown(frame + 1)
