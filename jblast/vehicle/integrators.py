r"""One step of a flight.

RK4 takes rates at the beginning, twice in the middle and at the end of the step. The
semi-implicit Euler method takes them once, at the state of the beginning and the wind
and loads of the middle, and moves on with the new velocity and body rate.

Every step ends with the quaternion scaled to length 1. The exact flow keeps the length,
so what is taken away is part of the step's own error and no larger: the order stays.
"""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from jblast.vehicle.motion import Motion, turning, unit

Rates = Callable[[int | Int[Array, ""], Motion], Motion]
"""Rates at the beginning (0), in the middle (1) or at the end (2) of a step."""


def rk4_step(rates: Rates, motion: Motion, step: Float[Array, ""]) -> Motion:
    """Advance by the classical Runge-Kutta method of fourth order.

    Args:
        rates: Of a state, at a stage.
        motion: State at the beginning.
        step: Its length [s].
    """
    half = step / 2
    table = (
        jnp.stack([0 * step, half, half, step]),  # how far along the last rates
        jnp.stack([step / 6, step / 3, step / 3, step / 6]),  # share in the step
        jnp.array([0, 1, 1, 2]),
    )

    def stage(so_far: tuple[Motion, Motion], row: Any) -> tuple[Any, None]:
        (reach, share, place), (end, rate) = row, so_far
        rate = rates(place, _moved(motion, reach, rate))
        return (_moved(end, share, rate), rate), None

    # A loop, or XLA calculates each stage again for every number of the next.
    nothing = jax.tree.map(jnp.zeros_like, motion)
    (end, _), _ = jax.lax.scan(stage, (motion, nothing), table)
    return _normal(end)


def euler_step(rates: Rates, motion: Motion, step: Float[Array, ""]) -> Motion:
    """Advance by the semi-implicit Euler method, of first order.

    Args:
        rates: Of a state, at a stage.
        motion: State at the beginning.
        step: Its length [s].
    """
    moved = _moved(motion, step, rates(1, motion))
    x, y, z = motion.position
    u, v, w = moved.velocity
    q, turn = motion.quaternion, turning(motion.quaternion, moved.body_rate)
    return _normal(
        moved._replace(
            position=(x + step * u, y + step * v, z + step * w),
            quaternion=(
                q[0] + step * turn[0],
                q[1] + step * turn[1],
                q[2] + step * turn[2],
                q[3] + step * turn[3],
            ),
        )
    )


INTEGRATORS = {"rk4": rk4_step, "euler": euler_step}


def _moved(motion: Motion, step: Float[Array, ""], rate: Motion) -> Motion:
    return jax.tree.map(lambda x, dx: x + step * dx, motion, rate)


def _normal(motion: Motion) -> Motion:
    return motion._replace(quaternion=unit(motion.quaternion))
