"""The numbers of samples: drawn by their priors, or set by axes.

A sample's key is that of the study folded with the sample's number, so it is the same
whoever calculates it, and when. Folded with 0 it draws the numbers, with the number of
a family what that family draws.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, Key, PRNGKeyArray, UInt32

from jblast.parameters import UNBOUNDED
from jblast.scene import UncertainScene, parameter_named
from jblast.scene.uncertain import Prior
from jblast.study.file.study import Axis
from jblast.study.sampling.threefry import folded, normals

OF_NUMBERS = 0
"""Folded into a sample's key for the draws of the scene's numbers."""


def key_of_study(seed: int, high: int = 0) -> PRNGKeyArray:
    """Return the key that samples are folded into.

    Args:
        seed: Of the study.
        high: Of a sample's number what is above 32 bits; folded in where there is any.
    """
    key = jax.random.key(seed)
    return jax.random.fold_in(key, high) if high else key


def sample_keys(
    key: PRNGKeyArray, index: UInt32[Array, " sample"]
) -> Key[Array, " sample"]:
    """Return the keys of samples by their numbers."""
    return folded(key, index)


def part_of(keys: Key[Array, " sample"], number: int) -> Key[Array, " sample"]:
    """Return of each sample's key the part for one purpose."""
    return folded(keys, number)


def normal_scores(
    keys: Key[Array, " sample"], count: int
) -> Float[Array, "sample drawn"]:
    """Return standard normal draws, of which priors make the numbers."""
    if not count:
        return jnp.zeros((keys.shape[0], 0))
    return normals(part_of(keys, OF_NUMBERS), count)


def numbers_at(
    uncertain: UncertainScene,
    scores: Float[Array, "sample drawn"],
    axes: Sequence[Axis],
    table: Float[Array, "cell axis"],
    cell: Int[Array, " sample"],
) -> dict[str, Float[Array, " sample"]]:
    """Return the numbers of samples by name: drawn ones, then those of axes.

    Args:
        uncertain: The scene and its priors.
        scores: Standard normal coordinates of the draws.
        axes: Over numbers.
        table: Their values by cell.
        cell: Of each sample.
    """
    beliefs: Mapping[str, Prior] = uncertain.beliefs  # pyright: ignore[reportAssignmentType]  the reader refuses free ones
    found = {
        name: belief.constrain(scores[:, n])
        for n, (name, belief) in enumerate(beliefs.items())
    }
    for n, axis in enumerate(axes):
        found[axis.key] = table[cell, n]
    return found


def allowed(
    numbers: Mapping[str, Float[Array, " sample"]],
) -> Bool[Array, " sample"] | None:
    """Return which samples have numbers that there can be; None: whatever is drawn."""
    inside = None
    for name, values in numbers.items():
        bounds = parameter_named(name).bounds
        if bounds != UNBOUNDED:
            good: Any = bounds.allows(values)  # pyright: ignore[reportCallIssue, reportArgumentType]  arrays of JAX compare alike
            inside = good if inside is None else inside & good
    return inside
