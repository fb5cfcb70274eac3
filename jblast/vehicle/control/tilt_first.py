r"""Attitude error that rights a vehicle before it turns it.

Brescianini, Hehn and D'Andrea (2013), "Nonlinear quadrocopter attitude control",
section 3, as in PX4 (AttitudeControl.cpp, commit 129a2ae): the shortest turn that takes
body z to the pull, by an angle $\alpha$ about $n$ in the body's own plane, and about z
then the share $w$ of the angle $\psi$ that is left to the heading,

$$ e = 2 \left( n \sin\tfrac{\alpha}{2} \cos\tfrac{w \psi}{2} + \ldots, \;
\tfrac1w \cos\tfrac{\alpha}{2} \sin\tfrac{w \psi}{2} \right), $$

twice the vector of the quaternion of both turns, its z divided by $w$.
"""

import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.vehicle.dynamics.components import Four, Vector, dot, turned_back

YAW_WEIGHT = 0.4
"""MC_YAW_WEIGHT of PX4."""
OPPOSITE = 1e-9
"""Of one plus the angle's cosine: below, every turn is as short; it is about x."""


def attitude_error(quaternion: Four, pull: Vector, yaw_rad: Float[Array, ""]) -> Vector:
    """Return the error about body x, y and z [rad, for small ones].

    Args:
        quaternion: Body to world.
        pull: Where z should point to, world; of any length but zero.
        yaw_rad: Where x should point to, from east to north.
    """
    seen = turned_back(quaternion, pull)
    length = jnp.sqrt(dot(seen, seen))
    x, y, z = (part / length for part in seen)
    plus = 1 + z
    opposite = plus < OPPOSITE
    half = jnp.sqrt(jnp.where(opposite, OPPOSITE, plus) / 2)
    # z cross the pull, (-y, x, 0), has the length sin(alpha)
    n_x = jnp.where(opposite, 1.0, -y / (2 * half))
    n_y = jnp.where(opposite, 0.0, x / (2 * half))
    half = jnp.where(opposite, 0.0, half)
    east, north = jnp.cos(yaw_rad), jnp.sin(yaw_rad)
    heading = turned_back(quaternion, (east, north, jnp.zeros_like(east)))
    turned = turned_back((n_x, n_y, jnp.zeros_like(n_x), half), heading)
    # what of the heading lies in the plane that is square to the pull
    angle = jnp.arctan2(*_in_front(turned[1], turned[0]))
    turn = YAW_WEIGHT * angle / 2
    c, s = jnp.cos(turn), jnp.sin(turn)
    return (
        2 * (n_x * c + n_y * s),
        2 * (n_y * c - n_x * s),
        2 * half * s / YAW_WEIGHT,
    )


def _in_front(y: Array, x: Array) -> tuple[Array, Array]:
    """Return both, or (0, 1) where neither is anything: that angle has no slope."""
    none = (y == 0) & (x == 0)
    return jnp.where(none, 0.0, y), jnp.where(none, 1.0, x)
