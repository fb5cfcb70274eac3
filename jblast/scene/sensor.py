"""A sensor as the scene describes it: plain data."""

import equinox as eqx
from jaxtyping import Array, Float

from jblast.scene.instrument import Instrument
from jblast.types import as_float_array


class Sensor(eqx.Module):
    """Where a sensor stands and what it writes down.

    Attributes:
        name: As in the observation file.
        kind: pressure, microphone, anemometer, geophone, flash or imu; "" if unsaid.
        position: East, north, up [m].
        clock_offset: Sensor clock minus common clock [s].
        records: Pairs of quantity and sigma: seconds for times, radians for directions,
            relative otherwise.
        times: When it takes what has a time, as radii, by its clock [s].
        instrument: What it does to the signal that it samples, if anyone said.
    """

    name: str = eqx.field(static=True)
    position: Float[Array, "3"] = eqx.field(converter=as_float_array)
    kind: str = eqx.field(static=True, default="")
    clock_offset: Float[Array, ""] = eqx.field(converter=as_float_array, default=0.0)
    records: tuple[tuple[str, float], ...] = eqx.field(static=True, default=())
    times: tuple[float, ...] = eqx.field(static=True, default=())
    instrument: Instrument | None = None
