r"""Beyond the grid: the weak-shock law that leaves the solver's last point.

$$\frac{p}{P_0} = \frac{A}{\lambda\sqrt{\ln(\lambda/b)}}$$

(`weak_shock.py`) with $b$ from the slope and $A$ from the value there. Joined at
$\lambda = 100$ it is 0.02 % below the exact point source at 228, 0.10 % at 664, 0.21 %
at 2359 (Z = 8150), 0.37 % at 1e4 and 0.8 % at a million: the slope there still lacks
some of its limit. `python -m calibration.point_source` prints it.
"""

import math

from jblast.errors import InputError
from jblast.waves.weak_shock import WeakShockTail


def far_field(scaled: float, overpressure_ratio: float, slope: float) -> WeakShockTail:
    r"""Return the tail that goes on from a point of the decay, in units of $P_0$.

    Args:
        scaled: $\lambda = R\,(P_0/E)^{1/3}$ there [-].
        overpressure_ratio: $p/P_0$ there [-].
        slope: $d\ln p/d\ln\lambda$ there [-].

    Raises:
        InputError: The decay there is flatter than 1/R, which no tail is.
    """
    if not slope < -1.0:
        raise InputError(f"slope: expected one steeper than -1, got {slope:g}")
    log_reach = -0.5 / (slope + 1.0)
    return WeakShockTail(
        join=scaled,
        amplitude=overpressure_ratio * scaled * math.sqrt(log_reach),
        length=scaled * math.exp(-log_reach),
    )
