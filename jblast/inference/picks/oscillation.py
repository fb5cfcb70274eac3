r"""A damped oscillation, made of additions and products alone.

XLA calls a library for each sine and each cosine in double precision: of a ring these
are most of the cost. Here both are polynomials of what the phase has past a multiple of
$\pi/2$, for many instants in one loop (Cody and Waite 1980, "Software Manual for the
Elementary Functions"; coefficients of the Cephes library, Moshier 1989).
"""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

QUARTER = (201.0 / 128.0, 4.837512969970703125e-4, 7.549789954891882e-8)
r"""$\pi/2$ in three parts, the first two of few digits: multiples of them are exact."""

SINE = (
    1.58962301576546568060e-10,
    -2.50507477628578072866e-8,
    2.75573136213857245213e-6,
    -1.98412698295895385996e-4,
    8.33333333332211858878e-3,
    -1.66666666666666307295e-1,
)
COSINE = (
    -1.13585365213876817300e-11,
    2.08757008419747316778e-9,
    -2.75573141792967388112e-7,
    2.48015872888517045348e-5,
    -1.38888888888730564116e-3,
    4.16666666666665929218e-2,
)


def oscillation(
    rate: Float[Array, ""], turn: Float[Array, ""], elapsed: Float[Array, " instant"]
) -> tuple[Float[Array, " instant"], Float[Array, " instant"]]:
    r"""Return real and imaginary part of $e^{(r + i w) t}$.

    Args:
        rate: $r$.
        turn: $w$.
        elapsed: $t$; of a phase $w t$ beyond 1e8 the digits are lost.
    """
    size = jnp.exp(rate * elapsed)
    sine, cosine = sine_and_cosine(turn * elapsed)
    return size * cosine, size * sine


def sine_and_cosine(
    phase: Float[Array, "..."],
) -> tuple[Float[Array, "..."], Float[Array, "..."]]:
    """Return both, to two units in the last place of 1.

    Args:
        phase: Below 1e8 in double precision, 1e4 in single [rad].
    """
    turns = jnp.round(phase * (2.0 / np.pi))
    x = phase
    for part in QUARTER:
        x = x - turns * part
    square = x * x
    sine = x + x * square * _polynomial(SINE, square)
    cosine = 1.0 - 0.5 * square + square * square * _polynomial(COSINE, square)
    quadrant = turns - 4.0 * jnp.floor(0.25 * turns)
    odd = (quadrant == 1.0) | (quadrant == 3.0)
    sine, cosine = jnp.where(odd, cosine, sine), jnp.where(odd, sine, cosine)
    return (
        jnp.where(quadrant >= 2.0, -sine, sine),
        jnp.where((quadrant == 1.0) | (quadrant == 2.0), -cosine, cosine),
    )


def _polynomial(coefficients, x):
    """Return a polynomial, its highest power first."""
    value = jnp.full_like(x, coefficients[0])
    for coefficient in coefficients[1:]:
        value = value * x + coefficient
    return value
