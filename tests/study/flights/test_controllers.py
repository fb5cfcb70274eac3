"""Which controllers a vehicle is flown with."""

import math

import numpy as np
import pytest

from jblast.errors import InputError
from jblast.report.flights import fly_answer
from jblast.report.view import terminal
from jblast.study.flights import fly, named_controllers
from tests.study.flights.scenes import scene


@pytest.mark.parametrize(
    ("asked", "own", "flown"),
    [
        (None, None, ("with_integral", "without_integral")),
        (None, "without_integral", ("without_integral", "with_integral")),
        (("cascade", "hold"), None, ("cascade", "with_integral")),
        (("hold", "cascade"), "without_integral", ("without_integral", "cascade")),
        (("hold", "with_integral"), None, ("with_integral",)),
    ],
)
def test_the_hold_is_the_scenes_own_and_each_is_flown_once(asked, own, flown):
    assert named_controllers(asked, own) == flown


def test_one_that_is_none_ends_it_with_the_nearest_before_any_flies():
    with pytest.raises(InputError, match=r"'cascad': expected one of .*cascade"):
        fly(scene(), controllers=("hold", "cascad"))
    with pytest.raises(InputError, match="expected one or more, got none"):
        fly(scene(), controllers=())


@pytest.mark.slow  # a program for each
def test_all_fly_through_the_same_blast():
    flights = fly(
        scene(),
        seconds=6.0,
        step_s=2e-3,
        controllers=("hold", "cascade", "without_integral"),
    )
    assert tuple(flights.holds) == ("with_integral", "cascade", "without_integral")
    held = flights.holds.values()
    arrivals = {float(np.min(f.encounter.arrival_s)) for f in held}
    assert len(arrivals) == 1
    peaks = [float(f.metrics.peak_deviation_m) for f in held]
    assert all(0 < peak < math.inf for peak in peaks)
    assert len(set(peaks)) == 3
    words = terminal(fly_answer(flights).view)
    assert "by a cascade as PX4's" in words
