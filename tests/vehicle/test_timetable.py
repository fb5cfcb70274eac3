import numpy as np

from jblast.vehicle.rollout import timetable


def test_the_clock_of_a_flight_in_single_precision_does_not_drift():
    step, until = 5e-4, 60.0
    start = timetable(until, step, step, np.dtype(np.float32)).start
    exact = np.arange(round(until / step) + 1) * step
    late = np.abs(np.asarray(start, float) - exact[: start.size])
    # half a spacing of float32 below 64 s; a sum of steps would be 0.02 s off
    assert late.max() <= np.spacing(np.float32(59.0)) / 2
