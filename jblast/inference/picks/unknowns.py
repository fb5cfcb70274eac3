r"""What of a record is unknown, and what is believed of it beforehand.

Times are counted in samples from the front's, pressures in the record's largest: so a
record in another unit, or on another clock, is picked as the same. What is positive
for sure is unknown by its logarithm:

| unknown | believed |
|---|---|
| arrival, $\ln P$, $\ln t_d$ | anything |
| $\ln(1 + b)$ | 0.6, sd 0.7 |
| $\ln \tau'$ | one sample, sd 2 |
| $P^-/P$ | 0.3, sd 0.2 |
| $\ln t^-/t_d$ | 2.4, sd 0.5 |
| drift: level, slope, bend, twist | 0, sd 1, 0.5, 0.3, 0.2 |

Between Z = 2 and 300 the laws (shock kinematics on the ground) have the decay $b$ from
0.4 to 2.9, $P^-/P$ from 0.12 to 0.49 and $t^-/t_d$ from 1.8 to 4.5; below $b = -1$ a
pulse would rise behind its front. A weak shock rises in 0.2 us to
0.2 ms (`rise_time.py`), and instruments add about a sample. The standard deviations are
twice what these ranges ask for: what a record tells goes before what laws say. Many a
record has no negative phase at all, which the logarithm of one would make impossible:
the search would shorten the positive phase to make room for one. So the suction is
unknown as it is, and where there is none noise may make it less.

The rise is $\tau = \tau'/(1 + \tau'/t_d)$ of the unknown $\tau'$: never longer than the
positive phase.
"""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.waves.waveform.friedlander_integrals import impulse_fraction
from jblast.waves.waveform.pulse import Pulse

NAMES = (
    "arrival",
    "ln_peak",
    "ln_duration",
    "ln_one_and_decay",
    "ln_rise",
    "suction",
    "ln_suction_duration",
    "level",
    "slope",
    "bend",
    "twist",
)
CENTRE = np.array([0.0, 0.0, 3.0, 0.6, 0.0, 0.3, np.log(2.4), *[0.0] * 4])
SPREAD = np.array([1e3, 5.0, 5.0, 0.7, 2.0, 0.2, 0.5, 1.0, 0.5, 0.3, 0.2])
PULSE_UNKNOWNS = 7

FURTHER = (
    *("ln_omega", "logit_damping", "ln_lag", "ln_height", "ln_stretch"),
    "ln_corner",
)
"""Unknown only where a record shows a sign of them: frequency [rad/sample] and damping
of a sensor that rings; lag [samples], peak and duration, both over the first one's, of
a further front; corner of a high-pass that nobody told of [1/sample]."""

FURTHER_CENTRE = np.array([0.0, -3.0, 3.0, np.log(0.5), 0.0, -5.0])
FURTHER_SPREAD = np.array([0.3, 1.0, 0.7, 1.0, 0.3, 1.5])
"""Frequency and lag are believed to be where they are seen."""


class Natural(NamedTuple):
    """A pulse in the words of a log, times in samples.

    Attributes:
        arrival: When it departs from zero.
        peak: Overpressure.
        duration: Of the positive phase.
        impulse: Of the positive phase.
        decay: Friedlander's $b$ behind the rise.
        rise: From zero to the peak.
        suction: Greatest underpressure; below zero where noise makes it so.
        suction_duration: Of the negative phase.
    """

    arrival: Float[Array, ""]
    peak: Float[Array, ""]
    duration: Float[Array, ""]
    impulse: Float[Array, ""]
    decay: Float[Array, ""]
    rise: Float[Array, ""]
    suction: Float[Array, ""]
    suction_duration: Float[Array, ""]


def natural_of(y: Float[Array, " unknown"]) -> Natural:
    """Return a pulse by its unknowns."""
    peak, duration, free = jnp.exp(y[1]), jnp.exp(y[2]), jnp.exp(y[4])
    decay = jnp.expm1(y[3])
    rise = free * duration / (free + duration)
    return Natural(
        arrival=y[0],
        peak=peak,
        duration=duration,
        impulse=peak * (0.5 * rise + (duration - rise) * impulse_fraction(decay)),
        decay=decay,
        rise=rise,
        suction=peak * y[5],
        suction_duration=duration * jnp.exp(y[6]),
    )


def free_rise(
    rise: Float[Array, ""], duration: Float[Array, "..."]
) -> Float[Array, "..."]:
    """Return what a rise is of, as `natural_of` has it: it stays below the duration."""
    return rise / (1.0 - rise / duration)


def following(natural: Natural, further: Float[Array, "6"]) -> Natural:
    """Return the pulse of a further front: of the first one's form.

    Args:
        natural: The first.
        further: See `FURTHER`.
    """
    height, stretch = jnp.exp(further[3]), jnp.exp(further[4])
    return natural._replace(
        arrival=natural.arrival + jnp.exp(further[2]),
        peak=natural.peak * height,
        duration=natural.duration * stretch,
        impulse=natural.impulse * height * stretch,
        rise=natural.rise * stretch,
        suction=natural.suction * height,
        suction_duration=natural.suction_duration * stretch,
    )


def pulse_by(natural: Natural) -> Pulse:
    """Return the wave of a pulse."""
    return Pulse(
        arrival_time=natural.arrival,
        peak=natural.peak,
        rise_time=natural.rise,
        duration=natural.duration,
        decay=natural.decay,
        suction=natural.suction,
        suction_duration=natural.suction_duration,
        hold_time=jnp.zeros_like(natural.peak),
    )
