"""An autopilot's axes: north, east, down, and a body's ahead, right, down; and ours.

Ours are east, north, up, and a body's ahead, left, up; quaternions are scalar last here
and first there.
"""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.scene.pose import quaternion_product

TURN = np.array([1.0, 1.0, 0.0, 0.0]) / np.sqrt(2)
"""North-east-down to east-north-up (x, y, z, w): half a turn about their middle."""
FLIP = np.array([1.0, 0.0, 0.0, 0.0])
"""Ahead-right-down to ahead-left-up: half a turn about x."""


def world(vector: Float[Array, "3"]) -> Float[Array, "3"]:
    """Return a vector of one world in the other's axes; both ways."""
    return jnp.stack([vector[1], vector[0], -vector[2]])


def body(vector: Float[Array, "3"]) -> Float[Array, "3"]:
    """Return a vector of one body in the other's axes; both ways."""
    return jnp.stack([vector[0], -vector[1], -vector[2]])


def attitude_out(quaternion: Float[Array, "4"]) -> Float[Array, "4"]:
    """Return a body's attitude (x, y, z, w) as (w, x, y, z) of an autopilot, w >= 0."""
    turned = quaternion_product(
        quaternion_product(jnp.asarray(TURN), quaternion), jnp.asarray(FLIP)
    )
    turned = jnp.where(turned[3] < 0, -turned, turned)
    return jnp.roll(turned, 1)


def attitude_in(quaternion: Float[Array, "4"]) -> Float[Array, "4"]:
    """Return an autopilot's attitude (w, x, y, z) as (x, y, z, w) of ours."""
    ours = jnp.roll(quaternion, -1)
    return quaternion_product(
        quaternion_product(jnp.asarray(TURN), ours), jnp.asarray(FLIP)
    )
