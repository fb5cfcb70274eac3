r"""How long the front of a weak shock takes to rise.

$$\tau = \frac{\tau_0}{1 + \tau_0/\tau_m}, \qquad
  \tau_0 = \frac{0.0479\ \text{Pa s}}{P}, \qquad
  \tau_m = \frac{i}{P}\left(1 - \frac{i}{P t_d}\right)$$

A weak shock steepens until what the air takes of it holds the balance: its thickness is
inverse to its pressure (Landau and Lifshitz 1987, Fluid Mechanics, art. 93). The
constant is the rule of thumb of sonic booms, 1 ms at 1 psf = 47.9 Pa, where relaxation
of nitrogen and oxygen sets it: from memory, declared, not measured. Turbulence and dry
air make it several times as long (3 ms at 1 psf is used too).

So it is 0.5 us at 1 bar, less than any sample; 8 us at 6 kPa (Z = 20 on the surface),
0.05 ms at Z = 100 and 0.7 ms at 1000, whatever the charge. For small charges far away
that would be longer than the pulse, which has then stopped steepening: $\tau_m$, a
harmonic bound below the time that its impulse fills at its peak, keeps the rise such
that a pulse with these values exists (`pulse.py`).
"""

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float

from jblast.types import as_float_arrays
from jblast.waves.arguments import checked

RISE_TIME_TIMES_PEAK = 1e-3 * 47.88
"""Of a weak shock in air, declared [Pa s]."""


@checked
def weak_shock_rise_time(
    peak_overpressure: Float[ArrayLike, "..."],
    impulse: Float[ArrayLike, "..."],
    duration: Float[ArrayLike, "..."],
) -> Float[Array, "..."]:
    """Return the time from zero to the peak [s].

    Args:
        peak_overpressure: $P$ [Pa], positive.
        impulse: Of the positive phase $i$ [Pa s], less than peak times duration.
        duration: Of the positive phase $t_d$ [s], positive.
    """
    peak, impulse, duration = as_float_arrays(peak_overpressure, impulse, duration)
    filled = impulse / peak
    longest = filled * jnp.maximum(1.0 - filled / duration, 0.0)
    steady = RISE_TIME_TIMES_PEAK / peak
    return steady * longest / (steady + longest)
