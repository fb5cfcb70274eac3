"""Which samples of a record stand at the end of its scale."""

import jax.numpy as jnp
from jaxtyping import Array, Float, Int

NEAR = 0.999
"""A sample of this share of the full scale is clipped: codes end a bit below it."""

IN_A_ROW = 3
"""Without a full scale, as many equal samples that no other exceeds are."""

LEAST_SUCTION = 0.03
"""A floor is the scale's end only if as deep a share of the record's height: else it is
the quiet, told in few bits."""


def clipped_samples(
    samples: Float[Array, "*batch sample"],
    count: Int[Array, "*batch"],
    full_scale: Float[Array, "..."] | None,
) -> Float[Array, "*batch sample"]:
    """Return +1 where a sample is only a lower bound, -1 where an upper one, else 0.

    Args:
        samples: Overpressure.
        count: How many are the record's: the last of those repeats behind it, and is
            not clipped for that.
        full_scale: Largest size of a sample, of all or [*batch, 1]; None: nobody said.
    """
    index = jnp.arange(samples.shape[-1])
    inside = jnp.expand_dims(index, range(count.ndim)) < count[..., None]
    if full_scale is not None:
        high = inside & (samples >= NEAR * full_scale)
        low = inside & (samples <= -NEAR * full_scale)
    else:
        top = jnp.max(samples, axis=-1, keepdims=True)
        bottom = jnp.min(samples, axis=-1, keepdims=True)
        begin = samples[..., :1]
        deep = begin - bottom > LEAST_SUCTION * (top - begin)
        # neither a record of one value nor one that begins at its top was clipped there
        high = _in_a_row(inside & (samples == top) & (top > begin))
        low = _in_a_row(inside & (samples == bottom) & deep & (bottom < begin))
    kind = samples.dtype
    return high.astype(kind) - low.astype(kind)


def _in_a_row(equal):
    """Return which samples are in a stretch of `IN_A_ROW` such samples or more."""
    n = equal.shape[-1]
    many = IN_A_ROW - 1
    edge = [(0, 0)] * (equal.ndim - 1)
    padded = jnp.pad(equal, [*edge, (many, many)])
    # whether all are, of a stretch that begins at each place
    runs = padded[..., : n + many]
    for k in range(1, IN_A_ROW):
        runs = runs & padded[..., k : k + n + many] if k < many + 1 else runs
    found = runs[..., :n]
    for k in range(1, IN_A_ROW):
        found = found | runs[..., k : k + n]
    return found
