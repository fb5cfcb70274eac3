"""A place that moves."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float

from jblast.errors import InputError
from jblast.types import as_float_array


class Track(eqx.Module):
    """Where a place is over time: straight between knots, at rest before and after.

    Attributes:
        time: Of the knots, on the common clock [s], rising.
        position: East, north, up at each [m].

    Raises:
        InputError: The knots do not fit together, or times do not rise. Values inside
            jit are not looked at.
    """

    time: Float[Array, " knot"] = eqx.field(converter=as_float_array)
    position: Float[Array, "knot 3"] = eqx.field(converter=as_float_array)

    def __check_init__(self):
        knots = self.time.shape[0] if self.time.ndim == 1 else 0
        if not knots or self.position.shape != (knots, 3):
            raise InputError(
                "track: expected times [knot] and positions [knot, 3], got shapes "
                f"{self.time.shape} and {self.position.shape}"
            )
        if isinstance(self.time, Tracer) or isinstance(self.position, Tracer):
            return
        time, position = np.asarray(self.time), np.asarray(self.position)
        if not (np.isfinite(time).all() and np.isfinite(position).all()):
            raise InputError("track: expected finite times and positions, got others")
        if (np.diff(time) <= 0).any():
            raise InputError(f"track: expected rising times, got {time.tolist()}")

    def at(self, time: Float[Array, "..."]) -> Float[Array, "... 3"]:
        """Return where the place is.

        Args:
            time: On the common clock [s].
        """
        if self.time.size == 1:
            return jnp.broadcast_to(self.position[0], (*time.shape, 3))
        return jnp.stack(
            [jnp.interp(time, self.time, x) for x in self.position.T], axis=-1
        )

    def fastest(self) -> float:
        """Return the greatest speed between knots [m/s]."""
        steps = np.diff(np.asarray(self.position), axis=0)
        if not len(steps):
            return 0.0
        return float((np.linalg.norm(steps, axis=1) / np.diff(self.time)).max())
