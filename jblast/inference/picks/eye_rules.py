"""Picks as an eye takes them from a plot: what a posterior is compared with.

The front is the first sample above a threshold, five times the rms of the first tenth
of the record; the peak is the largest sample; the positive phase ends where the
pressure first falls to zero, between two samples by a straight line; its impulse is
the trapezoid rule's. Zero is the mean of the first tenth. What such picks are off by
grows with noise, and no rule says by how much.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

QUIET_SHARE = 0.1
THRESHOLD = 5.0


class EyePick(NamedTuple):
    """What an eye takes from a record; NaN where a rule finds nothing.

    Attributes:
        air_arrival_s: First sample above the threshold [s].
        peak_overpressure_pa: Largest sample from there on [Pa].
        positive_duration_s: From the arrival to the first zero [s].
        positive_impulse_pa_s: By trapezoids between these [Pa s].
    """

    air_arrival_s: float
    peak_overpressure_pa: float
    positive_duration_s: float
    positive_impulse_pa_s: float


def eye_pick(time_s: ArrayLike, pressure_pa: ArrayLike) -> EyePick:
    """Pick a record by rules.

    Args:
        time_s: Of each sample [s].
        pressure_pa: Overpressure [Pa], one record.
    """
    time = np.asarray(time_s, float)
    pressure = np.asarray(pressure_pa, float)
    quiet = pressure[: max(2, int(QUIET_SHARE * pressure.size))]
    above = pressure - quiet.mean()
    over = np.flatnonzero(
        above > THRESHOLD * max(float(quiet.std()), 1e-12 * np.ptp(above))
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
