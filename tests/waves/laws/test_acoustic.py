import numpy as np

from jblast.constants import LIGHT_SPEED, STANDARD_SOUND_SPEED
from jblast.registry import law_for
from jblast.waves.laws.acoustic import acoustic_arrival_time, acoustic_valid
from jblast.waves.laws.line_of_sight import light_arrival_time, light_valid


def test_sound_takes_range_over_speed():
    assert acoustic_arrival_time(680.58, 340.29) == 2.0


def test_valid_from_a_scaled_distance_of_500():
    ranges = np.array([4999.0, 5001.0])
    assert acoustic_valid(ranges, 1000.0, 101325.0).tolist() == [False, True]


def test_thin_air_moves_the_limit_out():
    # Sachs: an eighth of the pressure doubles the length scale
    ranges = np.array([9999.0, 10001.0])
    assert acoustic_valid(ranges, 1000.0, 101325.0 / 8).tolist() == [False, True]


def test_at_the_limit_the_shock_leads_by_less_than_one_percent_and_not_far_less():
    law = law_for("air_arrival_s", "shock_kinematics")
    for burst in ("surface", "free-air"):
        shock = law.function(500.0, 1.0, 101325.0, STANDARD_SOUND_SPEED, burst=burst)
        lead = acoustic_arrival_time(500.0, STANDARD_SOUND_SPEED) / shock - 1
        assert 0.005 < lead < 0.01


def test_light_takes_range_over_the_speed_of_light():
    assert light_arrival_time(LIGHT_SPEED) == 1.0
    assert light_valid(np.array([0.0, 1.0])).tolist() == [True, True]


def test_light_is_exact():
    assert law_for("flash_time_s", "light").scatter() == (0.0, 0.0, 0.0)
