r"""Pictures of an explosion from several sides, in place of the procedural fireball.

The picture shown is that of the view nearest by direction on the unit sphere about the
blast: the largest $d \cdot u$, $d$ towards the camera, $u$ towards the viewer. It
stands on a billboard: a plane through the burst, across the line of sight. A ray from
the camera meets it at a point in metres, so that range, focal length, roll and
distortion act on it as on any point.

Each view keeps its own up, a fixed vector $v$ of the world that is up in its pictures.
The billboard's up is the part of $v - (d \cdot v)^3\,u$ across the line of sight: $v$
near the view; and away from the view's side as the camera climbs to where $v$ points,
where $v$ alone would turn with every step. A picture has to turn somewhere, as no field
of directions on a sphere is without such a point. It turns at two points behind the
view, 58 degrees from straight behind, towards $v$ and away from it. A set should have
other views there.

Another charge than the one in the pictures is shown as the fireball's law scales it:
lengths by the cube root of the mass, times by `fireball_duration`.

Limits of a flat picture: it hides, and is hidden, at the billboard's distance as a
whole. Where rays end at the ground, all of it that is below is cut off: seen from
above, also the foot of a fireball, which is nearer than its middle. A picture that was
made on the ground is cut by it already and needs rays that do not end there. A camera
nearer than the fireball's radius is not inside it.

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
"""Cosine between a ray and the line of sight below which the billboard is not seen."""


class ViewSet(eqx.Module):
    """Pictures of an explosion from several sides, in place of the smooth fireball.

    Attributes:
        glows: Whether its fire is as bright as the law's, and lights what is around.
    """

    glows: ClassVar[bool] = False

    @abc.abstractmethod
    def duration(self, charge: Charge) -> Float[Array, ""]:
        """Return how long the pictures of a charge last [s]."""

    @abc.abstractmethod
    def instants(self, charge: Charge) -> Float[np.ndarray, " instant"]:
        """Return when a charge's pictures change their course, since the burst [s]."""

    @abc.abstractmethod
    def seen(
        self,
        scene: Scene,
        rays: Rays,
        time: Float[Array, ""],
        appearance: Appearance,
    ) -> Float[Array, "4 row column"]:
        """Return what rays see of a scene's charges, nearer ones in front.

        Args:
            scene: Where and when the charges go off.
            rays: Where to look, and where the background is.
            time: Time on the common clock [s].
            appearance: How the fire is exposed, where the pictures leave that open.

        Returns:
            Linear red, green and blue times alpha, and alpha.
        """

    @abc.abstractmethod
    def is_met(self, scene: Scene, charge: Charge, rays: Rays) -> Bool[Array, ""]:
        """Return whether a ray ever meets a charge's picture, hidden or not."""


class Views(ViewSet):
    """A set of pictures indexed by the direction they were taken from.

    Attributes:
        frames: Red, green, blue and straight alpha of 8 bits.
        direction: Unit vector from the blast to the viewer: east, north, up.
        up: Unit vector that is up in each view's pictures, across its direction:
            `upright(direction)` of a camera held level.
        metres_per_pixel: Of each view's pictures, at the burst [m/px].
        anchor: (x, y) of the burst in each view's pictures [px].
        frames_hz: Frame k shows the blast k / frames_hz after the burst [1/s].
        charge_mass: TNT-equivalent mass of the charge they show [kg].
        srgb: Whether colours are sRGB, or linear light.
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
        """Return how long the pictures of a charge last [s]."""
        return self.frames.shape[1] / self.frames_hz * self.stretch(charge)

    def instants(self, charge: Charge) -> Float[np.ndarray, " instant"]:
        """Return when frames stand, and when the last has faded [s]."""
        pace = float(self.stretch(charge) / self.frames_hz)
        return pace * np.arange(self.frames.shape[1] + 2)

    def seen(
        self,
        scene: Scene,
        rays: Rays,
        time: Float[Array, ""],
        appearance: Appearance,
    ) -> Float[Array, "4 row column"]:
        """Return what rays see of the pictures; their exposure is their own.

        Differentiable in the place of a charge, the camera and the size of the picture,
        but for a kink where a ray passes a pixel's centre, and a jump where the view
        changes or something hides it. In time it is linear between two frames; it
        begins at the burst with the first, and fades out within a frame after the last.
        """
        del appearance
        return laid_over([_seen(self, charge, rays, time) for charge in scene.charges])

    def is_met(self, scene: Scene, charge: Charge, rays: Rays) -> Bool[Array, ""]:
        """Return whether a ray meets the picture."""
        board = billboard(self, rays, charge)
        height, width = self.frames.shape[2:4]
        inside = (board.x > -1) & (board.x < width)
        inside &= (board.y > -1) & (board.y < height)
        return jnp.any(inside & jnp.isfinite(board.distance))

    def stretch(self, charge: Charge) -> Float[Array, ""]:
        """Return a charge's fireball's duration over that of the pictures [-]."""
        mass = charge.tnt_mass("fireball_radius_m")
        return fireball_duration(mass) / fireball_duration(self.charge_mass)

    def size(self, charge: Charge) -> Float[Array, ""]:
        """Return a charge's fireball's radius over that of the pictures [-]."""
        return jnp.cbrt(charge.tnt_mass("fireball_radius_m") / self.charge_mass)


def upright(direction: np.ndarray) -> np.ndarray:
    """Return what is up in the picture of a level camera: a unit vector.

    From straight above or below that is north, as on a map.

    Args:
        direction: Unit vector from the blast to the viewer: east, north, up.
    """
    up = np.array([0.0, 0.0, 1.0])
    across = up - direction[2] * direction
    length = float(np.linalg.norm(across))
    return across / length if length > 1e-9 else np.array([0.0, 1.0, 0.0])


class Billboard(eqx.Module):
    """Intersections of rays with a view's picture.

    Attributes:
        view: The nearest one.
        x: Column in the picture [px]; inside it or not, -2 where it is not met.
        y: Row, likewise.
        distance: Along each ray [m]; infinite where the picture is not met.
    """

    view: Int[Array, ""]
    x: Float[Array, "row column"]
    y: Float[Array, "row column"]
    distance: Float[Array, "row column"]


def nearest_view(views: Views, direction: Float[Array, "3"]) -> Int[Array, ""]:
    """Return which view is nearest to a direction from the blast; the first of equals.

    Args:
        views: Where each was taken from.
        direction: From the blast: east, north, up; its length does not matter.
    """
    return jnp.argmax(views.direction @ direction)


def billboard(views: Views, rays: Rays, charge: Charge) -> Billboard:
    """Return where rays meet the picture of a charge.

    Args:
        views: The pictures.
        rays: Of a camera.
        charge: Where it bursts, and how large it is.
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
        forward: Along the line of sight, from the camera.
        towards: The view's direction, from the blast.
        up: What is up in its pictures.
    """
    wanted = up - (-jnp.dot(forward, up)) ** 3 * towards
    right = jnp.cross(forward, wanted)
    square = jnp.sum(jnp.square(right))
    turned = square > 0.0  # else any right will do: here it turns
    right = jnp.where(turned, right, jnp.cross(forward, up))
    right = right / jnp.sqrt(jnp.where(turned, square, 1.0))
    return jnp.stack([right, jnp.cross(forward, right), forward])


def _seen(
    views: Views, charge: Charge, rays: Rays, time: Float[Array, ""]
) -> tuple[Float[Array, "4 row column"], Float[Array, ""]]:
    """Return the premultiplied light of one charge's picture, and how far it is."""
    burst = jnp.stack(charge.position_m)
    board = billboard(views, rays, charge)
    since = charge.since(time) / views.stretch(charge)
    layer = resampled(_picture(views, board.view, since), board.x, board.y)
    visible = board.distance < rays.farthest
    return (
        jnp.where(visible[None], layer, 0.0),
        jnp.sum(jnp.square(burst - rays.origin)),
    )


def _picture(
    views: Views, view: Int[Array, ""], since: Float[Array, ""]
) -> Float[Array, "height width 4"]:
    """Return a view's picture at a time of its own since the burst.

    Premultiplied linear light.
    """
    last = views.frames.shape[1] - 1
    position = since * views.frames_hz
    before = jnp.floor(position)
    frame = jnp.clip(before, -1, last + 1).astype(int)

    def shown(frame):
        values = views.frames[view, jnp.clip(frame, 0, last)].astype(since.dtype)
        image = values / 255.0
        light = srgb_to_linear(image[..., :3]) if views.srgb else image[..., :3]
        light = premultiplied(jnp.concatenate([light, image[..., 3:]], axis=-1))
        return jnp.where((since >= 0.0) & (frame <= last), light, 0.0)

    part = position - before
    return (1.0 - part) * shown(frame) + part * shown(frame + 1)
