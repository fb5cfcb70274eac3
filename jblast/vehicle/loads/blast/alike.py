"""A function of each of several values, one program for those of one kind."""

from collections.abc import Callable, Sequence
from typing import TypeVar

import jax
import jax.numpy as jnp

T = TypeVar("T")
R = TypeVar("R")


def over_alike(function: Callable[[T], R], values: Sequence[T]) -> list[R]:
    """Return what a function gives of each value.

    Values of one structure, as blasts of one curve set, are stacked and computed
    together: a program of a hundred of them is as long as that of two.

    Args:
        function: Of one value; pure.
        values: PyTrees of arrays.
    """
    kinds: dict[object, list[int]] = {}
    for n, value in enumerate(values):
        leaves, tree = jax.tree.flatten(value)
        of_arrays = tuple((jnp.shape(x), jnp.result_type(x)) for x in leaves)
        kinds.setdefault((tree, of_arrays), []).append(n)
    found: dict[int, R] = {}
    for members in kinds.values():
        if len(members) == 1:
            found[members[0]] = function(values[members[0]])
            continue
        stacked = jax.tree.map(lambda *x: jnp.stack(x), *(values[n] for n in members))
        given = jax.vmap(function)(stacked)
        for place, n in enumerate(members):
            found[n] = jax.tree.map(lambda x, place=place: x[place], given)
    return [found[n] for n in range(len(values))]
