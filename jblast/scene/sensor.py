"""A sensor, and the clock that several may share, as the scene describes them."""

from collections.abc import Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from jblast.errors import InputError
from jblast.scene.instrument import Imu, Instrument
from jblast.scene.keywords import Described
from jblast.types import as_float_array

VECTORS = {
    "position_m": ("east", "north", "up"),
    "offset_m": ("forward", "left", "up"),
    "quaternion": ("x", "y", "z", "w"),
}
"""What the numbers of a sensor's vectors are."""


def _vector(value: ArrayLike | Sequence[ArrayLike]) -> Float[Array, "..."]:
    return as_float_array(jnp.asarray(value))


class Sensor(Described):
    """Where a sensor stands and what it writes down.

    Attributes:
        name: As in the observation file.
        position_m: East, north, up [m].
        kind: pressure, microphone, anemometer, geophone, flash or imu; "" if unsaid.
        clock_offset_s: Sensor clock minus common clock [s].
        records: Pairs of quantity and sigma: seconds for times, radians for directions,
            relative otherwise.
        times_s: When it takes what has a time, as radii, by its clock [s].
        instrument: What it does to the signal that it samples, if anyone said.
        imu: What it makes of the motion that it samples, if anyone said.
        mount: What carries it: "" nothing, "vehicle" the scene's vehicle. Then its
            position is NaN, as that of any sensor whose place is not said.
        offset_m: From the middle of what carries it, in the axes of its body: forward,
            left, up [m].
        quaternion: Sensor to body (x, y, z, w), scalar last.

    Raises:
        InputError: A vector has not as many numbers as it needs.
        TypeError: A keyword that no attribute has, or text in place of a number.

    Example:
        `Sensor("gate", (20.0, 0.0, 1.5), records=(("air_arrival_s", 1e-3),))`
    """

    name: str = eqx.field(static=True)
    position_m: Float[Array, "3"] = eqx.field(converter=_vector)
    kind: str = eqx.field(static=True, default="")
    clock_offset_s: Float[Array, ""] = eqx.field(converter=as_float_array, default=0.0)
    records: tuple[tuple[str, float], ...] = eqx.field(static=True, default=())
    times_s: tuple[float, ...] = eqx.field(static=True, default=())
    instrument: Instrument | None = None
    imu: Imu | None = None
    mount: str = eqx.field(static=True, default="")
    offset_m: Float[Array, "3"] = eqx.field(
        converter=_vector, default_factory=lambda: jax.device_put(np.zeros(3))
    )
    quaternion: Float[Array, "4"] = eqx.field(
        converter=_vector, default_factory=lambda: jax.device_put(np.eye(4)[3])
    )

    def __check_init__(self):
        for name, numbers in VECTORS.items():
            shape = getattr(self, name).shape
            if shape[-1:] != (len(numbers),):
                raise InputError(
                    f"sensor {self.name} {name}: expected {len(numbers)} numbers: "
                    f"{', '.join(numbers)}; got shape {shape}"
                )


class Clock(Described):
    """A clock that a log names.

    Attributes:
        name: As in the log's `clock` column.
        offset_s: This clock minus the common one [s].

    Raises:
        TypeError: A keyword that no attribute has.
    """

    name: str = eqx.field(static=True)
    offset_s: Float[Array, ""] = eqx.field(converter=as_float_array, default=0.0)
