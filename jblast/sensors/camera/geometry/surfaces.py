"""What the rays of an image end at: places, and which way their surfaces face."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jblast.sensors.camera.geometry.pixel_rays import Rays


class Surfaces(eqx.Module):
    """Places of the background, one a pixel.

    Attributes:
        place: East, north, up [m]; that of the camera where there is none.
        normal: Unit vector away from the surface, on the camera's side of it.
        solid: Whether there is a surface at all; sky has none.
    """

    place: Float[Array, "3 row column"]
    normal: Float[Array, "3 row column"]
    solid: Bool[Array, "row column"]


def surfaces_seen(rays: Rays, *, image: bool) -> Surfaces:
    """Return where rays end.

    On the plane up = 0 the normal is up. Elsewhere it comes from the places of the
    neighbours, of the nearer one on each axis, so that it does not lean over an edge;
    a pixel without a neighbour faces the camera.

    Args:
        rays: One through the centre of each pixel.
        image: Whether they end at a depth image too, or at the ground alone.
    """
    solid = jnp.isfinite(rays.farthest) & (rays.farthest > 0.0)
    way = jnp.where(solid, rays.farthest, 0.0)[None] * rays.direction
    place = rays.origin[:, None, None] + way
    up = jnp.zeros_like(place).at[2].set(1.0)
    if not image:
        return Surfaces(place, up, solid)
    # seven digits of a far place leave the plane by as much
    height = 16.0 * jnp.finfo(place.dtype).eps * (rays.farthest + rays.origin[2])
    flat = solid & (jnp.abs(place[2]) <= height)
    across, along = (_towards_neighbour(place, solid, axis) for axis in (2, 1))
    normal = jnp.cross(across, along, axis=0)
    square = jnp.sum(jnp.square(normal), axis=0)
    leans = square > 0.0
    length = jnp.sqrt(jnp.where(leans, square, 1.0))[None]
    normal = jnp.where(leans[None], normal / length, -rays.direction)
    facing = jnp.sum(normal * rays.direction, axis=0) <= 0.0
    normal = jnp.where(facing[None], normal, -normal)
    return Surfaces(place, jnp.where(flat[None], up, normal), solid)


def _towards_neighbour(
    place: Float[Array, "3 row column"], solid: Bool[Array, "row column"], axis: int
) -> Float[Array, "3 row column"]:
    """Return the step along an axis to the neighbour that is nearer; zero of none."""
    if place.shape[axis] == 1:
        return jnp.zeros_like(place)
    here, there = (
        (slice(None),) * axis + (part,) for part in (slice(-1), slice(1, None))
    )
    step = place[there] - place[here]
    known = solid[there[1:]] & solid[here[1:]]
    square = jnp.where(known, jnp.sum(jnp.square(step), axis=0), jnp.inf)
    step = jnp.where(known[None], step, 0.0)
    none = [(0, 0)] * 3
    none[axis] = (0, 1)
    ahead = jnp.pad(step, none), jnp.pad(square, none[1:], constant_values=jnp.inf)
    none[axis] = (1, 0)
    back = jnp.pad(step, none), jnp.pad(square, none[1:], constant_values=jnp.inf)
    return jnp.where((ahead[1] <= back[1])[None], ahead[0], back[0])
