"""Where each try of a log begins: given, in closed form, or near draws of the prior."""

import functools
from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.errors import InputError
from jblast.inference.many.lanes import gather_lanes
from jblast.inference.many.starts.nearest_prior_draw import ReferenceSet

Z = Float[Array, "free lane"]


class Starts(NamedTuple):
    """Where tries of logs begin.

    Attributes:
        given: Places by try, if the caller gives them.
        in_closed_form: Whether the first try begins where the loop itself does.
        reference_set: Draws it, once it is needed.
    """

    given: Float[Array, "try free log"] | None
    in_closed_form: bool
    reference_set: Callable[[], ReferenceSet]

    def at(
        self, which: int, measured: Float[Array, "row lane"], lanes: np.ndarray
    ) -> Z:
        """Return where some logs begin again.

        Args:
            which: The number of the try, 1 or more.
            measured: Readings of these logs.
            lanes: Which logs they are.
        """
        if self.given is not None:
            return gather_lanes(self.given[which], lanes)
        return _nearest(self.reference_set(), measured, which - self.in_closed_form)

    def first(self, measured: Float[Array, "row lane"]) -> Z | None:
        """Return where all logs begin, nothing for the closed form."""
        if self.given is not None:
            return self.given[0]
        return (
            None if self.in_closed_form else _nearest(self.reference_set(), measured, 0)
        )


@functools.partial(jax.jit, static_argnums=2)
def _nearest(references: ReferenceSet, measured, skipped: int) -> Z:
    return references.nearest(measured, skipped)


def given_starts(starts, logs: int, free: int) -> Float[Array, "try free log"]:
    """Return starts as the engine has them.

    Raises:
        InputError: They are not (log, free) or (try, log, free).
    """
    starts = jnp.asarray(starts)
    if starts.shape[-2:] != (logs, free) or starts.ndim not in (2, 3):
        raise InputError(
            f"starts: expected ({logs}, {free}), or as many for each try, "
            f"got {starts.shape}"
        )
    return jnp.moveaxis(starts.reshape(-1, logs, free), 2, 1)
