"""The logarithm of a pixel's light as a function of time: sampled, and solved for."""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

LogLight = Callable[
    [Float[Array, " at"], Float[Array, " at"], Float[Array, " at"]],
    Float[Array, " at"],
]
"""Logarithm of the light at times [s], columns and rows: one place for each time."""

SIZES = (1 << 16, 1 << 12, 1 << 8)
"""So many places are looked at in one call."""


def value_and_slope(log_light: LogLight, time, x, y):
    """Return the logarithm of light and its derivative in time [1/s]."""
    return jax.jvp(lambda t: log_light(t, x, y), (time,), (jnp.ones_like(time),))


sample = eqx.filter_jit(value_and_slope)


def in_lanes(run, *fields: np.ndarray) -> tuple[np.ndarray, ...]:
    """Run on arrays of three sizes only, so that few programs are compiled."""
    size = fields[0].size
    if not size:
        return np.empty(0), np.empty(0)
    parts, begin = [], 0
    while begin < size:
        lanes = next((n for n in SIZES if n <= size - begin), SIZES[-1])
        part = [np.asarray(field[begin : begin + lanes], float) for field in fields]
        kept = len(part[0])
        padded = [np.pad(field, (0, lanes - kept), mode="edge") for field in part]
        answer = run(*(jnp.asarray(field) for field in padded))
        parts.append([np.asarray(v, float)[:kept] for v in answer])
        begin += lanes
    return tuple(np.concatenate(field) for field in zip(*parts, strict=True))


@eqx.filter_jit
def solve_crossings(log_light, low, high, level, sign, x, y, tolerance):
    """Solve for the crossings of monotone pieces: Newton's steps, held by bisection."""

    def going(state):
        return state[-1].any()

    def step(state):
        *old, going = state
        low, high, time, last, before = old
        value, slope = value_and_slope(log_light, time, x, y)
        short = sign * (value - level) < 0.0
        low, high = jnp.where(short, time, low), jnp.where(short, high, time)
        move = (level - value) / jnp.where(slope == 0.0, jnp.inf, slope)
        new = time + move
        # as long as steps halve every second time they converge faster than bisection
        good = (new > low) & (new < high) & (jnp.abs(move) < 0.5 * before)
        new = jnp.where(good & (slope != 0.0), new, 0.5 * (low + high))
        length = jnp.abs(new - time)
        state = (low, high, new, length, last)
        kept = (jnp.where(going, a, b) for a, b in zip(state, old, strict=True))
        return *kept, going & (length > tolerance)

    size = high - low
    state = (low, high, 0.5 * (low + high), size, size, size > tolerance)
    return jax.lax.while_loop(going, step, state)[2:3]
