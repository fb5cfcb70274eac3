"""A small camera before a fireball, for the tests of its picture."""

from typing import Any

import jax.numpy as jnp
import numpy as np

from jblast.scene import Camera, Charge, Scene, look_at
from jblast.sensors.camera.fireball import Appearance

EYE = np.array([3.0, -60.0, 4.0])
TARGET = np.array([1.0, 2.0, 5.0])
LUMPS = float(Appearance().lumps)


def small_camera(
    position: Any = EYE,
    target: Any = TARGET,
    width: int = 24,
    height: int = 18,
    **changed: Any,
) -> Camera:
    position, target = np.array(position, float), np.array(target, float)
    numbers: dict[str, Any] = {
        "position": position,
        "quaternion": look_at(position, target),
        "focal": [40.0, 41.0],
        "center": [11.5, 8.0],
        "distortion": np.zeros(5),
    }
    numbers = {name: jnp.asarray(v, float) for name, v in (numbers | changed).items()}
    return Camera(**numbers, width=width, height=height)


def one_charge(
    mass: Any = 100.0, east: Any = 0.0, up: Any = 2.0, **changed: Any
) -> Scene:
    return Scene(Charge(mass_kg=mass, position_m=(east, 0.0, up), **changed))
