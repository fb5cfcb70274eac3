r"""The arrival of Kingery's and Bulmash's shock: one over its speed, integrated.

From their time at their first $Z$ on; past the join along the weak-shock tail.
`waves/curves/arrival.py` says how.
"""

import math
from functools import cache, partial

from jblast.constants import STANDARD_SOUND_SPEED
from jblast.waves.curves.arrival import Arrival, Tail, chebyshev_arrival
from jblast.waves.laws.kingery_bulmash.table import kingery_bulmash_curve
from jblast.waves.laws.shock_kinematics.front import (
    JOIN,
    LOG_STANDARD_PRESSURE,
    front_mach_number,
    front_tail,
)


@cache
def shock_arrival(burst: str) -> Arrival:
    """Return the arrival of one burst, scaled: everything in m/kg^(1/3)."""
    pressure = kingery_bulmash_curve("incident_pressure", burst).segments[0]
    arrival = kingery_bulmash_curve("arrival_time", burst).segments[0]
    tail, start = front_tail(burst), math.log(pressure.z_min)
    return chebyshev_arrival(
        lambda log_z: pressure.log_value(log_z) - LOG_STANDARD_PRESSURE,
        partial(front_mach_number, burst=burst),
        start=pressure.z_min,
        start_time=STANDARD_SOUND_SPEED * math.exp(arrival.log_value(start)),
        first=pressure.z_min,
        join=JOIN,
        # Degrees by trial: each leaves less than 1e-10 of the arrival.
        degrees=(90, 50),
        tail=Tail(
            lambda log_z: tail.log_pressure(log_z) - LOG_STANDARD_PRESSURE,
            degree=18,
            log_length=math.log(tail.length),
        ),
        inner_slope=arrival.log_slope(start),
    )
