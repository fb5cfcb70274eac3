import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.waves.wu_hao import (
    wu_hao_air_arrival_time,
    wu_hao_air_valid,
    wu_hao_ground_arrival_time,
    wu_hao_ground_valid,
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


def test_the_limit_grows_as_the_root_of_the_mass():
    mass = np.array([1.0, 100.0, 1e4])
    # 14.8, three digits
    limit = 0.34**-2.5 * np.sqrt(mass)
    np.testing.assert_allclose(limit, 14.8 * np.sqrt(mass), rtol=3e-3)
    assert wu_hao_air_valid(0.999 * limit, mass).all()
    assert not wu_hao_air_valid(1.001 * limit, mass).any()


def test_no_arrival_tells_mass_from_both_wave_speeds():
    # the null direction (1, -0.2, -0.02) in (ln Q, ln c_a, ln c_s)
    air = wu_hao_air_arrival_time(20.0, 15.0, 340.0)
    ground = wu_hao_ground_arrival_time(20.0, 15.0, 5660.0)
    np.testing.assert_allclose(
        wu_hao_air_arrival_time(20.0, 60.0, 340.0 * 4**-0.2), air, rtol=1e-13
    )
    np.testing.assert_allclose(
        wu_hao_ground_arrival_time(20.0, 60.0, 5660.0 * 4**-0.02), ground, rtol=1e-13
    )


def test_the_ground_law_has_no_value_behind_the_charge():
    assert wu_hao_ground_valid(np.array([-1.0, 0.0, 1.0])).tolist() == [
        False,
        False,
        True,
    ]
