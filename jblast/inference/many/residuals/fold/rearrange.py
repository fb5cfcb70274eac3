"""Operations that only move the entries of a small array."""

import numpy as np

from jblast.inference.many.residuals.fold.cells import CannotFoldError, plain, unboxed
from jblast.inference.many.residuals.fold.constants import at_once

REARRANGE = [
    "broadcast_in_dim",
    "reshape",
    "squeeze",
    "expand_dims",
    "transpose",
    "slice",
    "rev",
    "gather",
    "dynamic_slice",
    "concatenate",
    "stack",
    "pad",
    "copy",
    "copy_p",
    "split",
    "unstack",
]


def rearranged(equation, inputs: list[np.ndarray]) -> list[np.ndarray]:
    """Run an operation that only moves entries: on their numbers, then look them up."""
    name = equation.primitive.name
    moved = inputs if name in ("concatenate", "stack", "pad") else inputs[:1]
    if not all(plain(x) for x in inputs[len(moved) :]):
        raise CannotFoldError(f"{name} at places that are not known")
    numbers, start = [], 0
    for x in moved:
        number = np.arange(start, start + x.size, dtype=np.int32)
        numbers.append(number.reshape(x.shape))
        start += x.size
    rest = [unboxed(x) for x in inputs[len(moved) :]]
    every = np.concatenate([x.ravel() for x in moved])
    params = dict(equation.params)
    if name == "gather":
        params["fill_value"] = -1
    where = at_once(equation.primitive, params, [*numbers, *rest])
    return [_looked_up(every, w) for w in where]


def _looked_up(every: np.ndarray, where: np.ndarray) -> np.ndarray:
    if (where < 0).any():
        raise CannotFoldError("gather outside of its array")
    out = np.empty(where.shape, object)
    for at in np.ndindex(where.shape):
        out[at] = every[where[at]]
    return out
