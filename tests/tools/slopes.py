"""Derivatives by few programs, however many places are looked at.

`jax.test_util.check_grads` of second order compiles sixteen; it stays where a rule of
differentiation is our own.
"""

import functools
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np


def check_slopes(
    f: Callable[..., Any],
    args: tuple,
    order: int = 1,
    *,
    atol: float = 1e-5,
    rtol: float = 1e-5,
    eps: float = 1e-4,
) -> None:
    """Compare the derivatives of a function in a random direction with differences.

    First order forward and in reverse, of values; second order forward over reverse, of
    the gradient.

    Args:
        f: Of arrays, to arrays.
        args: Where.
        order: 1 or 2.
        atol: Absolute tolerance.
        rtol: Relative tolerance.
        eps: Half the distance of the places whose difference is taken.

    Raises:
        AssertionError: They differ.
    """
    rng = np.random.default_rng(0)
    x = jax.tree.map(lambda a: jnp.asarray(a, float), args)
    v = jax.tree.map(lambda a: jnp.asarray(rng.standard_normal(a.shape)), x)
    shapes = jax.eval_shape(lambda x: f(*x), x)
    u = jax.tree.map(lambda a: jnp.asarray(rng.standard_normal(a.shape)), shapes)
    slopes, along = _programs(f, order)
    (value, gradient), (pushed, curved) = along(x, u, v)
    ends = [
        slopes(jax.tree.map(lambda a, d, s=s: a + s * eps * d, x, v), u)
        for s in (1.0, -1.0)
    ]
    numeric, bent = jax.tree.map(lambda a, b: (a - b) / (2 * eps), *ends)
    close = functools.partial(
        np.testing.assert_allclose, atol=atol, rtol=rtol, equal_nan=False
    )
    middle = jax.tree.map(lambda a, b: (a + b) / 2, ends[0][0], ends[1][0])
    jax.tree.map(lambda a, b: close(a, b, err_msg="value"), value, middle)
    jax.tree.map(lambda a, b: close(a, b, err_msg="forward"), pushed, numeric)
    close(_inner(gradient, v), _inner(u, numeric), err_msg="reverse")
    if order > 1:
        jax.tree.map(lambda a, b: close(a, b, err_msg="second order"), curved, bent)


def with_slopes(f: Callable[[Any], Any], size: int = 1024) -> Callable[..., Any]:
    """Return a function's value, slope and curvature at any places, by one program.

    The slope is that of reverse mode, the curvature that of forward over reverse.

    Args:
        f: Of a number, to a number.
        size: Places are taken in blocks of so many.
    """

    @jax.jit
    def program(x):
        def at(x):
            return jax.vmap(jax.value_and_grad(f))(x)

        (value, slope), (_, curvature) = jax.jvp(at, (x,), (jnp.ones_like(x),))
        return value, slope, curvature

    def found(places):
        x = np.asarray(places, float)
        flat = x.ravel()
        blocks = [
            program(np.resize(flat[start : start + size], size))
            for start in range(0, flat.size, size)
        ]
        return tuple(
            np.concatenate([np.asarray(part) for part in parts])[: x.size].reshape(
                x.shape
            )
            for parts in zip(*blocks, strict=True)
        )

    return found


@functools.lru_cache(maxsize=8)
def _programs(f: Callable[..., Any], order: int):
    """Return the value with its gradient, and these with their changes along a way."""

    def slopes(x, u):
        value, pull = jax.vjp(lambda x: f(*x), x)
        return value, pull(u)[0]

    def along(x, u, v):
        if order > 1:
            return jax.jvp(lambda x: slopes(x, u), (x,), (v,))
        pushed = jax.jvp(lambda x: f(*x), (x,), (v,))[1]
        return slopes(x, u), (pushed, None)

    return jax.jit(slopes), jax.jit(along)


def _inner(one, other) -> float:
    return sum(
        float(jnp.vdot(a, b))
        for a, b in zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True)
    )
