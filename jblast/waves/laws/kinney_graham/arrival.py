r"""The arrival of Kinney's and Graham's shock: one over its speed, integrated.

$$c_0 t(Z) = \int_{r_c}^{Z} dz / M(z), \qquad r_c = 0.053 \text{ m for 1 kg}$$

from the surface of the charge, where the time is zero. How: `waves/curves/arrival.py`.
"""

import math
from functools import cache

import numpy as np

from jblast.waves.curves.arrival import Arrival, Tail, chebyshev_arrival
from jblast.waves.laws.kinney_graham.curves import (
    RELATIVE_PRESSURE,
    kinney_graham_mach_number,
)

CHARGE_RADIUS = 0.053
"""Radius of 1 kg of TNT (1600 kg/m3) [m/kg^(1/3)], where Kinney's and Graham's arrival
starts, as we remember it.
"""

FIRST = 0.06
"""Where the integral is first used [m/kg^(1/3)]: at the surface the arrival is zero.

Its logarithm has no slope there; before this place it is a power law.
"""


@cache
def kinney_graham_arrival() -> Arrival:
    """Return the arrival, scaled: everything in m/kg^(1/3)."""
    return chebyshev_arrival(
        _log_relative_pressure,
        kinney_graham_mach_number,
        start=CHARGE_RADIUS,
        start_time=0.0,
        first=FIRST,
        join=10.0,
        # Degrees by trial: each leaves less than 1e-11 of the arrival.
        degrees=(80, 50),
        tail=Tail(_log_relative_pressure, degree=30),
    )


def _log_relative_pressure(log_z: np.ndarray) -> np.ndarray:
    """Return ln(p/P0): NumPy's twin of the curve."""
    value = np.full_like(log_z, math.log(RELATIVE_PRESSURE.factor))
    for z, power, share in RELATIVE_PRESSURE.breaks:
        value += share * np.logaddexp(0.0, power * (log_z - math.log(z)))
    return value
