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

from jblast.vehicle.dynamics.components import StateComponents, turning, unit

Rates = Callable[[int, StateComponents], StateComponents]
"""Rates at the beginning (0), in the middle (1) or at the end (2) of a step."""


def rk4_step(
    rates: Rates, motion: StateComponents, step: Float[Array, ""]
) -> StateComponents:
    """Return what a step of the classical Runge-Kutta method of fourth order adds.

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
    return jax.tree.map(
        lambda a, b, c, d: step / 6 * (a + 2 * (b + c) + d),
        first,
        second,
        third,
        fourth,
    )


def euler_step(
    rates: Rates, motion: StateComponents, step: Float[Array, ""]
) -> StateComponents:
    """Return what a step of the semi-implicit Euler method, of first order, adds.

    Args:
        rates: Of a state, at a stage.
        motion: State at the beginning.
        step: Its length [s].
    """
    rate = rates(1, motion)
    moved = _moved(motion, step, rate)
    rate = rate._replace(
        position=moved.velocity, quaternion=turning(motion.quaternion, moved.body_rate)
    )
    return jax.tree.map(lambda dx: step * dx, rate)


INTEGRATORS = {"rk4": rk4_step, "euler": euler_step}


def normal(motion: StateComponents) -> StateComponents:
    """Scale the quaternion to length 1."""
    return motion._replace(quaternion=unit(motion.quaternion))


def _moved(
    motion: StateComponents, step: Float[Array, ""], rate: StateComponents
) -> StateComponents:
    return jax.tree.map(lambda x, dx: x + step * dx, motion, rate)
