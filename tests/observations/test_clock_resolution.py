"""Times that the numbers of a clock do not resolve are refused."""

import dataclasses

import numpy as np
import pytest

from jblast.errors import InputError
from jblast.observations import observed
from jblast.observations.clocks import refuse_unresolved


def arrival_at(time: float, sigma: float):
    place = np.array([[30.0, 0.0, 0.0]])
    return observed(["a"], ["air_arrival_s"], [time], [sigma], position=place)


@pytest.mark.parametrize(
    ("time", "dtype", "refused"),
    [
        (60.0, np.float32, False),
        (3600.0, np.float32, False),
        # single precision steps over a millisecond from here on
        (16384.0, np.float32, True),
        (1.7e9, np.float32, True),
        (1.7e9, np.float64, False),
    ],
)
def test_a_time_too_coarse_for_its_sigma_is_refused(time, dtype, refused):
    log = arrival_at(time, 1e-3)
    if refused:
        with pytest.raises(InputError, match="expected times counted from near the"):
            refuse_unresolved(log, dtype)
    else:
        refuse_unresolved(log, dtype)


def test_rows_without_sigma_and_rows_of_no_clock_are_accepted():
    refuse_unresolved(arrival_at(1.7e9, np.nan), np.float32)
    pressure = dataclasses.replace(
        arrival_at(1.7e9, 1e-3), quantity=("peak_overpressure_pa",)
    )
    refuse_unresolved(pressure, np.float32)
