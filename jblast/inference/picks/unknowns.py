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
pulse would rise behind its front. A weak shock rises in 0.2 us to 0.2 ms
(`waves/waveform.py`), and instruments add about a sample. The standard deviations are
twice what these ranges ask for: what a record tells goes before what laws say. Many a
record has no negative phase at all, which the logarithm of one would make impossible:
the search would shorten the positive phase to make room for one. So the suction is
unknown as it is, and where there is none noise may make it less.

The rise is $\tau = \tau'/(1 + \tau'/t_d)$ of the unknown $\tau'$: never longer than the
positive phase.
"""

from functools import partial
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Float

from jblast.waves.pulse import Pulse
from jblast.waves.waveform import impulse_fraction

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
    *("ln_corner", "shift"),
)
"""Unknown only where a record shows a sign of them: frequency [rad/sample] and damping
of a sensor that rings; lag [samples], peak and duration, both over the first one's, of
a further front; corner of a high-pass that nobody told of [1/sample]; step of the
baseline at the front, over the peak."""

FURTHER_CENTRE = np.array([0.0, -3.0, 3.0, np.log(0.5), 0.0, -5.0, 0.0])
FURTHER_SPREAD = np.array([0.3, 1.0, 0.7, 1.0, 0.3, 1.5, 0.1])
"""Frequency and lag are believed to be where they are seen. A zero that shifts by
more than some tenths of the peak is a broken gauge."""


RISES = SMOOTH, SMOOTHER, LINEAR, CONCAVE, EXPONENTIAL = 0, 1, 2, 3, 4
NEGATIVES = CUBIC, HALF_SINE, TRIANGLE, CONTINUED = 0, 1, 2, 3
RISEN = 3.0
"""Time constants that an exponential rise is counted as: it reaches 95 % in them."""

LEAST_DECAY = 0.05
"""A continued pulse of a slower decay is deepest beyond any record."""


class Form(NamedTuple):
    """Which formulas a pulse has, kept as floats, which have a zero slope.

    Attributes:
        rise: Place among `RISES`.
        negative: Place among `NEGATIVES`.
    """

    rise: Float[Array, ""]
    negative: Float[Array, ""]


class Natural(NamedTuple):
    """A pulse in the words of a log, times in samples.

    Attributes:
        arrival: When it departs from zero.
        peak: Overpressure.
        duration: Of the positive phase.
        impulse: Of the positive phase.
        decay: Friedlander's $b$ behind the rise.
        rise: From zero to the peak; of an exponential to 95 %.
        suction: Greatest underpressure; below zero where noise makes it so.
        suction_duration: Of the negative phase; of a continued pulse that of the cubic
            one with the same depth and impulse.
    """

    arrival: Float[Array, ""]
    peak: Float[Array, ""]
    duration: Float[Array, ""]
    impulse: Float[Array, ""]
    decay: Float[Array, ""]
    rise: Float[Array, ""]
    suction: Float[Array, ""]
    suction_duration: Float[Array, ""]


def exponential_peak(
    decay: Float[Array, ""], fast: Float[Array, ""]
) -> Float[Array, ""]:
    r"""Return the maximum of $(1-s)\,e^{-bs}\,(1-e^{-\kappa s})$.

    It is where $e^x = 1 + 1/(b/\kappa + 1/(\kappa - x))$ with $x = \kappa s$, a fixed
    point that each step reaches by a factor of three or more closer.

    Args:
        decay: $b$.
        fast: $\kappa$, duration over the time constant of the rise: 3 or more.
    """
    least = jnp.finfo(decay.dtype).eps

    def closer(_, x, decay, fast):
        slope = decay / fast + 1.0 / (fast - x)
        return jnp.minimum(jnp.log1p(1.0 / jnp.maximum(slope, least)), 0.95 * fast)

    still = lax.stop_gradient((decay, fast))
    x = lax.fori_loop(0, 8, partial(closer, decay=still[0], fast=still[1]), 0.0 * fast)
    # at a maximum its place has no slope: the last step alone is differentiated
    s = closer(0, lax.stop_gradient(x), decay, fast) / fast
    x = s * fast
    return (1.0 - s) * jnp.exp(-decay * s) * -jnp.expm1(-x)


def concavity(
    form: Form,
    rise: Float[Array, ""],
    duration: Float[Array, ""],
    decay: Float[Array, ""],
) -> Float[Array, ""]:
    r"""Return $c$ of a rise $x + c\,x(1-x)$: that of a linear one times the decay.

    A rise $u/\tau$ that multiplies Friedlander's formula is, over its value at the end,
    $x\,(1 + g(1-x))\,e^{bg(1-x)}$ with $g = \tau/(t_d-\tau)$; to first order
    $c = (1+b)\,g$. Zero of the other forms.

    Args:
        form: Formulas of the pulse.
        rise: $\tau$.
        duration: $t_d$.
        decay: $b$ behind the rise.
    """
    bent = (1.0 + decay) * rise / (duration - rise)
    return jnp.where(form.rise == CONCAVE, bent, 0.0)


def natural_of(y: Float[Array, " unknown"], form: Form | None = None) -> Natural:
    """Return a pulse by its unknowns.

    Args:
        y: The unknowns.
        form: Its formulas; None: a smooth rise and a cubic negative phase.
    """
    peak, duration, free = jnp.exp(y[1]), jnp.exp(y[2]), jnp.exp(y[4])
    decay = jnp.expm1(y[3])
    rise = free * duration / (free + duration)
    impulse = peak * (0.5 * rise + (duration - rise) * impulse_fraction(decay))
    suction, suction_duration = peak * y[5], duration * jnp.exp(y[6])
    if form is not None:
        impulse = impulse + peak * rise * concavity(form, rise, duration, decay) / 6.0
        fast = RISEN * duration / rise
        size = peak / exponential_peak(decay, fast)
        left = impulse_fraction(decay) - impulse_fraction(decay + fast)
        exponential = form.rise == EXPONENTIAL
        impulse = jnp.where(exponential, size * duration * left, impulse)
        # of a continued pulse the deepest is a 1/b of the duration behind its end
        continued = form.negative == CONTINUED
        late = jnp.maximum(decay, LEAST_DECAY)
        deepest = jnp.where(exponential, size, peak) * jnp.exp(-1.0 - late) / late
        suction = jnp.where(continued, deepest, suction)
        equal = 16.0 / 9.0 * np.e / late
        suction_duration = jnp.where(continued, equal * duration, suction_duration)
    return Natural(
        arrival=y[0],
        peak=peak,
        duration=duration,
        impulse=impulse,
        decay=decay,
        rise=rise,
        suction=suction,
        suction_duration=suction_duration,
    )


def free_rise(
    rise: Float[Array, ""], duration: Float[Array, "..."]
) -> Float[Array, "..."]:
    """Return what a rise is of, as `natural_of` has it: it stays below the duration."""
    return rise / (1.0 - rise / duration)


def following(natural: Natural, further: Float[Array, "7"]) -> Natural:
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
