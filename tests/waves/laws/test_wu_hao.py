from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.errors import InputError
from jblast.waves.laws.wu_hao import (
    wu_hao_air_arrival_time,
    wu_hao_air_valid,
    wu_hao_ground_arrival_time,
    wu_hao_ground_path_arrival_time,
    wu_hao_ground_path_valid,
)


def test_the_check_case_of_the_thesis_comes_out():
    # table 4.1: 15 kg at 20 m, for intact granite; half a unit of the last digit
    np.testing.assert_allclose(
        wu_hao_ground_arrival_time(20.0, 15.0, 6000.0), 0.00314, atol=5e-6
    )
    np.testing.assert_allclose(
        wu_hao_air_arrival_time(20.0, 15.0, 340.0), 0.03857, atol=5e-6
    )


@pytest.mark.parametrize(
    ("law", "speed", "exponents"),
    [
        (wu_hao_air_arrival_time, 340.0, (1.4, -0.2, -1.0)),
        (wu_hao_ground_arrival_time, 5660.0, (1.03, -0.02, -1.0)),
    ],
)
def test_log_slopes_are_the_printed_exponents(law, speed, exponents):
    at = jnp.log(jnp.array([33.0, 7.0, speed]))
    slopes = jax.grad(lambda x: jnp.log(law(*jnp.exp(x))))(at)
    np.testing.assert_allclose(slopes, exponents, rtol=1e-12)


def test_the_air_law_ends_where_it_becomes_slower_than_sound():
    # 57.5 m for 15 kg, printed to a tenth of a metre
    ranges = np.array([57.4, 57.6])
    assert wu_hao_air_valid(ranges, 15.0).tolist() == [True, False]
    slower = wu_hao_air_arrival_time(ranges, 15.0, 340.0) > ranges / 340.0
    assert slower.tolist() == [False, True]


def test_both_laws_are_of_a_charge_on_rock_not_in_free_air():
    assert wu_hao_air_valid(20.0, 15.0, "surface")
    assert not wu_hao_air_valid(20.0, 15.0, "free-air")
    for height in (0.0, 2.0):
        for way in ("head", "thesis"):
            at = (20.0, 20.0, height, 15.0, way)
            assert wu_hao_ground_path_valid(*at, "surface")
            assert not wu_hao_ground_path_valid(*at, "free-air")


through_air = partial(wu_hao_ground_path_arrival_time, ground_path="thesis")


def _thesis_case(height):
    """15 kg at a slant range of 20 m, the sensor at a height; 340 and 6000 m/s."""
    ground_range = jnp.sqrt(20.0**2 - height**2)
    return 20.0, ground_range, height, 15.0, 340.0, 6000.0


def test_the_dual_path_explains_the_difference_the_thesis_observed():
    # table 4.1 prints 32.43 ms "observed"; the sensor was 1.558 m up (inferred)
    air = wu_hao_air_arrival_time(20.0, 15.0, 340.0)
    difference = air - through_air(*_thesis_case(1.558))
    np.testing.assert_allclose(difference, 0.03243, atol=5e-6)


def test_the_climb_is_at_the_mean_speed_of_the_air_shock():
    on_ground, up = (
        through_air(20.0, 19.0, h, 15.0, 340.0, 6000.0) for h in (0.0, 5.0)
    )
    assert on_ground == wu_hao_ground_arrival_time(19.0, 15.0, 6000.0)
    mean_speed = 20.0 / wu_hao_air_arrival_time(20.0, 15.0, 340.0)
    np.testing.assert_allclose(up - on_ground, 5.0 / mean_speed, rtol=1e-12)


def test_straight_above_the_charge_both_waves_take_the_same_time():
    # no way along the ground: up the slant range at the speed of the air shock
    up = through_air(9.0, 0.0, 9.0, 15.0, 340.0, 6000.0)
    np.testing.assert_allclose(up, wu_hao_air_arrival_time(9.0, 15.0, 340.0), 1e-13)


def test_a_buried_sensor_counts_as_on_the_ground():
    rest = (15.0, 340.0, 6000.0)
    ground = wu_hao_ground_arrival_time(20.0, 15.0, 6000.0)
    assert through_air(20.0, 20.0, -3.0, *rest) == ground
    slope = jax.grad(through_air, argnums=2)
    below, at, above = (slope(20.0, 20.0, h, *rest) for h in (-1.0, 0.0, 1.0))
    assert below == 0.0
    assert at == 0.5 * above
    np.testing.assert_allclose(
        above, wu_hao_air_arrival_time(20.0, 15.0, 340.0) / 20.0, rtol=1e-12
    )


def test_the_law_takes_the_path_of_the_ground_wave_by_name():
    place = _thesis_case(jnp.array([0.0, 1.558]))
    head, thesis = (
        wu_hao_ground_path_arrival_time(*place, ground_path=way)
        for way in ("head", "thesis")
    )
    ground = wu_hao_ground_arrival_time(place[1], 15.0, 6000.0)
    assert head.tolist() == ground.tolist()
    assert thesis[0] == head[0]
    # 1.558 m at 519 m/s, four digits
    np.testing.assert_allclose(thesis[1] - head[1], 3.004e-3, atol=5e-7)
    with pytest.raises(InputError, match="ground_path: expected 'head' or 'thesis'"):
        wu_hao_ground_path_arrival_time(*place, ground_path="air")


def test_the_climb_needs_an_air_shock_faster_than_sound():
    ranges = np.array([57.4, 57.6, 57.6])  # the limit is 57.5 m for 15 kg
    height = np.array([2.0, 2.0, 0.0])
    valid = (
        wu_hao_ground_path_valid(ranges, ranges, height, 15.0, way).tolist()
        for way in ("head", "thesis")
    )
    assert list(valid) == [[True, True, True], [True, False, True]]
