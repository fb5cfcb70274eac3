r"""Event counts that have gradients: a staircase with rounded steps.

The hard camera counts $\lfloor u \rfloor$ events for a change of $u$ thresholds. Here
each step k is a logistic, $\sum_k 1 / (1 + \exp((k - u) / T))$, and the reference
moves by what was counted. As the temperature T goes to 0 the counts become those of
`ideal_events`. At T a still pixel sends about $e^{-1/T}$ events a frame: 5e-5 at 0.1.
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float


def smooth_counts(
    log_frames: Float[Array, "frame height width"],
    thresholds: tuple[Float[ArrayLike, "..."], Float[ArrayLike, "..."]],
    temperature: Float[ArrayLike, ""],
    *,
    most: int = 16,
) -> tuple[
    Float[Array, "interval height width"], Float[Array, "interval height width"]
]:
    """Return the smooth counts of brighter and darker events of each interval.

    Args:
        log_frames: Logarithm of the light.
        thresholds: Positive and negative, as positive numbers.
        temperature: Width of a step, in thresholds: 0.05 to 0.2.
        most: Events a pixel can send in an interval; steps beyond are not counted.
    """
    positive, negative = (jnp.asarray(threshold) for threshold in thresholds)
    steps = jnp.arange(1, most + 1, dtype=log_frames.dtype)[:, None, None]

    def staircase(change):
        return jax.nn.sigmoid((change[None] - steps) / temperature).sum(axis=0)

    def step(level, log_light):
        change = log_light - level
        up, down = staircase(change / positive), staircase(-change / negative)
        return level + up * positive - down * negative, (up, down)

    return jax.lax.scan(step, log_frames[0], log_frames[1:])[1]
