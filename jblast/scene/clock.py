"""The clock of a recorder that several sensors may share."""

import equinox as eqx
from jaxtyping import Array, Float

from jblast.types import as_float_array


class Clock(eqx.Module):
    """A clock that a log names.

    Attributes:
        name: As in the log's `clock` column.
        offset: This clock minus the common one [s].
    """

    name: str = eqx.field(static=True)
    offset: Float[Array, ""] = eqx.field(converter=as_float_array, default=0.0)
