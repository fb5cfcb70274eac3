r"""A Friedlander pulse whose front takes a time to rise.

Real fronts rise in a time: by the thickness of a weak shock, by the ground and the
turbulence on the way, and in every gauge. A sharp front has no derivative by its
arrival time; this pulse has one everywhere.

It is the sharp pulse $p_F$ seen through two equal lags, as by a critically damped
gauge:

$$p(t) = \int_0^t p_F(u)\,\frac{t-u}{\tau^2}\,e^{-(t-u)/\tau}\,du$$

A construction, not a law of the front's shape. With $x = t/\tau$, $\beta = b/t_d$,
$w = (\beta - 1/\tau)\,t$ and the integrals $k$ of `friedlander_integrals.py` it is

$$p = P_s\,x^2\,e^{-x} \left[k(w) + \frac{t}{t_d}\,k'(w)\right]$$

Pressure and slope are zero up to the arrival, exactly, and leave it smoothly ($t^2$);
the curvature jumps there. The kernel has the integral one, so the whole record keeps
its impulse for $b > 0$: $P_s t_d (1/b - 1/b^2)$. As the rise time goes to zero the
sharp pulse comes back, with a difference of $(1 + b)\,2\tau/t_d$ of $P_s$ behind the
front: the lag is $2\tau$, and the peak is lower than $P_s$.
"""

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float

from jblast.types import as_float_arrays
from jblast.waves.arguments import checked
from jblast.waves.waveform.friedlander_integrals import (
    impulse_fraction,
    late_fraction,
    middle_fraction,
)

RISE_OVER_LAG = 3.3579086
r"""From 10 to 90 % of a step $1 - (1 + x)\,e^{-x}$: x from 0.5318116 to 3.8897202."""


@checked
def finite_rise_pressure(
    time: Float[ArrayLike, "..."],
    peak_overpressure: Float[ArrayLike, "..."],
    duration: Float[ArrayLike, "..."],
    decay: Float[ArrayLike, "..."],
    rise_time: Float[ArrayLike, "..."],
) -> Float[Array, "..."]:
    r"""Return the overpressure of a pulse with a finite rise [Pa].

    Args:
        time: $t$ since the first of it arrives [s]; negative before.
        peak_overpressure: $P_s$ of the sharp pulse [Pa], positive.
        duration: Of its positive phase, $t_d$ [s], positive.
        decay: Its $b$ [-].
        rise_time: From 10 to 90 % of a step [s], positive: $3.358\,\tau$.
    """
    time, peak, duration, decay, rise_time = as_float_arrays(
        time, peak_overpressure, duration, decay, rise_time
    )
    before = time < 0
    t = jnp.where(before, 0.0, time)
    phase, x = t / duration, t * (RISE_OVER_LAG / rise_time)
    w = decay * phase - x
    # e^-x k(w) with the larger exponential taken out, so that neither overflows:
    # e^w k(w) = g(-w), and -k' is the same for w and -w but for that factor.
    slow = w < 0
    exponent = jnp.where(slow, decay * phase, x)
    size = jnp.where(slow, -w, w)  # not abs: it has no slope at zero, this has
    kept = jnp.where(slow, late_fraction(size), impulse_fraction(size))
    shape = kept - phase * middle_fraction(size)
    return jnp.where(before, 0.0, peak * x * x * jnp.exp(-exponent) * shape)
