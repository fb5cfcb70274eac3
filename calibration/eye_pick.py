"""Records read as from a plot, for comparison with picks.

The front is the first sample above five times the rms of the first tenth of the record.
The peak is the largest sample. The positive phase ends where the pressure first falls
to zero, with linear interpolation. The impulse is by the trapezoid rule, and zero is
the mean of the first tenth. The errors of such picks grow with noise, and the rules do
not estimate them.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

EYE_QUIET_SHARE = 0.1
"""Initial share of a record from which `eye_pick` takes the noise: a convention."""
EYE_THRESHOLD = 5.0
"""Multiple of that noise at which `eye_pick` reads a front: a convention."""


class EyePick(NamedTuple):
    """Values read from a record by eye; NaN if a rule does not apply.

    Attributes:
        air_arrival_s: Time of the first sample above the threshold [s].
        peak_overpressure_pa: Largest sample from there on [Pa].
        positive_duration_s: Time from the arrival to the first zero [s].
        positive_impulse_pa_s: Integral between these by the trapezoid rule [Pa s].
    """

    air_arrival_s: float
    peak_overpressure_pa: float
    positive_duration_s: float
    positive_impulse_pa_s: float


def eye_pick(time_s: ArrayLike, pressure_pa: ArrayLike) -> EyePick:
    """Pick a record by rules.

    Args:
        time_s: Time of each sample [s].
        pressure_pa: Overpressure of one record [Pa].
    """
    time = np.asarray(time_s, float)
    pressure = np.asarray(pressure_pa, float)
    quiet = pressure[: max(2, int(EYE_QUIET_SHARE * pressure.size))]
    above = pressure - quiet.mean()
    over = np.flatnonzero(
        above > EYE_THRESHOLD * max(float(quiet.std()), 1e-12 * np.ptp(above))
    )
    if not over.size:
        return EyePick(np.nan, np.nan, np.nan, np.nan)
    first = int(over[0])
    top = first + int(np.argmax(above[first:]))
    peak = float(above[top])
    fallen = np.flatnonzero(above[top:] <= 0)
    if not fallen.size:
        return EyePick(float(time[first]), peak, np.nan, np.nan)
    last = top + int(fallen[0])
    share = above[last - 1] / (above[last - 1] - above[last])
    end = time[last - 1] + share * (time[last] - time[last - 1])
    within = np.append(above[first:last], 0.0)
    impulse = np.trapezoid(within, np.append(time[first:last], end))
    return EyePick(float(time[first]), peak, float(end - time[first]), float(impulse))
