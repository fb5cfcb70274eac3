r"""The waves laws of a blast, each as one curve in the logarithm of scaled distance.

A load asks at every step of every flight, and the laws themselves (polynomials blended
at joins, Chebyshev series, Newton's steps for the decay) cost more than the flight. So
they are tabulated once, for 1 kg in standard air: a cubic spline over even steps of
$\ln Z$ of 0.02. Arrival is within 1e-6 of its law, peak 1e-5, duration 2e-3 (at the
joins, which the spline rounds off).

- $c_0 t_a/R$ and peak: `shock_kinematics`, that is Kingery and Bulmash up to Z = 20,
  the weak-shock tail from there;
- duration, and decay by the incident impulse: Kingery and Bulmash. Outside the range of
  their durations the decay is held; it is kept at 0.1 and above (free air past Z = 28
  falls to 0), which changes the impulse by 3 % at most;
- suction: UFC 3-340-02, on the surface for `ground_factor` times the mass. Past its
  last point it is held as a share of the peak.

Nearer than Z = 0.07 everything is as it is there; past Z = 1000 a power law.
"""

from functools import cache
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.constants import STANDARD_PRESSURE, STANDARD_SOUND_SPEED
from jblast.waves.friedlander import friedlander_decay
from jblast.waves.ground_factor import ground_factor
from jblast.waves.hermite_curve import HermiteCurve
from jblast.waves.kingery_bulmash import (
    kingery_bulmash_duration,
    kingery_bulmash_impulse,
    kingery_bulmash_pressure,
)
from jblast.waves.log_spline import natural_log_spline
from jblast.waves.negative_phase_ufc import ufc_negative_pressure
from jblast.waves.shock_kinematics import (
    shock_kinematics_arrival_time,
    shock_kinematics_pressure,
)

FIRST, LAST = 0.07, 1000.0
"""Scaled distances that the curves span [m/kg^(1/3)]."""
SPACING = 0.02
RANGE = {"surface": (0.178, 40.0), "free-air": (0.147, 36.975)}
"""Where all the laws hold: durations start later than pressures, and suctions in free
air end sooner [m/kg^(1/3)]."""
LEAST_DECAY = 0.1


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
    arrival = shock_kinematics_arrival_time(z, 1.0, burst=burst)
    peak = shock_kinematics_pressure(z, 1.0, burst=burst)
    held = jnp.clip(z, first, 40.0)
    duration = kingery_bulmash_duration(held, 1.0, burst=burst)
    decay = friedlander_decay(
        kingery_bulmash_pressure(held, 1.0, burst=burst),
        kingery_bulmash_impulse(held, 1.0, burst=burst),
        duration,
    )
    within = jnp.minimum(z, last)
    mass = ground_factor(within, 1.0) if burst == "surface" else 1.0
    suction = ufc_negative_pressure(within, mass)
    suction = suction * (peak / shock_kinematics_pressure(within, 1.0, burst=burst))
    return (
        STANDARD_SOUND_SPEED * arrival / z,
        peak / STANDARD_PRESSURE,
        kingery_bulmash_duration(z, 1.0, burst=burst),
        jnp.exp(jnp.maximum(decay, LEAST_DECAY)),
        suction / STANDARD_PRESSURE,
    )
