"""A vehicle's estimate of its state, and how sure it is of it."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray

from jblast.scene.pose import quaternion_product
from jblast.sensors.carried.inertial import Biases
from jblast.sensors.imu.motion import rotation_between, rotation_quaternion
from jblast.types import as_float_array
from jblast.vehicle import State

TURN, PLACE, MOVES, RATE_BIAS, FORCE_BIAS = (slice(3 * n, 3 * n + 3) for n in range(5))
"""Parts of an error: attitude about the body's axes [rad], position [m], velocity
[m/s], what gyroscope [rad/s] and accelerometer [m/s2] are off by."""
SIZE = 15


class Past(NamedTuple):
    """What was estimated when the last fix was taken.

    Attributes:
        position_m: East, north, up.
        velocity_m_s: East, north, up.
        age_s: How long ago.
    """

    position_m: Float[Array, "3"]
    velocity_m_s: Float[Array, "3"]
    age_s: Float[Array, ""]


class Estimate(NamedTuple):
    """An estimate.

    Attributes:
        position_m: East, north, up.
        velocity_m_s: East, north, up.
        quaternion: Body to world (x, y, z, w), of length 1.
        rate_bias: What the gyroscope is off by [rad/s].
        force_bias: What the accelerometer is off by [m/s2].
        covariance: Of the error: the truth is the estimate turned and moved on by it.
        past: What a late fix is compared with.
    """

    position_m: Float[Array, "3"]
    velocity_m_s: Float[Array, "3"]
    quaternion: Float[Array, "4"]
    rate_bias: Float[Array, "3"]
    force_bias: Float[Array, "3"]
    covariance: Float[Array, "15 15"]
    past: Past


class Alignment(eqx.Module):
    """How sure a vehicle is of its state as it begins: one standard deviation each.

    Declared: aligned and calibrated at rest, its heading by the field.

    Attributes:
        tilt: Of roll and pitch [rad].
        heading: [rad].
        place: Along each axis [m].
        moves: Likewise [m/s].
    """

    tilt: Float[Array, ""] = eqx.field(converter=as_float_array, default=0.01)
    heading: Float[Array, ""] = eqx.field(converter=as_float_array, default=0.03)
    place: Float[Array, ""] = eqx.field(converter=as_float_array, default=0.2)
    moves: Float[Array, ""] = eqx.field(converter=as_float_array, default=0.05)

    def deviations(
        self, rate_bias: Float[Array, ""], force_bias: Float[Array, ""]
    ) -> Float[Array, "15"]:
        """Return one standard deviation of each number of the error.

        Args:
            rate_bias: Of what the gyroscope is off by, calibrated [rad/s].
            force_bias: Of what the accelerometer is off by [m/s2].
        """
        one = jnp.ones(3)
        turn = jnp.stack([self.tilt, self.tilt, self.heading])
        return jnp.concatenate(
            [
                *(turn, self.place * one, self.moves * one),
                *(rate_bias * one, force_bias * one),
            ]
        )


def moved_on(estimate: Estimate, error: Float[Array, "15"]) -> Estimate:
    """Return an estimate turned and moved on by an error; its past stays.

    Args:
        estimate: Any.
        error: By the parts of it.
    """
    turned = quaternion_product(estimate.quaternion, rotation_quaternion(error[TURN]))
    return estimate._replace(
        position_m=estimate.position_m + error[PLACE],
        velocity_m_s=estimate.velocity_m_s + error[MOVES],
        quaternion=turned / jnp.sqrt(jnp.sum(jnp.square(turned))),
        rate_bias=estimate.rate_bias + error[RATE_BIAS],
        force_bias=estimate.force_bias + error[FORCE_BIAS],
    )


def error_of(estimate: Estimate, true: State, biases: Biases) -> Float[Array, "15"]:
    """Return the error that takes an estimate to the truth.

    Args:
        estimate: What is believed.
        true: The vehicle's state.
        biases: What its instruments are off by.
    """
    return jnp.concatenate(
        [
            rotation_between(estimate.quaternion, true.quaternion),
            true.position_m - estimate.position_m,
            true.velocity_m_s - estimate.velocity_m_s,
            biases.rate - estimate.rate_bias,
            biases.force - estimate.force_bias,
        ]
    )


def aligned(key: PRNGKeyArray, true: State, deviations: Float[Array, "15"]) -> Estimate:
    """Return the estimate that a flight begins with: the truth, less a drawn error.

    Of what its instruments are off by it knows nothing.

    Args:
        key: Of the error.
        true: The vehicle's state.
        deviations: One standard deviation of each number of the error.
    """
    off = deviations * jax.random.normal(key, (SIZE,))
    off = off.at[RATE_BIAS].set(0.0).at[FORCE_BIAS].set(0.0)
    zero = jnp.zeros(3)
    exact = Estimate(
        true.position_m,
        true.velocity_m_s,
        true.quaternion,
        zero,
        zero,
        jnp.diag(jnp.square(deviations)),
        Past(true.position_m, true.velocity_m_s, jnp.zeros(())),
    )
    believed = moved_on(exact, off)
    return believed._replace(
        past=Past(believed.position_m, believed.velocity_m_s, jnp.zeros(()))
    )
