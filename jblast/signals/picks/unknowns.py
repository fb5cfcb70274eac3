r"""The unknowns of a record, their priors, and the values that follow from them.

Times are in samples from the front, pressures in shares of the largest sample, so the
pick of a record does not depend on its unit or its clock. Positive quantities are
unknown by their logarithm:

| unknown | prior |
|---|---|
| arrival, $\ln P$, $\ln t_d$ | flat |
| $\ln(1 + b)$ | 0.6, sd 0.7 |
| $\ln \tau'$ | one sample, sd 2 |
| $P^-/P$ | 0.3, sd 0.2 |
| $\ln t^-/t_d$ | 2.4, sd 0.5 |
| drift: level, slope, bend, twist | 0, sd 1, 0.5, 0.3, 0.2 |

Between Z = 2 and 300 the laws (shock kinematics on the ground) have the decay $b$ from
0.4 to 2.9, $P^-/P$ from 0.12 to 0.49 and $t^-/t_d$ from 1.8 to 4.5; below $b = -1$ a
pulse would rise behind its front. A weak shock rises in 0.2 us to 0.2 ms
(`waves/waveform.py`), and instruments add about a sample. The standard deviations are
twice those of these ranges, so that the record dominates. The suction has no logarithm:
many records have no negative phase, and the search would shorten the positive phase to
make room for one. Where there is none, noise may make the suction negative.

The rise is $\tau = \tau'/(1 + \tau'/t_d)$ of the unknown $\tau'$: never longer than the
positive phase.
"""

from functools import partial
from typing import NamedTuple

import jax
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
"""Prior means in the order of `NAMES`; those of flat priors are arbitrary."""
SPREAD = np.array([1e3, 5.0, 5.0, 0.7, 2.0, 0.2, 0.5, 1.0, 0.5, 0.3, 0.2])
"""Prior standard deviations in the same order; those of flat priors are so wide that
they do not constrain."""
PULSE_UNKNOWNS = 7
"""Number of unknowns of the pulse, the first of `NAMES`; the rest is the drift."""
FURTHER = (
    *("ln_omega", "logit_damping", "ln_lag", "ln_height", "ln_stretch"),
    *("ln_corner", "shift"),
)
"""Unknowns of further effects, fitted only where a record shows a sign of them:
frequency [rad/sample] and damping of a resonant sensor; lag [samples], relative peak
and relative duration of a further front; corner of an unstated high-pass [1/sample];
step of the baseline at the front, as a share of the peak."""
FURTHER_CENTRE = np.array([0.0, -3.0, 3.0, np.log(0.5), 0.0, -5.0, 0.0])
"""Prior means in the order of `FURTHER`; those of frequency and lag are replaced by
the values that the residuals show."""
FURTHER_SPREAD = np.array([0.3, 1.0, 0.7, 1.0, 0.3, 1.5, 0.1])
"""Prior standard deviations. Those of frequency and lag are about the values that the
residuals show. A gauge whose zero shifts by several tenths of the peak is broken."""
RISES = SMOOTH, SMOOTHER, LINEAR, CONCAVE, EXPONENTIAL = 0, 1, 2, 3, 4
"""Forms of a rise, as numbered in `Form`."""
NEGATIVES = CUBIC, HALF_SINE, TRIANGLE, CONTINUED = 0, 1, 2, 3
"""Forms of a negative phase, as numbered in `Form`."""
RISEN = 3.0
"""Rise time of an exponential rise in time constants, in which it reaches 95 %."""
LEAST_DECAY = 0.05
"""Lower bound of the decay in the division by it. A continued pulse of slower decay
has its minimum 20 durations behind its zero, beyond any record."""
RESOLVED_RISE_SAMPLES, UNRESOLVED_RISE_SAMPLES = 2.0, 1.0
"""Bounds of the rise [samples]. From the first on at least one sample lies within the
rise and locates it; below the second there may be none. Between them the variance
1/12 of an unresolved front is blended in linearly, so that values have slopes."""


class Form(NamedTuple):
    """Formulas of a pulse, numbered by floats, which have a zero slope.

    Attributes:
        rise: Number in `RISES`.
        negative: Number in `NEGATIVES`.
    """

    rise: Float[Array, ""]
    negative: Float[Array, ""]


class Natural(NamedTuple):
    """A pulse by the quantities of a log, times in samples.

    Attributes:
        arrival: Start of the rise.
        peak: Peak overpressure.
        duration: Duration of the positive phase.
        impulse: Impulse of the positive phase.
        decay: Friedlander's $b$ behind the rise.
        rise: Rise time from zero to the peak; of an exponential rise to 95 %.
        suction: Greatest underpressure; noise may make it negative.
        suction_duration: Duration of the negative phase; of a continued pulse that of
            the cubic one with the same depth and impulse.
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

    It lies at $e^x = 1 + 1/(b/\kappa + 1/(\kappa - x))$ with $x = \kappa s$, a fixed
    point; each iteration reduces the distance to it by a factor of three or more.

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
    # the iterations need no slope: at a maximum the value does not depend on its
    # position to first order, so one differentiated step gives the exact derivative
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
    $c = (1+b)\,g$. It is zero for the other forms.

    Args:
        form: Formulas of the pulse.
        rise: $\tau$.
        duration: $t_d$.
        decay: $b$ behind the rise.
    """
    bent = (1.0 + decay) * rise / (duration - rise)
    return jnp.where(form.rise == CONCAVE, bent, 0.0)


def natural_of(y: Float[Array, " unknown"], form: Form | None = None) -> Natural:
    """Return the pulse of some unknowns.

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
        # the minimum of (1 - s) exp(-b s) is at s = 1 + 1/b; 16/9 e/b is the duration
        # of the cubic phase (impulse 9/16 of depth times duration) of equal impulse
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
    """Return the unknown rise of a rise time, the inverse of its bound."""
    return rise / (1.0 - rise / duration)


def following(natural: Natural, further: Float[Array, "7"]) -> Natural:
    """Return the pulse of a further front, which has the form of the first one.

    Args:
        natural: The first pulse.
        further: Further unknowns, see `FURTHER`.
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
    """Return a pulse as the wave model takes it."""
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


class Values(NamedTuple):
    """A pulse with the covariance of its values.

    Attributes:
        natural: The pulse; times in samples, pressures in shares of the largest sample.
        covariance: Covariance in the order of `pick.NAMES`: of arrival and decay in
            their units, of the others' logarithms.
    """

    natural: Natural
    covariance: Float[Array, "8 8"]


def values_of(
    y: Float[Array, " unknown"],
    form: Form,
    offset: Float[Array, "8"],
    covariance: Float[Array, "8 8"],
    others: Float[Array, "other plain"],
    shares: Float[Array, " other"],
) -> Values:
    r"""Return the values of a pulse with their total covariance.

    Another optimum at a distance $\Delta$ with a share $q$ of the posterior adds
    $q\,\Delta\Delta^T$ to the covariance, the mean square about the better one.

    A front that rises within a sample may lie anywhere in it, since the response of the
    instrument between two samples is unknown: $1/12$ of a squared sample is added to
    the variance of the arrival. The samples behind the front fix the rest of the pulse,
    so a later front has a smaller duration, peak, impulse and decay.

    Args:
        y: The unknowns.
        form: Formulas of the pulse.
        offset: Offset added to the values, in the units of their errors.
        covariance: Covariance of the values.
        others: Unknowns of other optima.
        shares: Their shares of the posterior.
    """
    here = in_error_units(y, form)
    there = jax.vmap(lambda y: in_error_units(y, form))(others)
    off = jnp.where(shares[:, None] > 0, there - here[None, :], 0.0)
    off = jax.lax.stop_gradient(off)
    total = covariance + (shares[:, None] * off).T @ off
    natural = _averaged(natural_of(y, form), here + offset)
    later = jax.lax.stop_gradient(_of_later_front(natural))
    added = unresolved(natural.rise) / 12.0 * later[:, None] * later[None, :]
    return Values(natural, total + added)


def unresolved(rise: Float[Array, "..."]) -> Float[Array, "..."]:
    """Return 1 for an unresolved rise, 0 for a resolved one, linear between."""
    return jnp.clip(
        (RESOLVED_RISE_SAMPLES - rise)
        / (RESOLVED_RISE_SAMPLES - UNRESOLVED_RISE_SAMPLES),
        0.0,
        1.0,
    )


def _averaged(natural: Natural, values: Float[Array, "8"]) -> Natural:
    """Return a pulse with the mean values of all forms and the best one's suction."""
    peak, duration, impulse = (jnp.exp(values[k]) for k in (1, 2, 3))
    return natural._replace(
        arrival=values[0],
        peak=peak,
        duration=duration,
        impulse=impulse,
        decay=values[4],
        rise=jnp.exp(values[5]),
    )


def error_covariance(
    y: Float[Array, " unknown"],
    covariance: Float[Array, "unknown unknown"],
    form: Form,
) -> Float[Array, "8 8"]:
    """Return the covariance of the values, in the order of `pick.NAMES`.

    Args:
        y: The unknowns.
        covariance: Covariance of the unknowns.
        form: Formulas of the pulse.
    """
    slopes = jax.jacfwd(lambda y: in_error_units(y, form))(jax.lax.stop_gradient(y))
    return slopes @ covariance @ slopes.T


def _of_later_front(n: Natural) -> Float[Array, "8"]:
    """Return the changes of the values by a front one sample later.

    The pressure behind the front is unchanged.
    """
    one, none = jnp.ones_like(n.peak), jnp.zeros_like(n.peak)
    behind = n.duration - n.rise
    peak, decay = -(1.0 + n.decay) / behind, -n.decay / behind
    impulse = -n.peak / n.impulse
    order = (one, peak, -1.0 / n.duration, impulse, decay, none, none, none)
    return jnp.stack(order)


def in_error_units(y: Float[Array, " unknown"], form: Form) -> Float[Array, "8"]:
    """Return the values in the units of their errors, in the order of `pick.NAMES`.

    Args:
        y: The unknowns.
        form: Formulas of the pulse.
    """
    n = natural_of(y, form)
    sizes = (n.peak, n.duration, n.impulse, n.rise, n.suction, n.suction_duration)
    # the size, as noise may make a suction negative; its error is relative to that
    peak, duration, impulse, rise, suction, length = (
        jnp.log(jnp.abs(x)) for x in sizes
    )
    order = (n.arrival, peak, duration, impulse, n.decay, rise, suction, length)
    return jnp.stack(order)
