"""The gusts of `vehicle.gusts` as a function of Warp, in one precision."""

from functools import cache
from types import SimpleNamespace
from typing import no_type_check

import warp as wp

from jblast.vehicle.loads.gusts import FriedlanderGust, NWaveGust, StepGust
from jblast.vehicle.warp.kernels.body import body_functions

KINDS = {type(None): 0, StepGust: 1, NWaveGust: 2, FriedlanderGust: 3}
"""How a kernel calls them; 0: still air."""

FIELDS = ("start_s", "duration_s", "decay")
"""What stands in a kernel's rows after the velocity, where a gust has it."""


@cache
@no_type_check
def gust_functions(real: type) -> SimpleNamespace:
    """Return the type and the function of a gust.

    Args:
        real: `wp.float32` or `wp.float64`.
    """
    vec3 = body_functions(real).vec3

    class Gust:
        """A row for each number, a column for each vehicle, or one for all."""

        kind: int
        rows: wp.array2d[real]

    Gust = wp.struct(Gust)

    @wp.func
    def wind_at(gust: Gust, lane: int, time: real) -> vec3:
        """Velocity of the air."""
        if gust.kind == 0:
            return vec3(real(0.0))
        n = wp.min(lane, gust.rows.shape[1] - 1)
        since = time - gust.rows[3, n]
        if since < real(0.0):
            return vec3(real(0.0))
        shape = real(1.0)
        if gust.kind > 1:
            phase = since / gust.rows[4, n]
            if gust.kind == 2:
                shape = real(1.0) - real(2.0) * phase
                if phase > real(1.0):
                    shape = real(0.0)
            else:
                shape = (real(1.0) - phase) * wp.exp(-gust.rows[5, n] * phase)
        peak = vec3(gust.rows[0, n], gust.rows[1, n], gust.rows[2, n])
        return shape * peak

    return SimpleNamespace(Gust=Gust, wind_at=wind_at)
