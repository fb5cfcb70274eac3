"""Parameter values of samples, from priors, axes and designs.

A sample's key is that of the study folded with the sample's number, so it does not
depend on where or when the sample is calculated. Folded with 0 it draws the parameters,
with the number of an outcome family the random numbers of that family.

The design "sobol" places samples in the unit cube. Sobol' points are scrambled by the
seed, so that they are unbiased, and can be made from any index on.

Random numbers are those of `jax.random`, to the last bit, in fewer passes: on a CPU JAX
evaluates its hash in five passes of a loop for each key. Here the rounds are one
expression over all keys, which XLA compiles to one pass in vector instructions. The
hash is Threefry-2x32 with 20 rounds (Salmon et al. 2011).
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Bool, Float, Int, Key, UInt32, UInt64
from scipy.special import ndtri
from scipy.stats import qmc

from jblast.parameters import UNBOUNDED
from jblast.scene import UncertainScene, parameter_named
from jblast.scene.uncertain import Prior
from jblast.study.file import Axis, Design

BITS = 32
"""Bits of a Sobol' point, of which there are 2^32. With more, SciPy does not skip
points."""
Points = Callable[[int, int], Float[np.ndarray, "draw dimension"]]
"""Function from the first sample and a count to standard normal coordinates."""
OF_NUMBERS = 0
"""Number folded into a sample's key for the parameters of the scene."""
ROTATIONS = (13, 15, 26, 6), (17, 29, 16, 24)
"""Rotations of Threefry-2x32, alternating for groups of rounds (Salmon et al. 2011)."""
PARITY = np.uint32(0x1BD11BDA)
"""Parity constant of its key schedule, from Skein."""
ONE = np.uint64(0x3FF0000000000000)
"""Bits of the float 1.0: random bits in its fraction give a number in [1, 2)."""
LOWEST_UNIFORM = np.nextafter(-1.0, 0.0)
"""Lower bound of the uniform numbers: at -1 itself the normal number is infinite."""
Word = UInt32[Array, "..."] | np.uint32


def points_of(design: Design, dimensions: int, seed: int) -> Points | None:
    """Return the points of a design; None for random samples from keys.

    Args:
        design: Kind of samples.
        dimensions: Number of sampled parameters.
        seed: Seed of the design.
    """
    if design == "random" or dimensions == 0:
        return None

    def sobol(begin: int, count: int) -> np.ndarray:
        # an engine for each call: threads compute slabs in any order
        engine = qmc.Sobol(dimensions, scramble=True, bits=BITS, rng=seed)
        if begin:  # SciPy rejects a step of 0
            engine.fast_forward(begin)
        # 0 and 1 would be infinite: the bounds are the finest step of a float near 1
        tiny = 2.0**-53
        with np.errstate(all="ignore"):
            return ndtri(np.clip(engine.random(count), tiny, 1 - tiny))

    return sobol


def normal_scores(
    keys: Key[Array, " sample"], count: int
) -> Float[Array, "sample drawn"]:
    """Return standard normal samples, which priors convert to parameters."""
    if not count:
        return jnp.zeros((keys.shape[0], 0))
    return normals(folded(keys, OF_NUMBERS), count)


def numbers_at(
    uncertain: UncertainScene,
    scores: Float[Array, "sample drawn"],
    axes: Sequence[Axis],
    table: Float[Array, "cell axis"],
    cell: Int[Array, " sample"],
) -> dict[str, Float[Array, " sample"]]:
    """Return the parameters of samples by name: sampled ones, then those of axes.

    Args:
        uncertain: Scene with its priors.
        scores: Standard normal coordinates of the samples.
        axes: Axes over parameters.
        table: Values of the axes by cell.
        cell: Cell of each sample.
    """
    beliefs: Mapping[str, Prior] = uncertain.beliefs  # type: ignore  the reader refuses free ones
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
    """Return a mask of samples within the bounds of parameters; None without bounds."""
    inside = None
    for name, values in numbers.items():
        bounds = parameter_named(name).bounds
        if bounds != UNBOUNDED:
            good: Any = bounds.allows(values)  # type: ignore  arrays of JAX compare alike
            inside = good if inside is None else inside & good
    return inside


def hashed(first: Word, second: Word, high: Word, low: Word) -> UInt64[Array, "..."]:
    """Return the hash of two words with a key of two words, as one 64-bit number."""
    keys = first, second, first ^ second ^ PARITY
    x, y = high + keys[0], low + keys[1]
    for five in range(5):
        for turn in ROTATIONS[five % 2]:
            x = x + y
            y = x ^ ((y << np.uint32(turn)) | (y >> np.uint32(32 - turn)))
        x = x + keys[(five + 1) % 3]
        y = y + keys[(five + 2) % 3] + np.uint32(five + 1)
    # one 64-bit number: for two outputs XLA would compute all rounds twice
    return (x.astype(jnp.uint64) << np.uint64(32)) | y.astype(jnp.uint64)


def folded(keys: Key[Array, "..."], data: Any) -> Key[Array, "..."]:
    """Return keys with an integer below 2^32 folded in; arguments are broadcast."""
    if not is_supported(keys):
        shape = jnp.broadcast_shapes(keys.shape, jnp.shape(data))
        fold = jax.random.fold_in
        for _ in shape:
            fold = jax.vmap(fold)
        return fold(jnp.broadcast_to(keys, shape), jnp.broadcast_to(data, shape))
    none = np.uint32(0)
    # as `jax.random.fold_in`: a 64-bit counter whose upper word is 0
    pairs = words_of(hashed(*words(keys), none, jnp.asarray(data, jnp.uint32)))
    return jax.random.wrap_key_data(jnp.stack(pairs, -1))


def normals(keys: Key[Array, " key"], count: int) -> Float[Array, "key number"]:
    """Return `count` standard normal numbers of each key."""
    if not is_supported(keys):
        return jax.vmap(lambda key: jax.random.normal(key, (count,)))(keys)
    first, second = words(keys)
    pairs = (first.astype(jnp.uint64) << np.uint64(32)) | second.astype(jnp.uint64)

    def bits_of(nth: UInt32[Array, ""]) -> UInt64[Array, " key"]:
        # `nth >> 31` is 0, but XLA cannot know it: else it would move the words out of
        # the loop, and compute the rounds of `pairs` once for each of them
        own = words_of(pairs ^ (nth >> np.uint32(31)).astype(jnp.uint64))
        return hashed(*own, np.uint32(0), nth)

    # a loop, so that bits are stored once: in one expression XLA would recompute them
    bits = lax.map(bits_of, jnp.arange(count, dtype=jnp.uint32))
    unit = lax.bitcast_convert_type((bits >> np.uint64(12)) | ONE, jnp.float64) - 1.0
    # the scaling of `jax.random.uniform`, to the last bit
    even = jnp.maximum(LOWEST_UNIFORM, unit * (1.0 - LOWEST_UNIFORM) + LOWEST_UNIFORM)
    return (np.sqrt(2.0) * lax.erf_inv(even)).T


def is_supported(keys: Key[Array, "..."]) -> bool:
    """Return whether this module computes numbers of keys: Threefry, in float64."""
    ours = str(jax.random.key_impl(keys)) == "threefry2x32"
    streams = jax.config.jax_threefry_partitionable  # type: ignore  the documented attribute
    return bool(ours and streams and jnp.zeros(()).dtype == jnp.float64)


def words(keys: Key[Array, "..."]) -> tuple[Array, Array]:
    """Return the two words of each key."""
    data = jax.random.key_data(keys)
    return data[..., 0], data[..., 1]


def words_of(pair: UInt64[Array, "..."]) -> tuple[Array, Array]:
    """Return the two words of a 64-bit number."""
    return (pair >> np.uint64(32)).astype(jnp.uint32), pair.astype(jnp.uint32)
