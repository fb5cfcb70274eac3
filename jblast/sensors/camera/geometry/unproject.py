"""From pixels to directions: the inverse of the camera."""

import jax
import jax.numpy as jnp
from jax.core import Tracer
from jaxtyping import Array, ArrayLike, Float

from jblast.errors import InputError, shown
from jblast.scene.camera import Camera, quaternion_matrix
from jblast.sensors.camera.geometry.distortion import (
    distort,
    distortion_jacobian,
    unfolded,
)
from jblast.types import as_float_array

TRIALS = 100
"""Newton's trials at most."""

ROUNDING = 16
"""What may be left of a pixel, in roundings of the distortion's largest term."""


def unproject(
    camera: Camera, pixel: Float[ArrayLike, "... 2"]
) -> Float[Array, "... 3"]:
    """Direction in the world from which a pixel's light comes.

    Args:
        camera: Who looks.
        pixel: (x, y), pixel centres at whole numbers [px]; inside the image or not.

    Returns:
        East, north, up, of length one. Inside jit, NaN where no direction inside the
        distortion's first fold shows there.

    Raises:
        InputError: Outside jit, for the first such pixel.
    """
    pixel = as_float_array(pixel)
    (fx, fy), (cx, cy) = camera.focal, camera.center
    bent = jnp.stack([(pixel[..., 0] - cx) / fx, (pixel[..., 1] - cy) / fy], axis=-1)
    plane = undistort(bent, camera.distortion)
    found = ~jnp.isnan(plane).any(axis=-1, keepdims=True)
    if not isinstance(found, Tracer) and not found.all():
        raise InputError(
            "camera: expected pixels inside the first fold of the distortion "
            f"{shown(camera.distortion.tolist(), 120)}, got "
            f"{shown(pixel[~found[..., 0]][0].tolist())}"
        )
    plane = jnp.where(found, plane, 0.0)  # the camera's gradients stay finite
    ray = jnp.concatenate([plane, jnp.ones_like(plane[..., :1])], axis=-1)
    unit = ray / jnp.sqrt(jnp.sum(jnp.square(ray), axis=-1, keepdims=True))
    return jnp.where(found, unit @ quaternion_matrix(camera.quaternion).T, jnp.nan)


@jax.custom_jvp
def undistort(
    bent: Float[Array, "... 2"], distortion: Float[Array, "5"]
) -> Float[Array, "... 2"]:
    """Inverse of `distort` inside its first fold; NaN where it has none.

    Newton's method from the centre. A step is halved until it stays inside the fold and
    comes closer, so that it cannot jump to another branch. A point in a gap between two
    folds may be lost, never misplaced. Derivatives are those of the implicit function.

    Args:
        bent: Point of the plane at distance 1, with distortion [-].
        distortion: k1, k2, p1, p2, k3 [-].
    """

    def wanted(point, part, left):
        unsolved = left > _rounding(point, distortion)
        return unsolved & (part > jnp.sqrt(jnp.finfo(bent.dtype).eps))

    def unsolved(state):
        trial, *lanes = state
        return (trial < TRIALS) & jnp.any(wanted(*lanes))

    def newton(state):
        trial, point, part, left = state
        step = _solve(point, distortion, bent - distort(point, distortion))
        there = point + part[..., None] * step
        left_there = _length(bent - distort(there, distortion))
        better = wanted(point, part, left) & (left_there < left)
        better &= unfolded(there, distortion)
        return (
            trial + 1,
            jnp.where(better[..., None], there, point),
            jnp.where(better, jnp.minimum(2 * part, 1.0), part / 2),
            jnp.where(better, left_there, left),
        )

    state = (0, jnp.zeros_like(bent), jnp.ones_like(bent[..., 0]), _length(bent))
    _, point, _, left = jax.lax.while_loop(unsolved, newton, state)
    solved = left <= _rounding(point, distortion)
    return jnp.where(solved[..., None], point, jnp.nan)


@undistort.defjvp
def undistort_jvp(primals, tangents):
    """J dx = d(bent) - d(distort) at a point that stays."""
    bent, distortion = primals
    d_bent, d_distortion = tangents
    point = undistort(bent, distortion)
    found = ~jnp.isnan(point)
    safe = jnp.where(found, point, 0.0)
    _, moved = jax.jvp(lambda d: distort(safe, d), (distortion,), (d_distortion,))
    return point, jnp.where(found, _solve(safe, distortion, d_bent - moved), 0.0)


def _solve(
    point: Float[Array, "... 2"],
    distortion: Float[Array, "5"],
    right: Float[Array, "... 2"],
) -> Float[Array, "... 2"]:
    """Solve J step = right, J the Jacobian of `distort` in a point."""
    xx, xy, yy = distortion_jacobian(point, distortion)
    det = xx * yy - xy * xy
    x, y = right[..., 0], right[..., 1]
    solved = jnp.stack([yy * x - xy * y, xx * y - xy * x], axis=-1)
    return solved / det[..., None]


def _rounding(
    point: Float[Array, "... 2"], distortion: Float[Array, "5"]
) -> Float[Array, "..."]:
    """Return what `distort` cannot tell from zero: rounding of its largest terms."""
    terms = _length(distort(jnp.abs(point), jnp.abs(distortion)))
    return ROUNDING * jnp.finfo(point.dtype).eps * terms


def _length(vector: Float[Array, "... 2"]) -> Float[Array, "..."]:
    return jnp.sqrt(jnp.sum(jnp.square(vector), axis=-1))
