"""Accelerometer and gyroscope of a vehicle in flight, one sample at a time.

What they feel is that of `imu.motion`, at the centre of mass: a sample is the mean over
its time, so that the samples sum to the change of velocity and of attitude, however
short a blast's push is. What they add is that of `imu.errors`, without its bits: an
offset from when they are switched on, which walks, white noise, and a range.
"""

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray

from jblast.constants import FLIGHT_GRAVITY
from jblast.scene import Imu, quaternion_matrix
from jblast.scene.camera import quaternion_product
from jblast.sensors.imu.motion import rotation_between, rotation_quaternion
from jblast.vehicle import State


class Biases(NamedTuple):
    """What the instruments are off by.

    Attributes:
        force: Of the accelerometer [m/s2].
        rate: Of the gyroscope [rad/s].
    """

    force: Float[Array, "3"]
    rate: Float[Array, "3"]


def drawn_biases(key: PRNGKeyArray, imu: Imu, share: float = 1.0) -> Biases:
    """Return what the instruments are off by as they are switched on.

    Args:
        key: Of the draw.
        imu: Says how much.
        share: What a calibration on the ground has left of it.
    """
    of_force, of_rate = jax.random.split(key)
    return Biases(
        share * imu.accelerometer_bias * jax.random.normal(of_force, (3,)),
        share * imu.gyroscope_bias * jax.random.normal(of_rate, (3,)),
    )


def walked(
    noise: Float[Array, "6"], imu: Imu, biases: Biases, period_s: Float[Array, ""]
) -> Biases:
    """Return what the instruments are off by a period later.

    Args:
        noise: Standard normal numbers, of force and of rate.
        imu: Says how fast they walk.
        biases: At its beginning.
        period_s: How long it is.
    """
    step = jnp.sqrt(period_s)
    return Biases(
        biases.force + step * imu.accelerometer_walk * noise[:3],
        biases.rate + step * imu.gyroscope_walk * noise[3:],
    )


def felt_between(
    before: State, now: State, period_s: Float[Array, ""]
) -> tuple[Float[Array, "3"], Float[Array, "3"]]:
    """Return specific force [m/s2] and rate [rad/s] between two states, body axes."""
    turn = rotation_between(before.quaternion, now.quaternion)
    half = quaternion_product(before.quaternion, rotation_quaternion(turn / 2))
    gained = (now.velocity_m_s - before.velocity_m_s) / period_s
    gained = gained + jnp.array([0.0, 0.0, FLIGHT_GRAVITY])
    return quaternion_matrix(half).T @ gained, turn / period_s


def sampled(
    noise: Float[Array, "6"],
    imu: Imu,
    biases: Biases,
    true: tuple[Float[Array, "3"], Float[Array, "3"]],
) -> tuple[Float[Array, "3"], Float[Array, "3"]]:
    """Return a sample as it is read.

    Args:
        noise: Standard normal numbers, of force and of rate.
        imu: Noise, rate and range.
        biases: What the instruments are off by.
        true: Specific force and rate.
    """
    half = math.sqrt(imu.rate / 2)
    force = true[0] + biases.force
    force = force + half * imu.accelerometer_noise * noise[:3]
    rate = true[1] + biases.rate
    rate = rate + half * imu.gyroscope_noise * noise[3:]
    most, fastest = imu.accelerometer_range, imu.gyroscope_range
    return jnp.clip(force, -most, most), jnp.clip(rate, -fastest, fastest)
