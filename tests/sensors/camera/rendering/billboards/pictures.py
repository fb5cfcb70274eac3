"""Pictures of a blob from all around, and a camera that looks at it."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import ArrayLike

from jblast.scene import (
    Camera,
    Charge,
    Scene,
    look_at,
    matrix_quaternion,
    quaternion_matrix,
)
from jblast.sensors.camera.billboards import Views
from jblast.sensors.camera.fireball import Appearance
from jblast.sensors.camera.geometry import pixel_rays
from jblast.sensors.camera.image import straight

BURST = np.array([3.0, 40.0, 2.0])
SCALE = 0.1
MASS = 15.0


def made(kind, entries):
    """Make arrays of lists first."""
    return kind(
        **{k: np.asarray(v) if isinstance(v, list) else v for k, v in entries.items()}
    )


def camera(**changed) -> Camera:
    """Rolled, off its axis and with distortion: nothing cancels."""
    aimed = quaternion_matrix(
        look_at(np.array([0.0, 0.0, 1.5]), np.array([2.0, 40.0, 4.0]))
    )
    roll = np.array([[0.8, -0.6, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]])
    entries = {
        "position": [0.0, 0.0, 1.5],
        "quaternion": matrix_quaternion(aimed @ roll),
        "focal": [150.0, 140.0],
        "center": [31.0, 24.0],
        "width": 64,
        "height": 48,
        "distortion": [-0.1, 0.05, 0.002, -0.001, 0.0],
    }
    return made(Camera, entries | changed)


def blob(size: int = 41) -> np.ndarray:
    """A soft round cloud, bright at its right."""
    y, x = np.mgrid[:size, :size] - (size - 1) / 2
    alpha = np.exp(-(x**2 + y**2) / (size / 5) ** 2)
    red = 0.5 + x / size
    return np.rint(255 * np.stack([red, 0.5 * red, 0 * red, alpha], axis=-1))


def views_of(*frames, **changed) -> Views:
    frames = np.stack(frames or (blob(), blob())).astype(np.uint8)
    entries = {
        "frames": jnp.asarray(frames[None]),
        "direction": [[0.0, -1.0, 0.0]],
        "up": [[0.0, 0.0, 1.0]],
        "metres_per_pixel": [SCALE],
        "anchor": [[(frames.shape[2] - 1) / 2, (frames.shape[1] - 1) / 2]],
        "frames_hz": 10.0,
        "charge_mass": MASS,
        "srgb": False,
    }
    return made(Views, entries | changed)


def scene_of(burst=BURST, mass=MASS, **charge) -> Scene:
    east, north, up = burst
    return Scene(Charge(mass_kg=mass, position_m=(east, north, up), **charge))


def layer(views, scene, camera, time=0.0, depth: ArrayLike = jnp.inf, ground=False):
    """Return straight alpha, channels last."""
    depth = jnp.broadcast_to(depth, (48, 64))
    return _layer(views, scene, camera, jnp.asarray(time), depth, ground)


@eqx.filter_jit
def _layer(views, scene, camera, time, depth, ground):
    rays = pixel_rays(camera, depth, ground=ground)
    seen = views.seen(scene, rays, time, Appearance())
    return straight(jnp.moveaxis(seen, 0, -1))
