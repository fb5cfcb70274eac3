"""What is behind a fireball: a background, made images of the camera's size."""

from collections.abc import Callable

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from jblast.errors import InputError
from jblast.scene import Camera
from jblast.types import as_float_array

BACKGROUND = 0.18
"""Linear light of a grey that looks half as bright as white."""

Background = (
    Float[ArrayLike, ""]
    | Float[ArrayLike, "3"]
    | Float[ArrayLike, "height width 3"]
    | Float[ArrayLike, "time height width 3"]
    | Callable[[Float[Array, ""]], Float[Array, "height width 3"]]
)
"""A grey, a colour, an image, an image for each time, or a function of the time that
JAX can trace, the frame source: linear light, full scale 1."""


def images(
    camera: Camera, background: Float[ArrayLike, "..."], count: int
) -> Float[Array, "..."]:
    """Return an image, or as many as there are frames.

    Args:
        camera: Who looks.
        background: No function.
        count: Of the frames.

    Raises:
        InputError: It has another shape.
    """
    size = (camera.height, camera.width, 3)
    return fitting(as_float_array(background), [size, (count, *size)], size)


def bare(
    camera: Camera, background: Float[ArrayLike, "..."], count: int
) -> Float[np.ndarray, "time height width 3"]:
    """Return frames in which nothing has exploded yet: `render`'s, at no cost.

    They are the background itself, not copies of it: to be read alone.

    Args:
        camera: Who looks.
        background: No function.
        count: Of the frames.

    Raises:
        InputError: It has another shape.
    """
    image = np.asarray(images(camera, background, count))
    return np.broadcast_to(image, (count, *image.shape[-3:]))


def fitting(
    image: Float[Array, "..."], shapes: list[tuple[int, ...]], size: tuple[int, ...]
) -> Float[Array, "..."]:
    """Return a background of one of some shapes; a colour is made an image."""
    if image.shape not in ((), (3,), *shapes):
        raise InputError(
            "background: expected a number, a colour or shape "
            f"{' or '.join(str(shape) for shape in shapes)}, got {image.shape}"
        )
    return jnp.broadcast_to(image, size) if image.ndim < 3 else image
