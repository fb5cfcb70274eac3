"""Instruments of a vehicle: what each reads, and what it adds to that."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.constants import FLIGHT_GRAVITY
from jblast.scene import Charge, Imu, Scene, VehicleSpec
from jblast.sensors.flight_sensors import (
    DIPOLE_GAUSS,
    MOST_PA,
    Barometer,
    Biases,
    Magnetometer,
    blast_overpressure,
    dipole_field,
    drawn_biases,
    felt_between,
    field_read,
    height_of,
    lagging,
    pressure_at,
    sampled,
    walked,
)
from jblast.vehicle import State, blast_load

GROUND = (jnp.asarray(101_325.0), jnp.asarray(288.15))

PRINTED = {500.0: 95_460.8, 1000.0: 89_874.6, 5000.0: 54_019.9}
"""Pressures of the standard atmosphere by geopotential height, US 1976, table I."""


@pytest.mark.parametrize("height", PRINTED)
def test_pressures_are_those_printed_of_the_standard_atmosphere(height):
    found = pressure_at(jnp.asarray(height), *GROUND)
    # six digits are printed
    assert float(found) == pytest.approx(PRINTED[height], rel=2e-6)
    assert float(height_of(found, *GROUND)) == pytest.approx(height, abs=1e-6)


def test_it_comes_to_a_new_pressure_by_its_lag():
    lag = jnp.asarray(0.02)
    at_first = jnp.asarray(100_000.0)
    after = lagging(at_first, jnp.full(8, 101_000.0), lag, lag)
    assert float(after) == pytest.approx(101_000 - 1000 * np.exp(-1), abs=1e-6)


def test_it_says_no_more_than_it_can():
    lag = jnp.asarray(1e-4)
    told = lagging(jnp.asarray(1e5), jnp.full(8, 5e5), lag, jnp.asarray(0.004))
    assert float(told) == MOST_PA


def test_a_blast_comes_on_top_as_its_wave_has_it():
    vehicle = VehicleSpec("iris", position=jnp.array([20.0, 0.0, 2.0]))
    charge = Charge(5.0, position_m=(0.0, 0.0, 0.0), time_s=1.0)
    never = Charge(5.0, position_m=(1.0, 0.0, 0.0), time_s=jnp.inf, name="n")
    scene = Scene(charge, others=(never,), vehicle=vehicle)
    load, place = blast_load(scene), vehicle.position
    came = load.arrival_time_s(place)[0]
    wave = load.wave_of(load.blasts[0], place)
    peak = blast_overpressure(load, came + 1e-9, place)
    assert float(peak) == pytest.approx(float(wave.peak) * 101_325, rel=1e-5)
    assert float(blast_overpressure(load, came - 1e-6, place)) == 0
    sucked = came + wave.duration_s + wave.suction_s / 3
    low = blast_overpressure(load, sucked, place)
    assert float(low) == pytest.approx(-float(wave.suction) * 101_325, rel=1e-6)


def test_a_rate_of_nothing_is_refused():
    with pytest.raises(ValueError, match="rate: expected a positive rate, got 0 Hz"):
        Barometer(rate=0.0)


PERIOD = jnp.asarray(0.004)
NONE = Biases(jnp.zeros(3), jnp.zeros(3))
TURN_90 = jnp.array([0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)])


def state(velocity=(0.0, 0.0, 0.0), quaternion=(0.0, 0.0, 0.0, 1.0)) -> State:
    return State(
        jnp.zeros(3),
        jnp.array(velocity),
        jnp.array(quaternion),
        jnp.zeros(3),
        jnp.zeros(4),
    )


def test_at_rest_it_feels_the_ground_push_up():
    force, rate = felt_between(state(), state(), PERIOD)
    np.testing.assert_allclose(force, [0, 0, FLIGHT_GRAVITY], atol=1e-15)
    np.testing.assert_array_equal(rate, 0)


def test_a_push_within_a_sample_is_felt_whole_along_the_bodys_axes():
    # body x looks north after a quarter turn, body y west
    before, now = state(quaternion=TURN_90), state((0.4, 0.0, 0.0), TURN_90)
    force, _ = felt_between(before, now, PERIOD)
    np.testing.assert_allclose(force, [0, -100.0, FLIGHT_GRAVITY], atol=1e-12)


def test_its_rate_turns_one_attitude_into_the_next():
    angle = 0.01
    turned = (0.0, 0.0, np.sin(angle / 2), np.cos(angle / 2))
    _, rate = felt_between(state(), state(quaternion=turned), PERIOD)
    np.testing.assert_allclose(rate, [0, 0, angle / 0.004], rtol=1e-12, atol=1e-12)


def test_white_noise_has_its_density_by_allans_deviation():
    imu = Imu(rate=250.0, bits=None)
    noise = jax.random.normal(jax.random.key(3), (50_000, 6))
    at_rest = (jnp.zeros(3), jnp.zeros(3))
    force, rate = jax.vmap(lambda six: sampled(six, imu, NONE, at_rest))(noise)
    for values, density in (
        (force, imu.accelerometer_noise),
        (rate, imu.gyroscope_noise),
    ):
        # at tau = 1 s, of a one-sided density N: N / sqrt(2 tau)
        means = np.asarray(values).reshape(-1, 250, 3).mean(axis=1)
        allan = np.sqrt(np.mean(np.diff(means, axis=0) ** 2) / 2)
        # 199 differences of three axes: 4 % is one standard error
        assert allan == pytest.approx(float(density) / np.sqrt(2), rel=0.16)


def test_what_it_is_off_by_is_drawn_and_walks_as_said():
    imu = Imu(rate=250.0)
    keys = jax.random.split(jax.random.key(5), 4000)
    drawn = jax.vmap(lambda key: drawn_biases(key, imu, 0.1))(keys)
    assert np.std(drawn.rate) == pytest.approx(
        0.1 * float(imu.gyroscope_bias), rel=0.03
    )
    noise = jax.random.normal(jax.random.key(6), (4000, 6))
    gone = jax.vmap(lambda six: walked(six, imu, NONE, jnp.asarray(4.0)))(noise)
    # in four seconds twice as far as in one
    assert np.std(gone.force) == pytest.approx(
        2 * float(imu.accelerometer_walk), rel=0.03
    )


def test_beyond_its_range_it_says_its_range():
    imu = Imu(rate=250.0)
    hit = (jnp.array([1e4, -1e4, 0.0]), jnp.zeros(3))
    force, _ = sampled(jnp.zeros(6), imu, NONE, hit)
    most = float(imu.accelerometer_range)
    np.testing.assert_allclose(force[:2], [most, -most])


def test_at_the_geomagnetic_pole_the_field_points_down_with_twice_its_moment():
    # the pole of 2025 as the British Geological Survey prints it: 80.8 N, 72.8 W
    east, north, up = dipole_field(80.8, -72.8)
    moment = float(np.linalg.norm(DIPOLE_GAUSS))
    assert up == pytest.approx(-2 * moment, rel=1e-5)
    # a tenth of a degree of latitude is all that is printed
    assert np.hypot(east, north) < 2 * moment * np.radians(0.1)


def test_across_from_the_pole_it_points_north_with_its_moment():
    found = dipole_field(80.8 - 90.0, -72.8)
    moment = float(np.linalg.norm(DIPOLE_GAUSS))
    np.testing.assert_allclose(found, [0, moment, 0], atol=2e-3 * moment)


def test_it_reads_the_field_along_the_bodys_axes_and_noise_of_its_size():
    magnetometer = Magnetometer(jnp.array([0.0, 0.2, -0.4]))
    quarter = jnp.array([0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)])  # ahead is north
    noise = jax.random.normal(jax.random.key(1), (20_000, 3))
    read = jax.vmap(lambda three: field_read(three, magnetometer, quarter))(noise)
    # one standard error is 0.00006 gauss
    np.testing.assert_allclose(np.mean(read, axis=0), [0.2, 0.0, -0.4], atol=3e-4)
    assert np.std(np.asarray(read)[:, 1]) == pytest.approx(
        float(magnetometer.noise), rel=0.02
    )
