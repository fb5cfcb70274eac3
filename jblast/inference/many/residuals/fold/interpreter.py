"""Run a program written for one row of one log over arrays of rows and lanes.

`vmap` gives every array of such a program a lane in front: a place becomes (lane, 3), a
choice of rows a gather, a wind of zero a sum of products with zero. Here the program's
small arrays are taken apart instead: each of their entries is a *cell*, one array of
shape (row, lane), (row, 1), (1, lane) or (1, 1), and every operation one of cells. What
depends on the layout alone is computed once, sums with zero and products with zero and
one are left out (zero times anything is zero), choices already made are not computed,
what was computed is not computed again, and a derivative's $x^{c-1}$ is $x^c / x$.
Elementwise arithmetic remains, with the lanes last, which XLA makes the most of.
"""

from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.extend.core import ClosedJaxpr, Literal
from jaxtyping import Array

from jblast.inference.many.residuals.fold.cells import (
    CannotFoldError,
    Cell,
    boxed,
    cells,
    plain,
    unboxed,
    uniform,
)
from jblast.inference.many.residuals.fold.constants import at_once
from jblast.inference.many.residuals.fold.operation import Operations
from jblast.inference.many.residuals.fold.rearrange import REARRANGE, rearranged
from jblast.inference.many.residuals.fold.reductions import (
    REDUCE,
    SCATTER,
    contracted,
    reduced,
    scattered,
)

INNER = ("jit", "pjit", "closed_call", "core_call", "custom_jvp_call", "remat2")
NOT_ELEMENTWISE = ("while", "scan", "cond", "sort", "cumsum", "custom_vjp_call")


def fold(
    function: Callable[..., Any], arguments: Sequence[Cell]
) -> list[Array | np.ndarray]:
    """Run a function of numbers over cells.

    Args:
        function: Takes as many numbers, returns a flat sequence of numbers.
        arguments: A cell for each; NumPy arrays are taken as known beforehand.

    Raises:
        CannotFoldError: The function holds a loop or the like.
    """
    shapes = [jax.ShapeDtypeStruct((), a.dtype) for a in arguments]
    closed = jax.make_jaxpr(function)(*shapes)
    inputs = [boxed(uniform(a)) for a in arguments]
    return [cell.item() for cell in _run(Operations(), closed, inputs)]


def over_cells(
    function: Callable[..., Any],
    arguments: Sequence[Cell],
    whole: Callable[..., Any] | None = None,
) -> list[Array | np.ndarray]:
    """Run a function of numbers over cells: taken apart, or if need be by `vmap`.

    Args:
        function: Takes as many numbers, returns a flat sequence of numbers.
        arguments: A cell for each.
        whole: The same function as `vmap` is to have it; None: as it is.
    """
    try:
        return fold(function, arguments)
    except CannotFoldError:
        shape = np.broadcast_shapes(*(a.shape for a in arguments))
        full = [jnp.broadcast_to(a, shape) for a in arguments]
        return list(jax.vmap(jax.vmap(whole or function))(*full))


def _run(
    operation: Operations, closed: ClosedJaxpr, inputs: list[np.ndarray]
) -> list[np.ndarray]:
    """Run a jaxpr over boxes of cells."""
    values: dict[Any, np.ndarray] = {}

    def read(var):
        return cells(var.val) if isinstance(var, Literal) else values[var]

    jaxpr = closed.jaxpr
    values.update(zip(jaxpr.constvars, map(cells, closed.consts), strict=True))
    values.update(zip(jaxpr.invars, inputs, strict=True))
    for equation in jaxpr.eqns:
        out = _equation(operation, equation, [read(v) for v in equation.invars])
        values.update(zip(equation.outvars, out, strict=True))
    return [read(v) for v in jaxpr.outvars]


def _equation(
    operation: Operations, equation: Any, inputs: list[np.ndarray]
) -> list[np.ndarray]:
    """Run one equation of a jaxpr."""
    name, params = equation.primitive.name, equation.params
    if name in INNER:
        inner = params.get("jaxpr", params.get("call_jaxpr"))
        inner = inner if hasattr(inner, "consts") else ClosedJaxpr(inner, ())
        return _run(operation, inner, inputs)
    if all(plain(x) for x in inputs):
        out = at_once(equation.primitive, params, [unboxed(x) for x in inputs])
        return [cells(o) for o in out]
    if name in REARRANGE:
        return rearranged(equation, inputs)
    if name in REDUCE:
        return [reduced(operation, REDUCE[name], inputs[0], params["axes"])]
    if name in SCATTER:
        return [scattered(operation, equation, inputs)]
    if name == "dot_general":
        return [contracted(operation, *inputs, *params["dimension_numbers"])]
    if name in NOT_ELEMENTWISE or equation.effects or len(equation.outvars) > 1:
        raise CannotFoldError(name)
    shape = equation.outvars[0].aval.shape
    try:
        spread = [np.broadcast_to(x, shape) for x in inputs]
    except ValueError:
        raise CannotFoldError(name) from None
    out = np.empty(shape, object)
    for at in np.ndindex(shape):
        out[at] = operation(equation.primitive, [x[at] for x in spread], params)
    return [out]
