r"""The waves laws of a blast, each as one curve in the logarithm of scaled distance.

A load asks at every step of every flight, and the laws themselves (polynomials blended
at joins, Chebyshev series, Newton's steps for the decay) cost more than the flight. So
they are tabulated once, for 1 kg in standard air: a cubic spline over even steps of
$\ln Z$ of 0.02. Arrival is within 1e-6 of its law, peak 1e-5, duration 2e-3 (at the
joins, which the spline rounds off).

All are those of `waves.waveform.blast_pulse`. Outside the range in which they all hold
the decay is held, above 0.13 everywhere; past its last point the suction is held as a
share of the peak.

Nearer than Z = 0.07 everything is as it is there; past Z = 1000 a power law.
"""

from functools import cache
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.constants import STANDARD_PRESSURE, STANDARD_SOUND_SPEED
from jblast.waves.curves.hermite import HermiteCurve
from jblast.waves.curves.log_spline import natural_log_spline
from jblast.waves.waveform.blast_pressure import blast_pulse

FIRST, LAST = 0.07, 1000.0
"""Scaled distances that the curves span [m/kg^(1/3)]."""
SPACING = 0.02
RANGE = {"surface": (0.178, 40.0), "free-air": (0.147, 36.975)}
"""Where all the laws hold: durations start later than pressures, and suctions in free
air end sooner [m/kg^(1/3)]."""


class WaveCurves(NamedTuple):
    """Each against ln Z.

    Attributes:
        sound_fraction: $c_0 t_a/R$, in ln.
        peak: $p/P_0$, in ln.
        duration: $t_d$ of 1 kg in standard air, in ln [s].
        decay: $b$ itself [-].
        suction: $P^-/P_0$, in ln.
    """

    sound_fraction: HermiteCurve
    peak: HermiteCurve
    duration: HermiteCurve
    decay: HermiteCurve
    suction: HermiteCurve


@cache
def wave_curves(burst: str) -> WaveCurves:
    """Tabulate the laws of a burst, "surface" or "free-air"."""
    count = int(np.ceil(np.log(LAST / FIRST) / SPACING)) + 1
    z = np.geomspace(FIRST, LAST, count)
    with jax.ensure_compile_time_eval():
        columns = [
            np.asarray(x, float)
            for x in jax.jit(_laws, static_argnums=1)(jnp.asarray(z), burst)
        ]
    return WaveCurves(*(natural_log_spline(z, column) for column in columns))


def _laws(z: Float[Array, " node"], burst: str) -> tuple[Float[Array, " node"], ...]:
    """Return what the curves pass through; the decay as its exponential."""
    first, last = RANGE[burst]
    places = jnp.concatenate([z, jnp.clip(z, first, last), jnp.minimum(z, last)])
    found = blast_pulse(places, 1.0, burst=burst)
    pulse, held, within = (
        jax.tree.map(lambda x, n=n: x[n * z.size : (n + 1) * z.size], found)
        for n in range(3)
    )
    return (
        STANDARD_SOUND_SPEED * pulse.arrival_time / z,
        pulse.peak / STANDARD_PRESSURE,
        pulse.duration,
        jnp.exp(held.decay),
        within.suction * (pulse.peak / within.peak) / STANDARD_PRESSURE,
    )
