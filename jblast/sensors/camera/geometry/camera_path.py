"""A camera that is carried: where it is at each time, and its rays then."""

import dataclasses

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.scene.camera import Camera, quaternion_matrix, quaternion_product
from jblast.sensors.camera.geometry.pixel_rays import Rays, pixel_rays


class CameraPath(eqx.Module):
    """Where what carries a camera is, and how it is turned; between rows linear.

    Attributes:
        time: Of the rows, on the common clock, rising [s].
        position: East, north, up [m].
        quaternion: Body to world (x, y, z, w), of length one.
    """

    time: Float[Array, " row"]
    position: Float[Array, "row 3"]
    quaternion: Float[Array, "row 4"]

    def at(self, time: Float[Array, ""]) -> tuple[Float[Array, "3"], Float[Array, "4"]]:
        """Return place and turn at a time; before and after the rows, those of the end.

        Args:
            time: On the common clock [s].
        """
        after = jnp.clip(jnp.searchsorted(self.time, time), 1, len(self.time) - 1)
        begin, end = self.time[after - 1], self.time[after]
        part = jnp.clip((time - begin) / (end - begin), 0.0, 1.0)
        place = (1.0 - part) * self.position[after - 1] + part * self.position[after]
        a, b = self.quaternion[after - 1], self.quaternion[after]
        b = jnp.where(jnp.dot(a, b) < 0.0, -b, b)  # the same turn, the shorter way
        turn = (1.0 - part) * a + part * b
        return place, turn / jnp.sqrt(jnp.sum(jnp.square(turn)))


def carried_camera(camera: Camera, path: CameraPath, time: Float[Array, ""]) -> Camera:
    """Return a camera on a body as it stands in the world at a time [s]."""
    place, turn = path.at(time)
    position = place + quaternion_matrix(turn) @ camera.position
    quaternion = quaternion_product(turn, camera.quaternion)
    return dataclasses.replace(
        camera, position=position, quaternion=quaternion, mount=""
    )


@eqx.filter_jit
def camera_rays(camera: Camera, supersample: int) -> Rays:
    """Return the rays of a lens in the camera's own axes; nothing ends them."""
    zero = jnp.zeros_like(camera.position)
    ahead = jnp.zeros_like(camera.quaternion).at[3].set(1.0)
    lens = dataclasses.replace(camera, position=zero, quaternion=ahead)
    return pixel_rays(lens, supersample=supersample, ground=False)


def turned_rays(rays: Rays, camera: Camera) -> Rays:
    """Return rays of a lens for a camera in the world; they end at the plane up = 0.

    Args:
        rays: As `camera_rays` returns them.
        camera: Where the camera is, and how it is turned.
    """
    matrix = quaternion_matrix(camera.quaternion)
    x, y, z = rays.direction
    direction = jnp.stack([row[0] * x + row[1] * y + row[2] * z for row in matrix])
    down = direction[2] < 0.0
    hit = -camera.position[2] / jnp.where(down, direction[2], -1.0)
    farthest = jnp.where(down, jnp.minimum(rays.farthest, hit), rays.farthest)
    return Rays(camera.position, direction, farthest)


def pixels_moved(camera: Camera, path: CameraPath) -> Float[Array, " row"]:
    """Return how far the picture of the ground has moved since the first row [px].

    At most: by turns, and by the way over the height, as of the ground below.
    """
    a, b = path.quaternion[:-1], path.quaternion[1:]
    # between unit quaternions q and -q, which turn alike
    apart = jnp.minimum(jnp.sum(jnp.square(a - b), 1), jnp.sum(jnp.square(a + b), 1))
    turned = 4.0 * jnp.arcsin(jnp.minimum(0.5 * jnp.sqrt(apart), 1.0))
    way = jnp.sqrt(jnp.sum(jnp.square(jnp.diff(path.position, axis=0)), axis=1))
    height = jnp.maximum(path.position[1:, 2] + camera.position[2], 0.1)
    moved = jnp.max(camera.focal) * (turned + way / height)
    return jnp.concatenate([jnp.zeros_like(moved[:1]), jnp.cumsum(moved)])
