"""32 waypoints through three blasts, by all three vehicles, to the end."""

import math

import pytest

from calibration.missions import VEHICLES, campus_plan, charges, passes, through
from jblast.missions import mission_of, write_plan


@pytest.fixture(scope="module")
def campus(tmp_path_factory):
    plan = campus_plan()
    file = tmp_path_factory.mktemp("campus") / "campus.plan"
    write_plan(plan, file)
    return file, charges(passes(mission_of(plan), "iris"))


def test_the_plan_has_32_waypoints_that_can_be_flown():
    mission = mission_of(campus_plan())
    assert len(mission.plan.items) == 32
    assert mission.stops[-1].lands


@pytest.mark.slow
@pytest.mark.parametrize("model", VEHICLES)
def test_a_campus_is_flown_unattended_through_three_blasts(campus, model):
    file, blasts = campus
    flight = through(file, model, blasts)
    assert flight.completed
    assert math.isfinite(flight.disarmed_s)
    assert [one.reached for one in flight.waypoints] == [True] * 32
    # each of them between the waypoints where the thesis had its own
    numbers = [
        flight.waypoints[one.waypoint].item.number for one in flight.disturbances
    ]
    assert numbers == [5, 19, 32]
    for one in flight.disturbances:
        assert one.peak_deviation_m > 2 * one.error_before_m
        assert math.isfinite(one.recovery_time_s)
