r"""One step of a flight.

RK4 takes rates at the beginning, twice in the middle and at the end of the step. The
semi-implicit Euler method takes them once, at the state of the beginning and the wind
and loads of the middle, and moves on with the new velocity and body rate.

Every step ends with the quaternion scaled to length 1. The exact flow keeps the length,
so what is taken away is part of the step's own error and no larger: the order stays.
"""

from collections.abc import Callable

import jax
from jaxtyping import Array, Float

from jblast.vehicle.motion import Motion, turning, unit

Rates = Callable[[int, Motion], Motion]
"""Rates at the beginning (0), in the middle (1) or at the end (2) of a step."""


def rk4_step(rates: Rates, motion: Motion, step: Float[Array, ""]) -> Motion:
    """Advance by the classical Runge-Kutta method of fourth order.

    Args:
        rates: Of a state, at a stage.
        motion: State at the beginning.
        step: Its length [s].
    """
    half = step / 2
    first = rates(0, motion)
    second = rates(1, _moved(motion, half, first))
    third = rates(1, _moved(motion, half, second))
    fourth = rates(2, _moved(motion, step, third))
    end = jax.tree.map(
        lambda x, a, b, c, d: x + step / 6 * (a + 2 * (b + c) + d),
        motion,
        first,
        second,
        third,
        fourth,
    )
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
