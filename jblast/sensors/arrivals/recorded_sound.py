"""A sound of the user's in place of a pulse."""

import math

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float

from jblast.errors import InputError
from jblast.types import as_float_array


class RecordedSound(eqx.Module):
    """What was recorded of a blast at some distance, from its arrival on.

    Attributes:
        samples: Overpressure [Pa], the first from the arrival on; each a mean over its
            sample.
        rate: Samples a second [Hz].
        distance: From the charge, where it was recorded [m]. Elsewhere it is as much
            weaker or stronger as the law of the peak says, its shape kept.

    Raises:
        InputError: There is no sample, or one is no number; the rate or the distance is
            not positive.
    """

    samples: Float[Array, " sample"] = eqx.field(converter=as_float_array)
    rate: float = eqx.field(static=True, converter=float)
    distance: Float[Array, ""] = eqx.field(converter=as_float_array)

    def __check_init__(self):
        if self.samples.ndim != 1 or not self.samples.size:
            raise InputError(
                "recorded sound: expected a row of samples, got shape "
                f"{self.samples.shape}"
            )
        if not 0 < self.rate < math.inf:
            raise InputError(
                f"recorded sound: expected a positive rate, got {self.rate:g} Hz"
            )
        if isinstance(self.samples, Tracer) or isinstance(self.distance, Tracer):
            return
        if not np.isfinite(np.asarray(self.samples)).all():
            raise InputError("recorded sound: expected numbers, got NaN or infinity")
        distance = float(np.asarray(self.distance))
        if not 0 < distance < math.inf:
            raise InputError(
                f"recorded sound: expected a positive distance, got {distance:g} m"
            )

    def mean(
        self, start: Float[Array, " sample"], stop: Float[Array, " sample"]
    ) -> Float[Array, " sample"]:
        """Return the mean overpressure from start to stop since the arrival [Pa]."""
        dtype = self.samples.dtype
        edges = jnp.asarray(np.arange(self.samples.size + 1) / self.rate, dtype)
        until = jnp.pad(jnp.cumsum(self.samples) / self.rate, (1, 0))
        passed = [jnp.interp(time, edges, until) for time in (start, stop)]
        return (passed[1] - passed[0]) / (stop - start)
