r"""What an accelerometer and a gyroscope feel on a vehicle that flies.

A sample is the mean over its time, from its stamp on. With the velocity at the
instrument's place $r$, $v_p = v + R(\omega\times r)$,

$$\bar f = S^T R_m^T\,(\Delta v_p/\Delta t + g\,\hat z), \qquad
\bar\omega = S^T \ln(q_0^{-1} q_1)/\Delta t$$

in the instrument's axes ($S$ takes them to the body's, $R_m$ the body's to the world's
in the middle): the specific force, that is without gravity, and the rate that turns the
attitude at one end of the sample into that at the other. So the samples of a flight sum
to its change of velocity, whatever happens within one.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.constants import FLIGHT_GRAVITY
from jblast.scene import quaternion_matrix
from jblast.scene.camera import quaternion_product
from jblast.vehicle import Trajectory


class Felt(NamedTuple):
    """Samples of an inertial measurement unit.

    Attributes:
        force: Specific force along its axes [m/s2].
        rate: About its axes [rad/s].
    """

    force: Float[Array, "sample 3"]
    rate: Float[Array, "sample 3"]


def felt(
    flight: Trajectory,
    edges_s: Float[Array, " edge"],
    offset_m: Float[Array, "3"],
    quaternion: Float[Array, "4"],
) -> Felt:
    """Return what is felt between times, straight lines between the flight's rows.

    Before and after the flight the vehicle stays as it is at its ends.

    Args:
        flight: Of one vehicle, all rows finite.
        edges_s: Where samples begin and end, on the flight's clock; one more than they.
        offset_m: Of the instrument from the centre of mass, body axes.
        quaternion: Instrument to body (x, y, z, w).
    """
    velocity, rate, attitude = (
        _at(edges_s, flight.time_s, rows)
        for rows in (flight.velocity_m_s, flight.body_rate_rad_s, flight.quaternion)
    )
    turned = jax.vmap(quaternion_matrix)(attitude)
    lever = jnp.cross(rate, jnp.broadcast_to(offset_m, rate.shape))
    place_velocity = velocity + jnp.einsum("nij,nj->ni", turned, lever)
    step = jnp.diff(edges_s)[:, None]
    gained = jnp.diff(place_velocity, axis=0) / step
    gained = gained + jnp.array([[0.0, 0.0, FLIGHT_GRAVITY]])
    turn = jax.vmap(rotation_between)(attitude[:-1], attitude[1:])
    # attitude in the middle of a sample: half of its turn on
    half = jax.vmap(_half_on)(attitude[:-1], turn)
    to_world = jax.vmap(quaternion_matrix)(half)
    force = jnp.einsum("nji,nj->ni", to_world, gained)
    to_body = quaternion_matrix(quaternion)
    return Felt(force @ to_body, turn / step @ to_body)


def rotation_between(
    first: Float[Array, "4"], last: Float[Array, "4"]
) -> Float[Array, "3"]:
    """Return the rotation vector, body axes, from one attitude to another [rad]."""
    back = first * jnp.array([-1.0, -1.0, -1.0, 1.0])
    q = quaternion_product(back, last)
    q = jnp.where(q[3] < 0, -q, q)  # the short way
    square = jnp.sum(jnp.square(q[:3]))
    turns = square > 0
    sine = jnp.sqrt(jnp.where(turns, square, 1.0))
    scale = jnp.where(turns, 2 * jnp.arctan2(sine, q[3]) / sine, 2.0)
    return scale * q[:3]


def rotation_quaternion(vector: Float[Array, "3"]) -> Float[Array, "4"]:
    """Return the quaternion (x, y, z, w) of a rotation vector [rad]."""
    square = jnp.sum(jnp.square(vector))
    turns = square > 0
    angle = jnp.sqrt(jnp.where(turns, square, 1.0))
    scale = jnp.where(turns, jnp.sin(angle / 2) / angle, 0.5)
    cosine = jnp.where(turns, jnp.cos(angle / 2), 1.0)
    return jnp.append(scale * vector, cosine)


def _half_on(attitude: Float[Array, "4"], turn: Float[Array, "3"]) -> Float[Array, "4"]:
    return quaternion_product(attitude, rotation_quaternion(turn / 2))


def _at(
    when: Float[Array, " edge"],
    times: Float[Array, " row"],
    rows: Float[Array, "row axis"],
) -> Float[Array, "edge axis"]:
    """Return columns between their rows."""
    return jax.vmap(jnp.interp, (None, None, 1), 1)(when, times, rows)
