"""What a blast did to a flight, against flights made by hand."""

import numpy as np

from jblast.vehicle import Trajectory
from jblast.vehicle.metrics import flight_metrics
from tests.vehicle.flights import by_hand

TARGET = np.array([1.0, 0.0, 5.0])


def flight(east, *, up=None, speed=0.0, **parts) -> Trajectory:
    """A flight with a row each 0.5 s, so far east of its target."""
    east = np.asarray(east, float)
    position = np.zeros((*east.shape, 3))
    position[..., 0] = TARGET[0] + east
    position[..., 2] = TARGET[2] if up is None else up
    velocity = np.zeros_like(position)
    velocity[..., 1] = speed
    times = 0.5 * np.arange(east.shape[-1])
    return by_hand(times, position, velocity_m_s=velocity, **parts)


def test_errors_before_and_after_are_root_mean_squares():
    found = flight_metrics(flight([0.03, 0.04, 0.3, 0.4, 0.0]), TARGET, 1.0)
    np.testing.assert_allclose(found.error_before_m, np.sqrt((9 + 16) / 2) / 100)
    np.testing.assert_allclose(found.error_after_m, np.sqrt((9 + 16) / 3) / 10)


def test_peak_is_the_greatest_after_the_blast_not_before():
    found = flight_metrics(flight([9.0, 0.0, 0.3, -0.4, 0.0]), TARGET, 0.75)
    np.testing.assert_allclose(found.peak_deviation_m, 0.4)
    np.testing.assert_allclose(found.peak_time_s, 1.5 - 0.75)


def test_recovery_is_the_last_way_in_between_rows():
    """Inside at 1.5 s, out again at 2.0, and for good halfway from there to 2.5."""
    east = [0.0, 0.0, 0.3, 0.02, 0.08, 0.02, 0.0, 0.0]
    found = flight_metrics(flight(east), TARGET, 0.6, tolerance_m=0.05)
    np.testing.assert_allclose(found.recovery_time_s, 2.25 - 0.6)


def test_recovery_is_zero_if_it_never_leaves_and_infinite_if_it_ends_outside():
    never = flight_metrics(flight([0.0, 0.01, 0.02]), TARGET, 0.5)
    assert never.recovery_time_s == 0
    outside = flight_metrics(flight([0.0, 0.01, 0.2]), TARGET, 0.5)
    assert outside.recovery_time_s == np.inf
    assert not outside.settled


def test_without_rows_after_the_blast_there_is_nothing_to_say():
    found = flight_metrics(flight([0.0, 0.3, 0.0]), TARGET, 9.0)
    for value in (found.error_after_m, found.peak_deviation_m, found.recovery_time_s):
        assert np.isnan(value)
    assert np.isnan(flight_metrics(flight([0.1]), TARGET, 0.0).error_before_m)


def test_settled_needs_place_and_rest_over_the_whole_end():
    still = [0.3, 0.3, 0.0, 0.0, 0.0]
    assert flight_metrics(flight(still), TARGET, 0.0, rest_s=1.0).settled
    assert not flight_metrics(flight(still), TARGET, 0.0, rest_s=1.5).settled
    assert not flight_metrics(flight(still, speed=0.2), TARGET, 0.0).settled


def test_ground_and_turning_over_are_crashes():
    up = np.array([5.0, 2.0, 0.0])
    assert flight_metrics(
        flight([0.0] * 3, up=up), TARGET, 0.0, ground_up_m=0.0
    ).crashed
    assert not flight_metrics(flight([0.0] * 3, up=up), TARGET, 0.0).crashed
    # a start from the ground is none
    rise = flight([0.0] * 3, up=up[::-1].copy())
    assert not flight_metrics(rise, TARGET, 0.0, ground_up_m=0.0).crashed
    for degrees, crashed in ((80.0, False), (100.0, True)):
        half = np.radians(degrees / 2)
        tilted = np.array([[0, 0, 0, 1.0], [np.sin(half), 0, 0, np.cos(half)]])
        found = flight_metrics(flight([0.0, 0.0], quaternion=tilted), TARGET, 0.0)
        assert bool(found.crashed) == crashed


def test_what_stands_on_the_ground_is_not_crashed_by_a_rocking():
    """Higher than the tolerance it has flown, and may fall."""
    for height, crashed in ((1e-4, False), (0.2, True)):
        up = np.array([0.0, height, 0.0])
        found = flight_metrics(flight([0.0] * 3, up=up), TARGET, 0.0, ground_up_m=0.0)
        assert bool(found.crashed) == crashed
    low = np.array([1e-4, 0.0, 0.0])  # in the air at the start
    found = flight_metrics(flight([0.0] * 3, up=low), TARGET, 0.0, ground_up_m=0.0)
    assert found.crashed


def test_a_target_may_move_row_by_row():
    path = np.tile(TARGET, (3, 1)) + np.array([[0.0, 0, 0], [1.0, 0, 0], [2.0, 0, 0]])
    found = flight_metrics(flight([0.0, 1.0, 2.5]), path, 0.0)
    np.testing.assert_allclose(found.peak_deviation_m, 0.5)


def test_a_lost_lane_keeps_its_rows_never_recovers_and_leaves_the_others_alone():
    nan = np.nan
    east = np.array([[0.0, 0.3, nan, nan], [0.0, 0.3, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0]])
    rows = flight(east, lost=np.array([True, False, False]))
    found = flight_metrics(rows, TARGET, np.array([0.5, 0.5, 0.5]))
    np.testing.assert_allclose(found.peak_deviation_m, [0.3, 0.3, 0.0])
    np.testing.assert_allclose(found.error_after_m, [0.3, np.sqrt(0.03), 0.0])
    np.testing.assert_array_equal(found.crashed, [True, False, False])
    np.testing.assert_array_equal(found.settled, [False, True, True])
    assert found.recovery_time_s[0] == np.inf
    np.testing.assert_allclose(found.recovery_time_s[1:], [0.5 * 0.25 / 0.3, 0.0])
