"""Where the pictures of a charge stand, and how they are laid there."""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from jblast.scene.charge import Charge
from jblast.sensors.camera.geometry.pixel_rays import Rays
from jblast.sensors.camera.rendering.baked.pictures import Pictures
from jblast.sensors.camera.rendering.billboards import GRAZING, billboard_axes
from jblast.sensors.camera.rendering.fireball_image import Cloud
from jblast.waves.fireball import LARGEST_RADIUS

CLOSEST = 0.9
"""Radius over distance from which on the outline of a ball is not followed."""

ON_GROUND = 0.5
"""Height of a burst over its largest radius up to which the picture stands below it."""

LOWEST = 0.1
"""Of the middle of a cloud as it is seen, over its radius."""

HIGHEST = 2.0
"""Height over that of the middle from which on the wind carries all alike."""


class Plane(NamedTuple):
    """Where a picture stands: across the line of sight, through the foot of the cloud.

    Attributes:
        sight: From the camera to its anchor [m].
        far: How far that is [m].
        apart: Whether the camera is anywhere else.
        radius: That the visible radius is to have there [m].
        drift: Of the middle of the cloud with the wind: east, north, up [m].
    """

    sight: Float[Array, "3"]
    far: Float[Array, ""]
    apart: Bool[Array, ""]
    radius: Float[Array, ""]
    drift: Float[Array, "3"]


class Laid(NamedTuple):
    """How one picture of several is laid on the plane.

    Attributes:
        scale: Texels a metre [1/m].
        x: Column of the picture where the foot of the cloud is [px].
        y: Row of it.
        drift: Of the middle of the cloud with the wind, to the right and down [m].
        middle: How high it is above the foot, as it is seen [m].
        level: Cosine of the elevation from which it is seen.
    """

    scale: Float[Array, ""]
    x: Float[Array, ""]
    y: Float[Array, ""]
    drift: tuple[Float[Array, ""], Float[Array, ""]]
    middle: Float[Array, ""]
    level: Float[Array, ""]


class Met(NamedTuple):
    """Where rays meet the plane.

    Attributes:
        right: Of the foot of the cloud, along the picture's rows [m].
        down: Below it, along its columns [m].
        ever: Whether they do.
        distance: Along each ray [m].
    """

    right: Float[Array, "row column"]
    down: Float[Array, "row column"]
    ever: Bool[Array, "row column"]
    distance: Float[Array, "row column"]

    def on(self, laid: Laid) -> tuple[Float[Array, "..."], Float[Array, "..."]]:
        """Return the places on a picture [px]."""
        # how high a place is can be seen from the side, and not from above
        higher = jnp.clip(-self.down / laid.middle, 0.0, HIGHEST) - 1.0
        carried = 1.0 + laid.level * higher
        right, down = laid.drift
        return (
            laid.x + laid.scale * (self.right - carried * right),
            laid.y + laid.scale * (self.down - carried * down),
        )


def foot_height(charge: Charge) -> Float[Array, ""]:
    """Return how high the foot of a charge's pictures stands [m].

    On the ground, unless the burst is more than half its largest radius above it.
    """
    largest = LARGEST_RADIUS * jnp.cbrt(charge.tnt_mass("fireball_radius_m"))
    return charge.up - jnp.clip(charge.up, 0.0, ON_GROUND * largest)


def plane_of(charge: Charge, rays: Rays, ball: Cloud) -> Plane:
    """Return where the pictures of a charge stand."""
    east, north, _ = charge.position_m
    sight = jnp.stack([east, north, foot_height(charge)]) - rays.origin
    apart = jnp.any(sight != 0.0)
    sight = jnp.where(apart, sight, 1.0)
    far = jnp.sqrt(jnp.sum(jnp.square(sight)))
    sine = jnp.minimum(ball.radius / far, CLOSEST)
    seen = ball.radius / jnp.sqrt(1.0 - jnp.square(sine))
    radius = jnp.where(ball.radius > 0.0, seen, 1.0)
    drift = ball.centre - jnp.stack([east, north, ball.centre[2]])
    return Plane(sight, far, apart, radius, drift)


def axes_of(views: Pictures, plane: Plane, view: Int[Array, ""]) -> Float[Array, "3 3"]:
    """Return right, down and forward of a view's pictures, as rows."""
    forward = plane.sight / plane.far
    return billboard_axes(forward, views.direction[view], views.up[view])


def laid_on(
    views: Pictures,
    plane: Plane,
    axes: Float[Array, "3 3"],
    view: Int[Array, ""],
    frame: Int[Array, ""],
) -> Laid:
    """Return how a view's picture of a frame is laid on its plane."""
    radius, level = level_radius(views, axes, view, frame), -axes[1, 2]
    # by how much the middle of the cloud stands higher here than in the picture
    raised = views.height[frame] * radius * (level - views.up[view, 2])
    x, y = views.anchor[view]
    right, down, _ = axes @ plane.drift
    middle = jnp.maximum(views.height[frame] * level, LOWEST) * plane.radius
    scale = radius / plane.radius
    return Laid(scale, x, y + raised, (right, down), middle, level)


def level_radius(
    views: Pictures,
    axes: Float[Array, "3 3"],
    view: Int[Array, ""],
    frame: Int[Array, ""],
) -> Float[Array, ""]:
    r"""Return a picture's visible radius along what is level where it is shown [px].

    A view from beside is turned in the image, the more the higher the camera: two
    standard deviations of its own columns are then not those of the camera's. Along the
    level direction $n$ of the picture they are $2\sqrt{n^T \Sigma n}$, with $\Sigma$
    the covariance of the silhouette. Seen from straight above nothing is level, and the
    picture's columns are taken.
    """
    across, along = -axes[1, 2], axes[0, 2]
    square = jnp.square(across) + jnp.square(along)
    some = square > 0.0
    across = jnp.where(some, across, 1.0)
    mixed, rows = views.spread[view, frame]
    shape = jnp.square(across) + (2.0 * mixed * across + rows * along) * along
    return views.radius[view, frame] * jnp.sqrt(shape / jnp.where(some, square, 1.0))


def met_by(axes: Float[Array, "3 3"], plane: Plane, rays: Rays) -> Met:
    """Return where rays meet the plane of a picture."""
    east, north, up = rays.direction
    # written out: a matrix product would go through memory
    right, down, ahead = (a[0] * east + a[1] * north + a[2] * up for a in axes)
    met = (ahead > GRAZING) & (rays.farthest > 0.0) & plane.apart
    distance = plane.far / jnp.where(met, ahead, 1.0)
    return Met(right * distance, down * distance, met, distance)
