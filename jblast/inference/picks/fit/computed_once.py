"""What XLA would compute again wherever it is used, made so that it is computed once.

It fuses cheap and dear operations alike into the loops that use them: a cosine into
each of its three uses, a series of a complex number into each of two hundred instants.
What a loop or a product of matrices makes it leaves alone.
"""

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Float


@jax.custom_jvp
def oscillation(
    rate: Float[Array, ""], turn: Float[Array, ""], elapsed: Float[Array, " instant"]
) -> tuple[Float[Array, " instant"], Float[Array, " instant"]]:
    r"""Return real and imaginary part of $e^{(r + i w) t}$.

    Args:
        rate: $r$.
        turn: $w$.
        elapsed: $t$.
    """

    def part(phase):
        return jnp.exp(rate * elapsed) * jnp.cos(turn * elapsed - phase)

    both = lax.map(part, jnp.asarray([0.0, 0.5 * np.pi], rate.dtype))
    return both[0], both[1]


@oscillation.defjvp
def _oscillation_jvp(primals, tangents):
    rate, turn, elapsed = primals
    cos, sin = oscillation(*primals)
    more, farther, later = tangents
    grown = more * elapsed + rate * later
    moved = farther * elapsed + turn * later
    return (cos, sin), (grown * cos - moved * sin, grown * sin + moved * cos)


@jax.custom_jvp
def polynomial(
    terms: Float[Array, " term"], x: Float[Array, " instant"]
) -> Float[Array, " instant"]:
    """Return a polynomial.

    Args:
        terms: Its coefficients, the constant one first.
        x: Where.
    """
    return terms @ _powers(terms.shape[0], x)


@polynomial.defjvp
def _polynomial_jvp(primals, tangents):
    (terms, x), (other, moved) = primals, tangents
    orders = np.arange(1, terms.shape[0]).astype(terms.dtype)
    slope = polynomial(terms[1:] * orders, x)
    powers = _powers(terms.shape[0], x)
    return terms @ powers, other @ powers + slope * moved


def _powers(many, x):
    """Return powers of numbers, [power, number]."""
    made = [jnp.ones_like(x)]
    for _ in range(many - 1):
        made.append(made[-1] * x)
    return jnp.stack(made)
