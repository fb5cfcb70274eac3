r"""The negative phase of a blast wave, as a cubic in time.

$$p(t) = -\tfrac{27}{4}\,P^-\,s\,(1-s)^2, \qquad s = \frac{t - t_d}{t^-}, \quad
  0 \le s \le 1$$

Granstrom (1956), read in NAVFAC DM-2.08, eq. 14a, where 27/4 is written 6.75. Lowest at
$s = 1/3$, with $-P^-$; the impulse is $-\tfrac{9}{16} P^- t^-$.

At its end the pressure and its slope are zero, so it meets the still air smoothly; its
curvature jumps. At its start the pressure is zero, as at the end of a Friedlander
pulse, and the slope is $-\tfrac{27}{4}P^-/t^-$, whatever the pulse had: a kink. The
slope at the kink is that of the negative phase.

Nothing here keeps $P^-$ below the ambient pressure, which no suction exceeds: that is
for the law which gives $P^-$, and ours do.
"""

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float

from jblast.types import as_float_arrays
from jblast.waves.arguments import checked


@checked
def negative_phase_pressure(
    time: Float[ArrayLike, "..."],
    duration: Float[ArrayLike, "..."],
    negative_pressure: Float[ArrayLike, "..."],
    negative_duration: Float[ArrayLike, "..."],
) -> Float[Array, "..."]:
    r"""Return the overpressure in the negative phase [Pa]; zero before and after it.

    Args:
        time: $t$ since arrival [s]; negative before.
        duration: Of the positive phase, $t_d$ [s], positive.
        negative_pressure: Greatest underpressure $P^-$ [Pa], positive.
        negative_duration: Of the negative phase, $t^-$ [s], positive.
    """
    time, duration, pressure, length = as_float_arrays(
        time, duration, negative_pressure, negative_duration
    )
    s = (time - duration) / length
    outside = (s < 0) | (s > 1)
    s = jnp.where(outside, 0.0, s)
    return jnp.where(outside, 0.0, -6.75 * pressure * s * (1.0 - s) ** 2)
