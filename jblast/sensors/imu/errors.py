"""What an inertial measurement unit adds to what it feels: bias, noise, a range."""

import math

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray

from jblast.scene import Imu
from jblast.sensors.imu.motion import Felt


def read(key: PRNGKeyArray, imu: Imu, true: Felt) -> Felt:
    """Return samples as they are written down.

    Args:
        key: Of bias, walk and noise.
        imu: What it does to them.
        true: What it feels.
    """
    noise = imu.sample_noise()
    force, rate = jax.random.split(key)
    return Felt(
        _axes(
            *(force, true.force, imu, noise[0]),
            *(imu.accelerometer_bias, imu.accelerometer_walk, imu.accelerometer_range),
        ),
        _axes(
            *(rate, true.rate, imu, noise[1]),
            *(imu.gyroscope_bias, imu.gyroscope_walk, imu.gyroscope_range),
        ),
    )


def _axes(
    key: PRNGKeyArray,
    true: Float[Array, "sample 3"],
    imu: Imu,
    noise: Float[Array, ""],
    bias: Float[Array, ""],
    walk: Float[Array, ""],
    full_scale: Float[Array, ""],
) -> Float[Array, "sample 3"]:
    """Return the samples of one instrument."""
    of_bias, of_walk, of_noise = jax.random.split(key, 3)
    step = walk * math.sqrt(1 / imu.rate)
    off = bias * jax.random.normal(of_bias, (3,))
    walked = step * jnp.cumsum(jax.random.normal(of_walk, true.shape), axis=0)
    read = (
        true + off[None, :] + walked + noise * jax.random.normal(of_noise, true.shape)
    )
    if imu.bits is None:
        return jnp.clip(read, -full_scale, full_scale)
    smallest = full_scale / 2.0 ** (imu.bits - 1)
    whole = jnp.round(read / smallest) * smallest
    return jnp.clip(whole, -full_scale, full_scale - smallest)
