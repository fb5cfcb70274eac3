"""Camera: position, orientation, lens and image sensor.

World axes are east, north, up. Camera axes are those of OpenCV: x to the image's right,
y to its bottom, z into the scene. A rotation takes camera axes to world axes.

A quaternion is (x, y, z, w), scalar last, in all of jblast: for cameras and vehicles,
in files, arrays and columns, as in SciPy and ROS.

For JAX arrays each function of quaternions is compiled as a whole; as separate
operations one pose would compile some sixty programs.
"""

import math

import numpy as np

from jblast.errors import require
from jblast.parameters import NOT_NEGATIVE, POSITIVE, UNBOUNDED
from jblast.types import (
    Array,
    ArrayLike,
    Float,
    Module,
    Scalar,
    as_numbers,
    compiled,
    field,
    is_traced,
    namespace,
    number,
)

FRAMES_HZ = 1000.0
"""Default frame rate [1/s]."""
MOUNTS = ("vehicle",)
"""Possible mounts of a camera."""
FORWARD = (-0.5, 0.5, -0.5, 0.5)
"""Quaternion from a camera's axes to those of its body, for a view forward."""


class Camera(Module):
    """A pinhole camera with OpenCV's radial-tangential distortion.

    World axes are east, north, up; camera axes are x right, y down, z into the scene.
    Pixel centres have integer coordinates; the first pixel is (0, 0).

    Attributes:
        position: East, north, up [m].
        quaternion: Camera to world (x, y, z, w), scalar last; its length is ignored.
        focal: Focal lengths along x and y [px].
        center: Principal point (x, y) [px].
        width: Width of the image [px].
        height: Height of the image [px].
        distortion: k1, k2, p1, p2, k3 [-], in OpenCV's order.
        frames_hz: Frames in a second [1/s].
        exposure_s: Exposure time of a frame [s]; 0 is an instant.
        threshold: Steps of log intensity that make an event: brighter, darker; both
            positive [-].
        daylight: Illuminance of the ground by sky and sun, to which pictures are
            exposed [lx]; None: full sun.
        mount: "" for none, "vehicle" for the scene's vehicle. Then position and
            quaternion are those in the axes of its body (forward, left, up).
    """

    position: Float[Array, "3"] = field(converter=as_numbers, bounds=UNBOUNDED)
    quaternion: Float[Array, "4"] = field(converter=as_numbers, bounds=UNBOUNDED)
    focal: Float[Array, "2"] = field(converter=as_numbers, bounds=POSITIVE)
    center: Float[Array, "2"] = field(converter=as_numbers, bounds=UNBOUNDED)
    width: int = field(static=True, bounds=POSITIVE)
    height: int = field(static=True, bounds=POSITIVE)
    distortion: Float[Array, "5"] = field(
        converter=as_numbers, bounds=UNBOUNDED, default_factory=lambda: np.zeros(5)
    )
    frames_hz: Scalar = number(bounds=POSITIVE, default=FRAMES_HZ)
    exposure_s: Scalar = number(bounds=NOT_NEGATIVE, default=0.0)
    threshold: Float[Array, "2"] = field(
        converter=as_numbers, bounds=POSITIVE, default_factory=lambda: np.full(2, 0.2)
    )
    daylight: Scalar | None = number(bounds=POSITIVE, default=None)
    mount: str = field(static=True, default="")

    def __check_init__(self) -> None:
        turned = is_traced(self.quaternion) or np.any(np.asarray(self.quaternion))
        require(turned, "camera quaternion", "one that is not zero", "zero")


@compiled
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
    x, y, z, w = q = as_numbers(quaternion)
    # 0 * w, so that the entries have the type and tracer of the others.
    xp = namespace(q)
    cross = xp.asarray([[0 * w, -z, y], [z, 0 * w, -x], [-y, x, 0 * w]])
    turned = w * cross + cross @ cross
    return xp.eye(3, dtype=q.dtype) + 2.0 / xp.sum(xp.square(q)) * turned


@compiled
def quaternion_product(
    after: Float[ArrayLike, "4"], before: Float[ArrayLike, "4"]
) -> Float[Array, "4"]:
    """Quaternion (x, y, z, w) of one rotation followed by another.

    Args:
        after: The later rotation.
        before: The earlier one.
    """
    a, b = as_numbers(after), as_numbers(before)
    xp = namespace(a, b)
    vector = a[3] * b[:3] + b[3] * a[:3] + xp.cross(a[:3], b[:3])
    return xp.append(vector, a[3] * b[3] - xp.dot(a[:3], b[:3]))


@compiled
def matrix_quaternion(matrix: Float[ArrayLike, "3 3"]) -> Float[Array, "4"]:
    r"""Unit quaternion (x, y, z, w) of a rotation matrix, with $w \ge 0$.

    $4\,q\,q^T$ is linear in the matrix. Its row with the largest diagonal, at least 1,
    is $q$ times a number far from zero, so no angle is singular (Shepperd 1978).

    Args:
        matrix: Orthonormal, of determinant 1.
    """
    m = as_numbers(matrix)
    xp = namespace(m)
    # Only four of ten entries are used, but all are computed: a branch would depend on
    # data.
    (a, b, c), skew, even = xp.diagonal(m), m - m.T, m + m.T
    wx, wy, wz = skew[2, 1], skew[0, 2], skew[1, 0]
    xy, xz, yz = even[0, 1], even[0, 2], even[1, 2]
    outer = xp.asarray(
        [
            [1 + a - b - c, xy, xz, wx],
            [xy, 1 - a + b - c, yz, wy],
            [xz, yz, 1 - a - b + c, wz],
            [wx, wy, wz, 1 + a + b + c],
        ]
    )
    # The row with the largest diagonal has the best relative precision.
    unit = _unit(outer[xp.argmax(xp.diagonal(outer))])
    # q and -q are one rotation; the sign makes written scenes comparable.
    return xp.where(unit[3] < 0, -unit, unit)


@compiled
def look_at(
    position: Float[ArrayLike, "3"], target: Float[ArrayLike, "3"]
) -> Float[Array, "4"]:
    """Rotation of a level camera with a position in the middle of its view.

    The image's x axis is level. For a view straight up or down every axis of the image
    is level; x is then east, as of a camera that faces north and is tilted. The
    rotation is discontinuous there, and its gradient is without the heading.

    Args:
        position: Of the camera: east, north, up [m].
        target: Position in the middle of the view: east, north, up [m].

    Returns:
        Unit quaternion (x, y, z, w), camera to world; NaN, with gradient zero, where
        the two positions are equal.
    """
    ahead = as_numbers(target) - as_numbers(position)
    xp = namespace(ahead)
    apart = xp.any(ahead != 0)
    # The input is replaced, not the result, so that no branch has a NaN gradient.
    forward = _unit(xp.where(apart, ahead, 1.0))
    level = xp.asarray([forward[1], -forward[0], 0.0], forward.dtype)
    tilted = xp.any(level != 0)
    east = xp.asarray([1.0, 0.0, 0.0], forward.dtype)
    right = _unit(xp.where(tilted, level, east))
    down = xp.cross(forward, right)
    turned = matrix_quaternion(xp.stack([right, down, forward], axis=-1))
    return xp.where(apart, turned, math.nan)


def _unit(vector: Float[Array, " axis"]) -> Float[Array, " axis"]:
    """Return a vector of length one; scaled first, so that no square underflows."""
    xp = namespace(vector)
    # a power of two, whose gradient is zero as that of `floor`
    scaled = vector / xp.exp2(xp.floor(xp.log2(xp.max(xp.abs(vector)))))
    return scaled / xp.sqrt(xp.sum(xp.square(scaled)))
