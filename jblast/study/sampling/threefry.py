"""What `jax.random` draws of many keys, in fewer passes over them.

On a CPU it goes through a hash in five passes of a loop, of each key for itself. Here
the rounds stand in one expression of all keys, which XLA writes as one pass in vector
instructions. The hash is Threefry-2x32 of 20 rounds (Salmon et al. 2011); the numbers
are those of `jax.random`, to the last bit.
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Float, Key, UInt32, UInt64

ROTATIONS = (13, 15, 26, 6), (17, 29, 16, 24)
PARITY = np.uint32(0x1BD11BDA)
ONE = np.uint64(0x3FF0000000000000)
"""Bits of 1.0."""
LEAST = np.nextafter(-1.0, 0.0)
"""From which on a uniform number is made a normal one."""

Word = UInt32[Array, "..."] | np.uint32


def hashed(first: Word, second: Word, high: Word, low: Word) -> UInt64[Array, "..."]:
    """Return the hash of two words by a key of two, both in one number."""
    keys = first, second, first ^ second ^ PARITY
    x, y = high + keys[0], low + keys[1]
    for five in range(5):
        for turn in ROTATIONS[five % 2]:
            x = x + y
            y = x ^ ((y << np.uint32(turn)) | (y >> np.uint32(32 - turn)))
        x = x + keys[(five + 1) % 3]
        y = y + keys[(five + 2) % 3] + np.uint32(five + 1)
    # one number, or XLA goes through the rounds once for each word
    return (x.astype(jnp.uint64) << np.uint64(32)) | y.astype(jnp.uint64)


def folded(keys: Key[Array, "..."], data: Any) -> Key[Array, "..."]:
    """Return keys with a whole number below 2^32 folded in; broadcasting."""
    if not is_here(keys):
        shape = jnp.broadcast_shapes(keys.shape, jnp.shape(data))
        fold = jax.random.fold_in
        for _ in shape:
            fold = jax.vmap(fold)
        return fold(jnp.broadcast_to(keys, shape), jnp.broadcast_to(data, shape))
    none = np.uint32(0)
    pairs = words_of(hashed(*words(keys), none, jnp.asarray(data, jnp.uint32)))
    return jax.random.wrap_key_data(jnp.stack(pairs, -1))


def normals(keys: Key[Array, " key"], count: int) -> Float[Array, "key number"]:
    """Return so many standard normal numbers of each key."""
    if not is_here(keys):
        return jax.vmap(lambda key: jax.random.normal(key, (count,)))(keys)
    first, second = words(keys)
    pairs = (first.astype(jnp.uint64) << np.uint64(32)) | second.astype(jnp.uint64)

    def bits_of(nth: UInt32[Array, ""]) -> UInt64[Array, " key"]:
        # no count is as large, which XLA does not know: it would take the words out of
        # the loop, and go through the rounds that make them once for each
        own = words_of(pairs ^ (nth >> np.uint32(31)).astype(jnp.uint64))
        return hashed(*own, np.uint32(0), nth)

    # a loop, so that bits are there once for all that is done with them
    bits = lax.map(bits_of, jnp.arange(count, dtype=jnp.uint32))
    unit = lax.bitcast_convert_type((bits >> np.uint64(12)) | ONE, jnp.float64) - 1.0
    even = jnp.maximum(LEAST, unit * (1.0 - LEAST) + LEAST)
    return (np.sqrt(2.0) * lax.erf_inv(even)).T


def is_here(keys: Key[Array, "..."]) -> bool:
    """Whether numbers of these keys are drawn here: of Threefry, in float64."""
    ours = str(jax.random.key_impl(keys)) == "threefry2x32"
    streams = jax.config.jax_threefry_partitionable  # pyright: ignore[reportAttributeAccessIssue]  as JAX says to read it
    return bool(ours and streams and jnp.zeros(()).dtype == jnp.float64)


def words(keys: Key[Array, "..."]) -> tuple[Array, Array]:
    """Return the two words of each key."""
    data = jax.random.key_data(keys)
    return data[..., 0], data[..., 1]


def words_of(pair: UInt64[Array, "..."]) -> tuple[Array, Array]:
    """Return the two words of a number."""
    return (pair >> np.uint64(32)).astype(jnp.uint32), pair.astype(jnp.uint32)
