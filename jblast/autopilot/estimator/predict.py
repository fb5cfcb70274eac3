r"""An estimate carried on over one sample of the inertial unit, and its error with it.

With the sample's mean rate and specific force, each less what the instruments are off
by, and the attitude in the middle of the sample, $R_m = R\exp(\omega\,\Delta t/2)$,

$$R' = R\exp(\omega\,\Delta t), \quad v' = v + (R_m f - g\hat z)\Delta t, \quad
p' = p + (v + v')\Delta t/2$$

are exact for what `carried.inertial` feels, but for the last. The error, attitude about
the body's axes, goes on to the first order as (Sola 2017, Quaternion kinematics for the
error-state Kalman filter, section 5.3, with the middle of the sample for its beginning)

$$\delta\theta' = \exp(-\omega\Delta t)\,\delta\theta -
  (\Delta t - [\omega]_\times\Delta t^2/2)\,\delta b_\omega$$
$$\delta v' = \delta v - R_m [f]_\times \Delta t\,(R_h^T\delta\theta -
  \delta b_\omega\Delta t/2) - R_m\Delta t\,\delta b_f$$

with $R_h = \exp(\omega\,\Delta t/2)$, and $\delta p' = \delta p + (\delta v +
\delta v')\Delta t/2$.
"""

import math

import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.autopilot.estimator.estimate import (
    MOVES,
    PLACE,
    Estimate,
)
from jblast.constants import FLIGHT_GRAVITY
from jblast.scene import Imu, quaternion_matrix
from jblast.scene.pose import quaternion_product
from jblast.sensors.imu.motion import rotation_quaternion


def predicted(
    estimate: Estimate,
    force_m_s2: Float[Array, "3"],
    rate_rad_s: Float[Array, "3"],
    imu: Imu,
    period_s: Float[Array, ""],
) -> Estimate:
    """Return an estimate a sample later.

    Args:
        estimate: At its beginning.
        force_m_s2: Specific force that was read, body axes.
        rate_rad_s: Rate that was read, body axes.
        imu: How noisy it is.
        period_s: Of the sample.
    """
    on = transition(estimate, force_m_s2, rate_rad_s, period_s)
    noise = noise_gained(estimate, rate_rad_s, imu, period_s)
    spread = on @ estimate.covariance @ on.T + noise
    past = estimate.past
    return carried_on(estimate, force_m_s2, rate_rad_s, period_s)._replace(
        covariance=(spread + spread.T) / 2,
        past=past._replace(age_s=past.age_s + period_s),
    )


def carried_on(
    estimate: Estimate,
    force_m_s2: Float[Array, "3"],
    rate_rad_s: Float[Array, "3"],
    period_s: Float[Array, ""],
) -> Estimate:
    """Return where an estimate goes in a sample; its spread stays."""
    turn = (rate_rad_s - estimate.rate_bias) * period_s
    half = quaternion_product(estimate.quaternion, rotation_quaternion(turn / 2))
    pull = quaternion_matrix(half) @ (force_m_s2 - estimate.force_bias)
    gain = (pull - jnp.array([0.0, 0.0, FLIGHT_GRAVITY])) * period_s
    velocity = estimate.velocity_m_s + gain
    turned = quaternion_product(estimate.quaternion, rotation_quaternion(turn))
    mean = (estimate.velocity_m_s + velocity) / 2
    return estimate._replace(
        position_m=estimate.position_m + mean * period_s,
        velocity_m_s=velocity,
        quaternion=turned / jnp.sqrt(jnp.sum(jnp.square(turned))),
    )


def transition(
    estimate: Estimate,
    force_m_s2: Float[Array, "3"],
    rate_rad_s: Float[Array, "3"],
    period_s: Float[Array, ""],
) -> Float[Array, "15 15"]:
    """Return the matrix that carries an error on over a sample."""
    rate = rate_rad_s - estimate.rate_bias
    force = force_m_s2 - estimate.force_bias
    half = rotation_quaternion(rate * period_s / 2)
    middle = quaternion_matrix(quaternion_product(estimate.quaternion, half))
    back = quaternion_matrix(half).T
    pushed = -period_s * middle @ cross_matrix(force)
    one, none = jnp.eye(3), jnp.zeros((3, 3))
    turned = -period_s * one + cross_matrix(rate) * period_s**2 / 2
    gains = [pushed @ back, none, one, -pushed * period_s / 2, -period_s * middle]
    half_way = period_s / 2
    ways = [half_way * part for part in gains]
    ways[1:3] = [one, period_s * one]
    # by rows, in the order of the parts: to set them one by one costs ten times that
    return jnp.concatenate(
        [
            jnp.concatenate(parts, axis=1)
            for parts in (
                [back @ back, none, none, turned, none],
                ways,
                gains,
                [none, none, none, one, none],
                [none, none, none, none, one],
            )
        ]
    )


def noise_gained(
    estimate: Estimate,
    rate_rad_s: Float[Array, "3"],
    imu: Imu,
    period_s: Float[Array, ""],
) -> Float[Array, "15 15"]:
    """Return what a sample's noise adds to the spread."""
    half = math.sqrt(imu.rate / 2)
    turn = half * imu.gyroscope_noise * period_s
    push = half * imu.accelerometer_noise * period_s
    one = jnp.ones(3)
    gained = jnp.concatenate(
        [
            jnp.square(turn) * one,
            jnp.square(push * period_s / 2) * one,
            jnp.square(push) * one,
            jnp.square(imu.gyroscope_walk) * period_s * one,
            jnp.square(imu.accelerometer_walk) * period_s * one,
        ]
    )
    both = jnp.square(push) * period_s / 2 * jnp.eye(3)
    spread = jnp.diag(gained)
    return spread.at[PLACE, MOVES].set(both).at[MOVES, PLACE].set(both)


def cross_matrix(v: Float[Array, "3"]) -> Float[Array, "3 3"]:
    """Return the matrix whose product with a vector is the vector product by it."""
    zero = jnp.zeros_like(v[0])
    return jnp.stack(
        [
            jnp.stack([zero, -v[2], v[1]]),
            jnp.stack([v[2], zero, -v[0]]),
            jnp.stack([-v[1], v[0], zero]),
        ]
    )
