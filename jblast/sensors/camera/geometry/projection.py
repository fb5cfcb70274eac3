"""From places in the world to pixels."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Bool, Float

from jblast.scene.camera import Camera, quaternion_matrix
from jblast.sensors.camera.geometry.distortion import distort, unfolded
from jblast.types import as_float_array

STEEPEST = 1e4
"""Largest distance from the axis in the plane at 1: 89.994 degrees. Beyond, the sixth
power and its gradient leave float32."""


class Projected(eqx.Module):
    """Where places of the world appear to a camera.

    Attributes:
        pixel: (x, y), pixel centres at whole numbers [px]; inside the image or not.
        depth: Distance along the camera's axis [m]; negative behind it.
        seen: Whether a lens could show the place: it is ahead of the camera and inside
            the distortion's first fold. Where not, `pixel` has no meaning.
    """

    pixel: Float[Array, "... 2"]
    depth: Float[Array, "..."]
    seen: Bool[Array, "..."]

    def within(self, camera: Camera) -> Bool[Array, "..."]:
        """Return whether a place is seen and its pixel is one of the image's."""
        x, y = self.pixel[..., 0], self.pixel[..., 1]
        across = (x >= -0.5) & (x < camera.width - 0.5)
        return self.seen & across & (y >= -0.5) & (y < camera.height - 0.5)


def project(camera: Camera, points: Float[ArrayLike, "... 3"]) -> Projected:
    r"""Project places of the world into the image.

    $$(X, Y, Z) = R^T (P - C), \quad u = f_x x_d + c_x, \quad v = f_y y_d + c_y$$

    with $(x_d, y_d)$ from `distort(X/Z, Y/Z)`, as `cv2.projectPoints`; `seen` marks
    what no lens would show. Of a place behind the camera, or within 0.006 degrees of
    its plane, the pixel is the principal point: finite, so that the gradient of what
    `seen` masks is never NaN.

    Args:
        camera: Who looks.
        points: East, north, up [m].

    References:
        OpenCV 5, Calib3d, "Detailed Description".
    """
    x, y, depth = (c[..., 0] for c in jnp.split(to_camera(camera, points), 3, axis=-1))
    ahead = depth * STEEPEST > jnp.maximum(jnp.abs(x), jnp.abs(y))
    z = jnp.where(ahead, depth, 1.0)
    across, down = jnp.where(ahead, x, 0.0) / z, jnp.where(ahead, y, 0.0) / z
    plane = jnp.stack([across, down], axis=-1)
    bent = distort(plane, camera.distortion)
    (fx, fy), (cx, cy) = camera.focal, camera.center
    pixel = jnp.stack([fx * bent[..., 0] + cx, fy * bent[..., 1] + cy], axis=-1)
    return Projected(pixel, depth, ahead & unfolded(plane, camera.distortion))


def to_camera(
    camera: Camera, points: Float[ArrayLike, "... 3"]
) -> Float[Array, "... 3"]:
    """Return places of the world in the camera's axes: right, down, ahead [m]."""
    points = as_float_array(points)
    offset = points - jnp.broadcast_to(camera.position, points.shape)
    return offset @ quaternion_matrix(camera.quaternion)
