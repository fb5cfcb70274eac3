r"""Lens and pose of a camera: from a point to a pixel, and from a pixel to a ray.

The lens distorts by Brown and Conrady's radial-tangential model in OpenCV's form
(Calib3d, "Detailed Description"). For $x$ a point of the plane at distance 1 and
$r = |x|$:

$$x_d = S x + 2 (p \cdot x)\,x + r^2 p, \quad S = 1 + k_1 r^2 + k_2 r^4 + k_3 r^6, \quad
p = (p_2, p_1)$$

It is the gradient of a potential, so its Jacobian is symmetric. In the axes $e$ along
$x$ and $e_\perp$ across, with $a = p \cdot e$ and $b = p \cdot e_\perp$, it is

$$\begin{pmatrix} S_r + 6 r a & 2 r b \\ 2 r b & S + 2 r a \end{pmatrix}, \quad
S_r = 1 + 3 k_1 r^2 + 5 k_2 r^4 + 7 k_3 r^6$$

At the centre it is the unit matrix. Where its smaller eigenvalue reaches zero on the
way out, so does its determinant, and the image folds over: one pixel then shows several
directions, and only those inside the fold are real. Pixels beyond it have no direction.

A ray ends at the ground, or at the surface of a depth image. A camera on a moving body
has a pose at each time of its path.
"""

import dataclasses
from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.core import Tracer
from jaxtyping import Array, ArrayLike, Bool, Float

from jblast.errors import require, shown
from jblast.scene.camera import Camera, quaternion_matrix, quaternion_product
from jblast.types import as_numbers

STEEPEST = 1e4
"""Largest distance from the axis in the plane at 1: 89.994 degrees. Beyond it the sixth
power and its gradient overflow float32."""
TRIALS = 40
"""Newton trials, halved steps included; an unsolved pixel is NaN. Lenses take four to
eight, points next to a fold twenty."""
ROUNDING = 16
"""Accepted residual of a pixel, in rounding errors of the distortion's largest term:
the few operations of `distort` add up to less."""
STEPS = 64
"""Points between centre and ray at which the fold is searched. A fold that opens and
closes between two of them is not found."""


class Projected(eqx.Module):
    """Pixels at which points of the world appear to a camera.

    Attributes:
        pixel: (x, y), pixel centres at whole numbers [px]; inside the image or not.
        depth: Distance along the camera's axis [m]; negative behind it.
        seen: True if a lens could show the point: it is ahead of the camera and inside
            the distortion's first fold. Otherwise `pixel` is meaningless.
    """

    pixel: Float[Array, "... 2"]
    depth: Float[Array, "..."]
    seen: Bool[Array, "..."]

    def within(self, camera: Camera) -> Bool[Array, "..."]:
        """Return True for points that are seen at a pixel of the image."""
        x, y = self.pixel[..., 0], self.pixel[..., 1]
        across = (x >= -0.5) & (x < camera.width - 0.5)
        return self.seen & across & (y >= -0.5) & (y < camera.height - 0.5)


def project(camera: Camera, points: Float[ArrayLike, "... 3"]) -> Projected:
    r"""Return the projection of points of the world into the image.

    $$(X, Y, Z) = R^T (P - C), \quad u = f_x x_d + c_x, \quad v = f_y y_d + c_y$$

    with $(x_d, y_d)$ from `distort(X/Z, Y/Z)`, as `cv2.projectPoints`; `seen` marks
    points that a lens shows. The pixel of a point behind the camera, or within 0.006
    degrees of its plane, is the principal point: finite, so that the gradient of values
    masked by `seen` is never NaN.

    Args:
        camera: The camera.
        points: East, north, up [m].

    References:
        OpenCV 5, Calib3d, "Detailed Description".
    """
    x, y, depth = (c[..., 0] for c in jnp.split(to_camera(camera, points), 3, axis=-1))
    # a product instead of a quotient: no division by a depth near zero
    ahead = depth * STEEPEST > jnp.maximum(jnp.abs(x), jnp.abs(y))
    # guarded inputs, not a guarded result: a `where` around x / 0 has NaN gradients
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
    """Return points of the world in the camera's axes: right, down, ahead [m]."""
    points = as_numbers(points)
    offset = points - jnp.broadcast_to(camera.position, points.shape)
    return offset @ quaternion_matrix(camera.quaternion)


def unproject(
    camera: Camera, pixel: Float[ArrayLike, "... 2"]
) -> Float[Array, "... 3"]:
    """Return the direction in the world of a pixel's light.

    Args:
        camera: The camera.
        pixel: (x, y), pixel centres at whole numbers [px]; inside the image or not.

    Returns:
        East, north, up, unit length. Inside jit, NaN if the pixel shows no direction
        inside the distortion's first fold.

    Raises:
        InputError: Outside jit, for the first such pixel.
    """
    pixel = as_numbers(pixel)
    unit, found = lens_direction(camera, pixel)
    if not isinstance(found, Tracer):
        beyond = pixel[~found].tolist()
        fold = shown(camera.distortion.tolist(), 120)
        require(
            not beyond,
            "camera",
            f"pixels inside the first fold of the distortion {fold}",
            next(iter(beyond), ""),
        )
    turned = unit @ quaternion_matrix(camera.quaternion).T
    return jnp.where(found[..., None], turned, jnp.nan)


def lens_direction(
    camera: Camera, pixel: Float[Array, "... 2"]
) -> tuple[Float[Array, "... 3"], Bool[Array, "..."]]:
    """Return unit directions of pixels in the camera's axes, and if there are any."""
    (fx, fy), (cx, cy) = camera.focal, camera.center
    bent = jnp.stack([(pixel[..., 0] - cx) / fx, (pixel[..., 1] - cy) / fy], axis=-1)
    plane = undistort(bent, camera.distortion)
    found = ~jnp.isnan(plane).any(axis=-1)
    # NaN would spoil the camera's gradients: any direction
    plane = jnp.where(found[..., None], plane, 0.0)
    ray = jnp.concatenate([plane, jnp.ones_like(plane[..., :1])], axis=-1)
    return ray / _length(ray)[..., None], found


@jax.custom_jvp
def undistort(
    bent: Float[Array, "... 2"], distortion: Float[Array, "5"]
) -> Float[Array, "... 2"]:
    """Return the inverse of `distort` inside its first fold; NaN where it has none.

    Newton's method from the centre. A step is halved until the Jacobian stays positive
    and the residual falls, so that it does not jump to another branch; the solution is
    accepted if no fold lies between it and the centre. A point in a gap between two
    folds may be lost, but never misplaced. Derivatives are those of the implicit
    function.

    Args:
        bent: Point of the plane at distance 1, with distortion [-].
        distortion: k1, k2, p1, p2, k3 [-].
    """

    def newton(_, state):
        point, part, left = state
        step = _solve(point, distortion, bent - distort(point, distortion))
        there = point + part[..., None] * step
        left_there = _length(bent - distort(there, distortion))
        better = (left_there < left) & _clear(there, distortion)
        return (
            jnp.where(better[..., None], there, point),
            jnp.where(better, jnp.minimum(2.0 * part, 1.0), 0.5 * part),
            jnp.where(better, left_there, left),
        )

    state = jnp.zeros_like(bent), jnp.ones_like(bent[..., 0]), _length(bent)
    point, _, left = jax.lax.fori_loop(0, TRIALS, newton, state)
    solved = (left <= _rounding(point, distortion)) & unfolded(point, distortion)
    return jnp.where(solved[..., None], point, jnp.nan)


@undistort.defjvp
def undistort_jvp(primals, tangents):
    """Solve J dx = d(bent) - d(distort) at the converged point."""
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
    """Solve J step = right, with J the Jacobian of `distort` at a point."""
    xx, xy, yy = distortion_jacobian(point, distortion)
    # 2 x 2 by Cramer's rule: LAPACK calls for each pixel would be far slower
    det = xx * yy - xy * xy
    x, y = right[..., 0], right[..., 1]
    solved = jnp.stack([yy * x - xy * y, xx * y - xy * x], axis=-1)
    return solved / det[..., None]


def _rounding(
    point: Float[Array, "... 2"], distortion: Float[Array, "5"]
) -> Float[Array, "..."]:
    """Return the rounding error of the largest terms of `distort`."""
    terms = _length(distort(jnp.abs(point), jnp.abs(distortion)))
    return ROUNDING * jnp.finfo(point.dtype).eps * terms


def _length(vector: Float[Array, "... axis"]) -> Float[Array, "..."]:
    return jnp.sqrt(jnp.sum(jnp.square(vector), axis=-1))


def distort(
    point: Float[Array, "... 2"], distortion: Float[Array, "5"]
) -> Float[Array, "... 2"]:
    """Return the distorted position of a point of the plane at distance 1.

    Args:
        point: Without distortion: x/z, y/z [-].
        distortion: k1, k2, p1, p2, k3 [-].
    """
    x, y = point[..., 0], point[..., 1]
    k1, k2, p1, p2, k3 = distortion
    r2 = x * x + y * y
    scale = 1 + r2 * (k1 + r2 * (k2 + r2 * k3)) + 2 * (p2 * x + p1 * y)
    return jnp.stack([scale * x + r2 * p2, scale * y + r2 * p1], axis=-1)


@jax.jit
def distortion_jacobian(
    point: Float[Array, "... 2"], distortion: Float[Array, "5"]
) -> tuple[Float[Array, "..."], Float[Array, "..."], Float[Array, "..."]]:
    """Return entries xx, xy, yy of the symmetric Jacobian of `distort` at the point."""
    x, y = point[..., 0], point[..., 1]
    k1, k2, p1, p2, k3 = distortion
    r2 = x * x + y * y
    scale = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
    slope = 2 * k1 + r2 * (4 * k2 + r2 * 6 * k3)
    return (
        scale + slope * x * x + 6 * p2 * x + 2 * p1 * y,
        slope * x * y + 2 * (p1 * x + p2 * y),
        scale + slope * y * y + 2 * p2 * x + 6 * p1 * y,
    )


def unfolded(
    point: Float[Array, "... 2"], distortion: Float[Array, "5"]
) -> Bool[Array, "..."]:
    """Return True if no fold lies between the centre and a point, nor on it.

    Args:
        point: Without distortion: x/z, y/z [-].
        distortion: k1, k2, p1, p2, k3 [-].
    """
    # a boolean has no derivative: the loop would only cost memory in a gradient
    point, distortion = jax.lax.stop_gradient((point, distortion))

    def step(n, clear):
        return clear & _clear(point * ((n + 1) / STEPS), distortion)

    clear = jnp.ones(point.shape[:-1], bool)
    return jax.lax.fori_loop(0, STEPS, step, clear)


def _clear(
    point: Float[Array, "... 2"], distortion: Float[Array, "5"]
) -> Bool[Array, "..."]:
    """Return True where both eigenvalues of the Jacobian are positive.

    The determinant is compared after division: its products would overflow in float32.
    """
    xx, xy, yy = distortion_jacobian(point, distortion)
    return (xx > 0) & (xy * (xy / jnp.where(xx > 0, xx, 1.0)) < yy)


class Rays(eqx.Module):
    """Straight lines from a camera, one or several per pixel.

    Attributes:
        origin: Common origin: east, north, up [m].
        direction: East, north, up, unit length.
        farthest: Distance of the background along the ray [m]; infinite without one, 0
            for a pixel that shows no direction.
    """

    origin: Float[Array, "3"]
    direction: Float[Array, "3 row column"]
    farthest: Float[Array, "row column"]


@partial(jax.jit, static_argnames="ground")
def pixel_rays(
    camera: Camera,
    depth: Float[Array, "height width"] | None = None,
    *,
    ground: bool = True,
) -> Rays:
    """Return the rays through the centres of all pixels, row by row.

    Args:
        camera: The camera.
        depth: Distance of the background along each pixel's ray [m]; None is infinite.
        ground: True if rays end at the plane up = 0.
    """
    return turned_rays(lens_rays(camera, depth), camera, ground=ground)


# compiled, so that many programs share it and `undistort` runs once a lens
@eqx.filter_jit
def lens_rays(
    camera: Camera, depth: Float[Array, "height width"] | None = None
) -> Rays:
    """Return the rays of a lens in the camera's axes: right, down, ahead.

    Args:
        camera: The camera, whose pose is not used.
        depth: Distance of the background along each pixel's ray [m]; None is infinite.
    """
    x, y = (
        jnp.arange(n, dtype=camera.focal.dtype) for n in (camera.width, camera.height)
    )
    unit, shown = lens_direction(camera, jnp.stack(jnp.meshgrid(x, y), axis=-1))
    unit = jnp.moveaxis(unit, -1, 0)  # contiguous images of each component: faster
    farthest = jnp.inf if depth is None else depth.astype(unit.dtype)
    return Rays(jnp.zeros(3, unit.dtype), unit, jnp.where(shown, farthest, 0.0))


def turned_rays(rays: Rays, camera: Camera, *, ground: bool = True) -> Rays:
    """Return the rays of a lens for a pose in the world.

    Args:
        rays: Rays from `lens_rays`.
        camera: Camera with its pose in the world.
        ground: True if they end at the plane up = 0.
    """
    matrix = quaternion_matrix(camera.quaternion)
    x, y, z = rays.direction
    # written out: a matrix product would go through memory
    direction = jnp.stack([row[0] * x + row[1] * y + row[2] * z for row in matrix])
    farthest = rays.farthest
    if ground:
        down = direction[2] < 0.0
        # rays at or above the horizon never meet the ground
        hit = -camera.position[2] / jnp.where(down, direction[2], -1.0)
        farthest = jnp.where(down, jnp.minimum(farthest, hit), farthest)
    return Rays(camera.position, direction, farthest)


class Surfaces(eqx.Module):
    """Points of the background, one per pixel.

    Attributes:
        place: East, north, up from the camera [m]; zero if there is no surface.
        normal: Unit normal of the surface, on the camera's side.
        solid: True if there is a surface; false for sky.
    """

    place: Float[Array, "3 row column"]
    normal: Float[Array, "3 row column"]
    solid: Bool[Array, "row column"]


def surfaces_seen(rays: Rays, *, image: bool) -> Surfaces:
    """Return the surfaces at which rays end.

    On the plane up = 0 the normal is up. Elsewhere it follows from the points of the
    neighbours, on each axis from the nearer one, so that it does not lean over an edge.
    A pixel without a neighbour faces the camera.

    Args:
        rays: One ray through the centre of each pixel.
        image: True if they also end at a depth image, not only at the ground.
    """
    solid = jnp.isfinite(rays.farthest) & (rays.farthest > 0.0)
    place = jnp.where(solid, rays.farthest, 0.0)[None] * rays.direction
    up = jnp.zeros_like(place).at[2].set(1.0)
    if not image:
        return Surfaces(place, up, solid)
    # float32 has seven digits: a far point on the plane is off it by as much
    height = 16.0 * jnp.finfo(place.dtype).eps * (rays.farthest + rays.origin[2])
    flat = solid & (jnp.abs(rays.origin[2] + place[2]) <= height)
    across, along = (_towards_neighbour(place, solid, axis) for axis in (2, 1))
    # two tangents of the surface, by differences to neighbours
    normal = jnp.cross(across, along, axis=0)
    square = jnp.sum(jnp.square(normal), axis=0)
    leans = square > 0.0
    length = jnp.sqrt(jnp.where(leans, square, 1.0))[None]
    normal = jnp.where(leans[None], normal / length, -rays.direction)
    # the order of neighbours gives either sign
    facing = jnp.sum(normal * rays.direction, axis=0) <= 0.0
    normal = jnp.where(facing[None], normal, -normal)
    return Surfaces(place, jnp.where(flat[None], up, normal), solid)


def _towards_neighbour(
    place: Float[Array, "3 row column"], solid: Bool[Array, "row column"], axis: int
) -> Float[Array, "3 row column"]:
    """Return the step along an axis to the nearer neighbour; zero without one."""
    if place.shape[axis] == 1:
        return jnp.zeros_like(place)
    here, there = (
        (slice(None),) * axis + (part,) for part in (slice(-1), slice(1, None))
    )
    step = place[there] - place[here]
    # a neighbour in the sky is no part of the surface
    known = solid[there[1:]] & solid[here[1:]]
    square = jnp.where(known, jnp.sum(jnp.square(step), axis=0), jnp.inf)
    step = jnp.where(known[None], step, 0.0)
    none = [(0, 0)] * 3
    none[axis] = (0, 1)
    ahead = jnp.pad(step, none), jnp.pad(square, none[1:], constant_values=jnp.inf)
    none[axis] = (1, 0)
    back = jnp.pad(step, none), jnp.pad(square, none[1:], constant_values=jnp.inf)
    return jnp.where((ahead[1] <= back[1])[None], ahead[0], back[0])


class CameraPath(eqx.Module):
    """Position and attitude of a camera's carrier; linear between rows.

    Attributes:
        time: Times of the rows on the common clock, rising [s].
        position: East, north, up [m].
        quaternion: Rotation from body to world (x, y, z, w), unit length.
    """

    time: Float[Array, " row"]
    position: Float[Array, "row 3"]
    quaternion: Float[Array, "row 4"]

    def at(self, time: Float[Array, ""]) -> tuple[Float[Array, "3"], Float[Array, "4"]]:
        """Return position and attitude at a time; constant outside the rows.

        Args:
            time: Time on the common clock [s].
        """
        # first and last interval serve all times outside the rows; `part` is clipped
        after = jnp.clip(jnp.searchsorted(self.time, time), 1, len(self.time) - 1)
        begin, end = self.time[after - 1], self.time[after]
        part = jnp.clip((time - begin) / (end - begin), 0.0, 1.0)
        place = (1.0 - part) * self.position[after - 1] + part * self.position[after]
        a, b = self.quaternion[after - 1], self.quaternion[after]
        # q and -q are the same rotation; the nearer one gives the shorter path
        b = jnp.where(jnp.dot(a, b) < 0.0, -b, b)
        # linear and normalised: within 0.1 degree of slerp for turns below 30 degrees
        # per row
        turn = (1.0 - part) * a + part * b
        return place, turn / jnp.sqrt(jnp.sum(jnp.square(turn)))


def carried_camera(camera: Camera, path: CameraPath, time: Float[Array, ""]) -> Camera:
    """Return a carried camera with its pose in the world at a time [s]."""
    place, turn = path.at(time)
    position = place + quaternion_matrix(turn) @ camera.position
    quaternion = quaternion_product(turn, camera.quaternion)
    return dataclasses.replace(
        camera, position=position, quaternion=quaternion, mount=""
    )


def pixels_moved(camera: Camera, path: CameraPath) -> Float[Array, " row"]:
    """Return the shift of the ground's image since the first row, an upper bound [px].

    The sum of rotation and of displacement over height, as for the ground below.
    """
    a, b = path.quaternion[:-1], path.quaternion[1:]
    # q and -q are the same attitude: the smaller distance counts
    apart = jnp.minimum(jnp.sum(jnp.square(a - b), 1), jnp.sum(jnp.square(a + b), 1))
    rotation = 4.0 * jnp.arcsin(jnp.minimum(0.5 * jnp.sqrt(apart), 1.0))
    moved = jnp.sqrt(jnp.sum(jnp.square(jnp.diff(path.position, axis=0)), axis=1))
    # at least 0.1 m: the shift of ground at the lens itself would be infinite
    height = jnp.maximum(path.position[1:, 2] + camera.position[2], 0.1)
    moved = jnp.max(camera.focal) * (rotation + moved / height)
    return jnp.concatenate([jnp.zeros_like(moved[:1]), jnp.cumsum(moved)])
