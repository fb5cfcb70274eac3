"""Where a camera points: quaternions, matrices, and looking at a place.

World axes are east, north, up. Camera axes are OpenCV's: x to the image's right, y to
its foot, z into the scene. A rotation takes camera axes to world axes.

A quaternion is (x, y, z, w), scalar last, in all of jblast: of a camera and of a
vehicle, in files, arrays and columns, as SciPy and ROS have it.

Each is compiled as a whole: read from a file, a pose would else be some sixty programs.
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float

from jblast.types import as_float_array


@jax.jit
def quaternion_matrix(quaternion: Float[ArrayLike, "4"]) -> Float[Array, "3 3"]:
    r"""Matrix of a rotation given as a quaternion.

    $$R = I + \frac{2}{|q|^2}\left(w\,[v]_\times + [v]_\times^2\right)$$

    The length does not matter, so gradients have no part along it and a fit may move
    the four numbers freely. A quaternion of length zero gives NaN.

    Args:
        quaternion: $q = (v, w) = (x, y, z, w)$, scalar last.

    Returns:
        $R$; its columns are the camera's axes in the world.
    """
    x, y, z, w = q = as_float_array(quaternion)
    cross = jnp.array([[0 * w, -z, y], [z, 0 * w, -x], [-y, x, 0 * w]])
    turned = w * cross + cross @ cross
    return jnp.eye(3, dtype=q.dtype) + 2.0 / jnp.sum(jnp.square(q)) * turned


@jax.jit
def quaternion_product(
    after: Float[ArrayLike, "4"], before: Float[ArrayLike, "4"]
) -> Float[Array, "4"]:
    """Quaternion (x, y, z, w) of one rotation, and then another.

    Args:
        after: The later rotation.
        before: The earlier one.
    """
    a, b = as_float_array(after), as_float_array(before)
    vector = a[3] * b[:3] + b[3] * a[:3] + jnp.cross(a[:3], b[:3])
    return jnp.append(vector, a[3] * b[3] - jnp.dot(a[:3], b[:3]))


@jax.jit
def matrix_quaternion(matrix: Float[ArrayLike, "3 3"]) -> Float[Array, "4"]:
    r"""Unit quaternion (x, y, z, w) of a rotation matrix, with $w \ge 0$.

    $4\,q\,q^T$ is linear in the matrix. Its row with the largest diagonal, at least 1,
    is $q$ times a number far from zero, so no angle is singular (Shepperd 1978).

    Args:
        matrix: Orthonormal, of determinant 1.
    """
    m = as_float_array(matrix)
    (a, b, c), skew, even = jnp.diagonal(m), m - m.T, m + m.T
    wx, wy, wz = skew[2, 1], skew[0, 2], skew[1, 0]
    xy, xz, yz = even[0, 1], even[0, 2], even[1, 2]
    outer = jnp.array(
        [
            [1 + a - b - c, xy, xz, wx],
            [xy, 1 - a + b - c, yz, wy],
            [xz, yz, 1 - a - b + c, wz],
            [wx, wy, wz, 1 + a + b + c],
        ]
    )
    unit = _unit(outer[jnp.argmax(jnp.diagonal(outer))])
    return jnp.where(unit[3] < 0, -unit, unit)


@jax.jit
def look_at(
    position: Float[ArrayLike, "3"], target: Float[ArrayLike, "3"]
) -> Float[Array, "4"]:
    """Rotation of a level camera that has a place in the middle of its view.

    The image's right is level. Straight up or down every direction across is level:
    right is then east, as if the camera had faced north and been tilted. The rotation
    jumps there, and its gradient leaves the heading out.

    Args:
        position: Of the camera: east, north, up [m].
        target: What it looks at: east, north, up [m].

    Returns:
        Unit quaternion (x, y, z, w), camera to world; NaN, with gradient zero, where
        the two places are one.
    """
    ahead = as_float_array(target) - as_float_array(position)
    apart = jnp.any(ahead != 0)
    forward = _unit(jnp.where(apart, ahead, 1.0))
    level = jnp.array([forward[1], -forward[0], 0.0], forward.dtype)
    tilted = jnp.any(level != 0)
    right = _unit(jnp.where(tilted, level, jnp.array([1.0, 0.0, 0.0], forward.dtype)))
    down = jnp.cross(forward, right)
    turned = matrix_quaternion(jnp.stack([right, down, forward], axis=-1))
    return jnp.where(apart, turned, jnp.nan)


def _unit(vector: Float[Array, " axis"]) -> Float[Array, " axis"]:
    """Return a vector of length one; scaled first, so that no square underflows."""
    scaled = vector / jax.lax.stop_gradient(jnp.max(jnp.abs(vector)))
    return scaled / jnp.sqrt(jnp.sum(jnp.square(scaled)))
