"""Sums, scatters and products of small arrays, as operations of their cells."""

from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from jblast.inference.many.residuals.fold.cells import CannotFoldError, plain, unboxed
from jblast.inference.many.residuals.fold.operation import Operations

REDUCE = {
    "reduce_sum": "add",
    "reduce_max": "max",
    "reduce_min": "min",
    "reduce_and": "and",
    "reduce_or": "or",
    "reduce_prod": "mul",
}
SCATTER = {
    "scatter": None,
    "scatter-add": lax.add_p,
    "scatter-mul": lax.mul_p,
    "scatter-min": lax.min_p,
    "scatter-max": lax.max_p,
}
WITH_CELLS = {
    "add": lax.add_p,
    "max": lax.max_p,
    "min": lax.min_p,
    "and": lax.and_p,
    "or": lax.or_p,
    "mul": lax.mul_p,
}


def reduced(
    operation: Operations, name: str, x: np.ndarray, axes: Sequence[int]
) -> np.ndarray:
    """Combine cells along axes."""
    kept = [a for a in range(x.ndim) if a not in axes]
    shape = tuple(x.shape[a] for a in kept)
    rows = x.transpose(*kept, *axes).reshape(*shape, -1)
    out = np.empty(shape, object)
    for at in np.ndindex(shape):
        total, *rest = rows[at]
        for cell in rest:
            total = operation(WITH_CELLS[name], [total, cell], {})
        out[at] = total
    return out


def scattered(operation: Operations, equation, inputs: list[np.ndarray]) -> np.ndarray:
    """Combine some entries of an array with others."""
    onto, places, new = inputs
    primitive = SCATTER[equation.primitive.name]
    if not plain(places):
        raise CannotFoldError("scatter to places that are not known")
    params = dict(equation.params) | {"update_jaxpr": None, "update_consts": ()}
    numbers = np.arange(new.size, dtype=np.int32).reshape(new.shape)
    with jax.ensure_compile_time_eval():
        nowhere = jnp.full(onto.shape, -1, jnp.int32)
        where = np.asarray(
            lax.scatter_p.bind(nowhere, unboxed(places), numbers, **params)
        )
    if np.unique(where[where >= 0]).size != new.size:
        raise CannotFoldError("scatter of several to one place")
    out, flat = onto.copy(), new.ravel()
    for at in np.ndindex(onto.shape):
        if where[at] >= 0:
            pair = [onto[at], flat[where[at]]]
            out[at] = operation(primitive, pair, {}) if primitive else pair[1]
    return out


def contracted(operation: Operations, a, b, contract, batch) -> np.ndarray:
    """Multiply small matrices."""
    if batch != ((), ()):
        raise CannotFoldError("dot_general over a batch")
    (left, right) = (list(c) for c in contract)
    a = np.moveaxis(a, left, range(-len(left), 0))
    b = np.moveaxis(b, right, range(-len(right), 0))
    free_a, free_b = a.shape[: a.ndim - len(left)], b.shape[: b.ndim - len(right)]
    products = np.empty(
        (*free_a, *free_b, int(np.prod(a.shape[len(free_a) :]))), object
    )
    for i in np.ndindex(free_a):
        for j in np.ndindex(free_b):
            pairs = zip(a[i].ravel(), b[j].ravel(), strict=True)
            for k, pair in enumerate(pairs):
                products[(*i, *j, k)] = operation(lax.mul_p, list(pair), {})
    return reduced(operation, "add", products, [products.ndim - 1])
