"""The camera: where it stands, where it points, what its lens and its sensor do."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float

from jblast.errors import InputError, shown
from jblast.types import as_float_array, as_optional_float_array

FRAMES_HZ = 1000.0
"""Frames in a second where nothing else is said."""

POSITIVE = ("focal", "frames_hz", "threshold")
MOUNTS = ("vehicle",)
"""What may carry a camera."""

FORWARD = (-0.5, 0.5, -0.5, 0.5)
"""Quaternion from the camera's axes to those of a body that it looks forward from."""

NUMBERS = ("position", "quaternion", "center", "distortion", "exposure_s", *POSITIVE)


class Camera(eqx.Module):
    """A pinhole camera with radial-tangential distortion, as OpenCV has it.

    World axes are east, north, up; camera axes are x right, y down, z into the scene.
    The centre of a pixel has whole numbers for coordinates, that of the first (0, 0).

    Attributes:
        position: East, north, up [m].
        quaternion: Camera to world (x, y, z, w), scalar last; its length is ignored.
        focal: Focal lengths along x and y [px].
        center: Principal point (x, y) [px].
        width: Of the image [px].
        height: Of the image [px].
        distortion: k1, k2, p1, p2, k3 [-], in OpenCV's order.
        frames_hz: Frames in a second [1/s].
        exposure_s: How long a frame gathers light [s]; 0 is an instant.
        threshold: Steps of log intensity that make an event: brighter, darker; both
            positive [-].
        daylight: Light of sky and sun on the ground that pictures are exposed for
            [lx]; None: full sun.
        mount: What carries it: "" nothing, "vehicle" the scene's vehicle. Then place
            and quaternion are those in the axes of its body (forward, left, up).

    Raises:
        InputError: A size is below one, a number not finite, a focal length, frame rate
            or threshold not positive, an exposure negative, or the quaternion zero.
            Inside jit numbers are not looked at.
    """

    position: Float[Array, "3"] = eqx.field(converter=as_float_array)
    quaternion: Float[Array, "4"] = eqx.field(converter=as_float_array)
    focal: Float[Array, "2"] = eqx.field(converter=as_float_array)
    center: Float[Array, "2"] = eqx.field(converter=as_float_array)
    width: int = eqx.field(static=True)
    height: int = eqx.field(static=True)
    distortion: Float[Array, "5"] = eqx.field(
        converter=as_float_array, default_factory=lambda: jnp.zeros(5)
    )
    frames_hz: Float[Array, ""] = eqx.field(converter=as_float_array, default=FRAMES_HZ)
    exposure_s: Float[Array, ""] = eqx.field(converter=as_float_array, default=0.0)
    threshold: Float[Array, "2"] = eqx.field(
        converter=as_float_array, default_factory=lambda: jnp.full(2, 0.2)
    )
    daylight: Float[Array, ""] | None = eqx.field(
        converter=as_optional_float_array, default=None
    )
    mount: str = eqx.field(static=True, default="")

    def __check_init__(self):
        for name in ("width", "height"):
            if getattr(self, name) < 1:
                raise InputError(
                    f"camera {name}: expected at least 1 px, "
                    f"got {shown(getattr(self, name))}"
                )
        for name in NUMBERS:
            value = getattr(self, name)
            if isinstance(value, Tracer):
                continue
            number = np.asarray(value)  # what JAX computes inside jit is traced
            if not np.isfinite(number).all():
                raise _refused(name, "finite numbers", value)
            if name in POSITIVE and not (number > 0).all():
                raise _refused(name, "positive numbers", value)
            if name == "quaternion" and not (number != 0).any():
                raise _refused(name, "one that is not zero", value)
            if name == "exposure_s" and number < 0:
                raise _refused(name, "zero or more", value)


def _refused(name: str, expected: str, value: Array) -> InputError:
    return InputError(
        f"camera {name}: expected {expected}, got {shown(value.tolist())}"
    )
