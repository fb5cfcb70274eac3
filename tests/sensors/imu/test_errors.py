"""What an IMU adds: its level of noise, its bias, the end of its range."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.scene import Imu
from jblast.sensors.imu import Felt, read

NOTHING = Felt(jnp.zeros((4000, 3)), jnp.zeros((4000, 3)))
STILL = {
    "accelerometer_bias": 0.0,
    "gyroscope_bias": 0.0,
    "accelerometer_walk": 0.0,
    "gyroscope_walk": 0.0,
}


def test_white_noise_has_half_the_rate_of_its_density():
    imu = Imu(rate=800.0, bits=None, **STILL)
    got = read(jax.random.key(1), imu, NOTHING)
    for column, density in (
        (got.force, imu.accelerometer_noise),
        (got.rate, imu.gyroscope_noise),
    ):
        # 12,000 numbers tell an sd to 0.65 %: four of that
        wanted = float(density) * np.sqrt(400.0)
        assert float(jnp.std(column)) == pytest.approx(wanted, rel=0.026)


def test_bias_stays_and_walks_by_the_root_of_time():
    quiet = {"accelerometer_noise": 0.0, "gyroscope_noise": 0.0}
    walks = STILL | {"accelerometer_walk": 0.5}
    imu = Imu(rate=100.0, bits=None, **(quiet | walks))
    ends = [read(jax.random.key(n), imu, NOTHING).force[-1] for n in range(60)]
    # 40 s; 180 numbers tell an sd to 5 %: four of that
    wanted = 0.5 * np.sqrt(40.0)
    assert float(jnp.std(jnp.stack(ends))) == pytest.approx(wanted, rel=0.21)
    off = STILL | {"accelerometer_bias": 0.3}
    got = read(jax.random.key(0), Imu(bits=None, **(quiet | off)), NOTHING)
    assert jnp.ptp(got.force, axis=0).max() == 0.0
    assert jnp.abs(got.force).min() > 0.0
    assert jnp.abs(got.rate).max() == 0.0


def test_a_range_clips_and_bits_are_steps_of_it():
    imu = Imu(accelerometer_range=16.0, bits=8)
    pushed = Felt(NOTHING.force + 40.0, NOTHING.rate)
    got = read(jax.random.key(0), imu, pushed)
    assert jnp.unique(got.force).tolist() == [16.0 - 16.0 / 128]
    steps = read(jax.random.key(0), imu, NOTHING).force / (16.0 / 128)
    np.testing.assert_allclose(steps, jnp.round(steps), atol=1e-12)
