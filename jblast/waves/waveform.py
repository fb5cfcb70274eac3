r"""Pressure against time at a position: Friedlander's pulse, rise and negative phase.

The positive phase is Friedlander's pulse (1946),

$$p(t) = P_s \left(1 - \frac{t}{t_d}\right) e^{-b\,t/t_d}, \qquad t \ge 0$$

with $b = 1$ as printed in Parab's thesis, eq. 3.5 (whose scan has lost the
exponential), and with a free decay $b$ in NAVFAC DM-2.08, eq. 13a. Time counts from the
arrival: before it the pressure is exactly zero, at it $P_s$ (the limit from inside, as
are the derivatives there). The formula continues past $t_d$, where the positive phase
ends, as a negative tail: lowest at $t_d(1 + 1/b)$ with $-(P_s/b)\,e^{-(b+1)}$. The
whole record has the impulse $P_s t_d (1/b - 1/b^2)$: none at $b = 1$, and for less the
tail outweighs the positive phase. For $b \le 0$ the tail has no end and grows: stop at
$t_d$. For $b < -1$ the pressure even rises behind the front, so $P_s$ is not the peak.
In single precision everything keeps five digits and more, but near $t_d$ the pressure
passes through zero, and its error is then a rounding of $P_s$.

Impulse and decay depend on the integral

$$k(b) = \int_0^1 (1-x)\,e^{-bx}\,dx = \frac{1}{b} - \frac{1-e^{-b}}{b^2}$$

which falls from $1/2$ at $b = 0$ as $1/b$, and grows as $e^{-b}/b^2$ for negative $b$.
The closed form cancels near zero, its derivatives more so. For $|b| < 1$ it is replaced
by a series in $b$, so that value and derivatives keep nearly all their digits. Below
$b = -700$ ($-80$ in single precision) it overflows.

The negative phase is a cubic that ends,

$$p(t) = -\tfrac{27}{4}\,P^-\,s\,(1-s)^2, \qquad s = \frac{t - t_d}{t^-}, \quad
  0 \le s \le 1$$

Granstrom (1956), read in NAVFAC DM-2.08, eq. 14a, where 27/4 is written 6.75. It is
lowest at $s = 1/3$, with $-P^-$; the impulse is $-\tfrac{9}{16} P^- t^-$. At its end
pressure and slope are zero and the curvature jumps. At its start the pressure is zero
and the slope is $-\tfrac{27}{4}P^-/t^-$, whatever the slope of the pulse: a kink, where
the slope returned is that of the negative phase. The cubic does not keep $P^-$ below
the ambient pressure, which no suction exceeds; the laws for $P^-$ do.

Real fronts rise in a finite time: by the thickness of a weak shock, by the ground and
the turbulence on the path, and in every gauge. The rise time of a weak shock is

$$\tau = \frac{\tau_0}{1 + \tau_0/\tau_m}, \qquad
  \tau_0 = \frac{0.0479\ \text{Pa s}}{P}, \qquad
  \tau_m = \frac{i}{P}\left(1 - \frac{i}{P t_d}\right)$$

Steepening and absorption balance at a thickness inverse to the pressure (Landau and
Lifshitz 1987, Fluid Mechanics, art. 93). The constant is the rule of thumb of sonic
booms, 1 ms at 1 psf = 47.9 Pa, where relaxation of nitrogen and oxygen sets it: from
memory, declared, not measured. Turbulence and dry air make it several times as long
(3 ms at 1 psf is used too). So it is 0.5 us at 1 bar, less than any sample; 8 us at
6 kPa (Z = 20 on the surface), 0.05 ms at Z = 100 and 0.7 ms at 1000, for every charge.
For small charges far away that would exceed the length of the pulse, which no longer
steepens there. The harmonic bound $\tau_m$ is shorter than the time in which the peak
would give the whole impulse, so a pulse with these values exists (`pulse.py`).

`blast_pulse` gives the parameters of one blast at a position; records and the loads on
vehicles (`vehicle.loads.blast`) both follow from it:

- arrival and peak: `shock_kinematics`, whose peak is that of Kingery and Bulmash up to
  Z = 20 and whose front has the speed that belongs to its peak;
- duration and impulse: Kingery and Bulmash, past Z = 40 those of a weak shock; the
  decay is solved from the impulse (`laws/shock_kinematics.py`);
- peak and impulse of the negative phase: the table of UFC 3-340-02. Its duration is
  that of the cubic with these two, $t^- = \tfrac{16}{9}\,i^-/P^-$, as in NAVFAC
  DM-2.08: that of the table would give up to 1.85 times the tabulated impulse (Z = 0.5
  to 2).

A vehicle's wave has the same pulse and the same $P^-$, but a negative phase of another
length: its impulse equals that of the positive phase, $t^- = \tfrac{16}{9}\,i^+/P^-$.
The tabulated impulse is larger, by 5 to 16 % at Z = 5 to 36, a third at 2 and half at
1. With it the wind, an integral of the pressure, would not return to zero.

At the end of the positive phase the pressure is continuous, its slope is not. The
pressure never falls below vacuum. The negative table is for free air. On the surface it
is evaluated for the mass that has the same peak there: `ground_factor` times as much,
1.4 near the charge to 2.0 far away. Past its last point, Z = 36.975 there (46.7 on the
surface), suction and its impulse are constant fractions of peak and impulse: 0.49 and
1.20 (0.53 and 1.12 in free air).

Range of the whole record: Z = 0.178 (free air 0.147) to 1e4 m/kg^(1/3), without
absorption; finite elsewhere. In single precision the time since arrival is the
difference of two larger numbers: far away, where a millisecond is little of the travel
time, use double precision.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, ArrayLike, Complex, Float

from jblast.constants import STANDARD_PRESSURE, STANDARD_SOUND_SPEED
from jblast.types import as_float_arrays
from jblast.waves.arguments import checked
from jblast.waves.laws.kingery_bulmash import ground_factor
from jblast.waves.laws.negative_phase_ufc import (
    LAST as LAST_SUCTION,
    ufc_negative_impulse,
    ufc_negative_pressure,
)
from jblast.waves.laws.shock_kinematics import (
    shock_kinematics_arrival_time,
    shock_kinematics_duration,
    shock_kinematics_impulse,
    shock_kinematics_pressure,
)
from jblast.waves.scaling import sachs_distance_factor

# 1 ms at 1 psf, the rule of thumb of sonic booms, from memory: good to a factor of 3.
RISE_TIME_TIMES_PEAK = 1e-3 * 47.88
"""Rise time times peak of a weak shock in air [Pa s]."""
# The first omitted term is below 1/(20 x 18!) = 8e-18, the rounding of float64.
SERIES_TERMS = 18
"""Terms of the series in b, used for |b| < 1."""
# Four reach rounding for k from 1e-6 to 1e12; one is a margin.
NEWTON_STEPS = 5
"""Newton steps for the decay."""


class BlastPulse(NamedTuple):
    r"""Parameters of one blast at a position.

    Attributes:
        arrival_time: Travel time of the front [s].
        peak: Overpressure at the front $P_s$ [Pa].
        duration: Duration of the positive phase $t_d$ [s].
        decay: Friedlander's $b$, which gives the positive impulse [-].
        suction: Largest underpressure $P^-$ [Pa].
        suction_impulse: Impulse of the negative phase, $i^-$ [Pa s].
    """

    arrival_time: Float[Array, "..."]
    peak: Float[Array, "..."]
    duration: Float[Array, "..."]
    decay: Float[Array, "..."]
    suction: Float[Array, "..."]
    suction_impulse: Float[Array, "..."]


@checked
def blast_pulse(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    sound_speed: Float[ArrayLike, "..."] = STANDARD_SOUND_SPEED,
    burst: str = "surface",
) -> BlastPulse:
    """Return the parameters of one blast at a position.

    Args:
        slant_range: Range $R$ [m], positive.
        charge_mass: TNT-equivalent mass $W$ [kg], positive.
        ambient_pressure: $P_0$ [Pa], positive.
        sound_speed: $c_0$ [m/s], positive.
        burst: "surface" (hemispherical) or "free-air" (spherical).
    """
    distance, mass, ambient, speed = as_float_arrays(
        slant_range, charge_mass, ambient_pressure, sound_speed
    )
    peak = shock_kinematics_pressure(distance, mass, ambient, burst)
    impulse = shock_kinematics_impulse(distance, mass, ambient, speed, burst)
    duration = shock_kinematics_duration(distance, mass, ambient, speed, burst)
    return BlastPulse(
        shock_kinematics_arrival_time(distance, mass, ambient, speed, burst),
        peak,
        duration,
        friedlander_decay(peak, impulse, duration),
        *suction_of(distance, mass, ambient, speed, burst),
    )


def suction_of(
    distance: Float[Array, "..."],
    mass: Float[Array, "..."],
    ambient: Float[Array, "..."],
    speed: Float[Array, "..."],
    burst: str,
) -> tuple[Float[Array, "..."], Float[Array, "..."]]:
    """Return the largest underpressure [Pa] and impulse [Pa s] of the negative phase.

    Args:
        distance: Range $R$ [m], positive.
        mass: TNT-equivalent mass $W$ [kg], positive.
        ambient: $P_0$ [Pa], positive.
        speed: $c_0$ [m/s], positive.
        burst: "surface" or "free-air".
    """
    # the table is for free air: on the ground it is evaluated for the mass that has
    # the same peak in free air
    effective_mass = mass
    if burst == "surface":
        effective_mass = ground_factor(distance, mass, ambient) * mass
    last = LAST_SUCTION * sachs_distance_factor(effective_mass, ambient)
    known = jnp.minimum(distance, last)

    def share(law, *air):
        """Return the ratio of a law's value to that at the last point of the tables."""
        here, there = (law(r, mass, *air, burst=burst) for r in (distance, known))
        return here / there

    return (
        ufc_negative_pressure(known, effective_mass, ambient)
        * share(shock_kinematics_pressure, ambient),
        ufc_negative_impulse(known, effective_mass, ambient, speed)
        * share(shock_kinematics_impulse, ambient, speed),
    )


@checked
def blast_pressure(
    time_since_detonation: Float[ArrayLike, "..."],
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    sound_speed: Float[ArrayLike, "..."] = STANDARD_SOUND_SPEED,
    burst: str = "surface",
) -> Float[Array, "..."]:
    """Return the incident overpressure at a position and time [Pa].

    Args:
        time_since_detonation: Time [s].
        slant_range: Range $R$ [m], positive.
        charge_mass: TNT-equivalent mass $W$ [kg], positive.
        ambient_pressure: $P_0$ [Pa], positive.
        sound_speed: $c_0$ [m/s], positive.
        burst: "surface" (hemispherical) or "free-air" (spherical).
    """
    time, distance, mass, ambient, speed = as_float_arrays(
        time_since_detonation, slant_range, charge_mass, ambient_pressure, sound_speed
    )
    pulse = blast_pulse(distance, mass, ambient, speed, burst)
    duration, suction = pulse.duration, pulse.suction
    suction_duration = 16.0 / 9.0 * pulse.suction_impulse / suction
    time = time - pulse.arrival_time
    positive = time < duration
    return jnp.where(
        positive,
        # for negative decays it grows without bound past the positive phase
        modified_friedlander_pressure(
            jnp.where(positive, time, 0.0), pulse.peak, duration, pulse.decay
        ),
        negative_phase_pressure(time, duration, suction, suction_duration),
    )


@checked
def friedlander_pressure(
    time: Float[ArrayLike, "..."],
    peak_overpressure: Float[ArrayLike, "..."],
    duration: Float[ArrayLike, "..."],
) -> Float[Array, "..."]:
    r"""Return the overpressure of the pulse with decay 1 [Pa].

    $$p = P_s (1 - t/t_d)\,e^{-t/t_d}$$

    Args:
        time: Time $t$ since arrival [s], negative before it.
        peak_overpressure: $P_s$ [Pa], positive.
        duration: Duration of the positive phase $t_d$ [s], positive.
    """
    return modified_friedlander_pressure(time, peak_overpressure, duration, 1.0)


@checked
def modified_friedlander_pressure(
    time: Float[ArrayLike, "..."],
    peak_overpressure: Float[ArrayLike, "..."],
    duration: Float[ArrayLike, "..."],
    decay: Float[ArrayLike, "..."],
) -> Float[Array, "..."]:
    r"""Return the overpressure of the pulse with a free decay [Pa].

    $$p = P_s (1 - t/t_d)\,e^{-b\,t/t_d}$$

    Args:
        time: Time $t$ since arrival [s], negative before it.
        peak_overpressure: $P_s$ [Pa], positive.
        duration: Duration of the positive phase $t_d$ [s], positive.
        decay: $b$ [-].
    """
    time, peak, duration, decay = as_float_arrays(
        time, peak_overpressure, duration, decay
    )
    before = time < 0
    # zero on the input, so that a negative decay does not overflow before the arrival
    phase = jnp.where(before, 0.0, time) / duration
    pressure = peak * (1.0 - phase) * jnp.exp(-decay * phase)
    return jnp.where(before, 0.0, pressure)


@checked
def friedlander_impulse(
    peak_overpressure: Float[ArrayLike, "..."],
    duration: Float[ArrayLike, "..."],
    decay: Float[ArrayLike, "..."],
) -> Float[Array, "..."]:
    r"""Return the impulse of the positive phase [Pa s].

    $$i = P_s t_d \left[\frac1b - \frac{1 - e^{-b}}{b^2}\right]$$

    At $b = 0$, a triangle, it is $P_s t_d/2$; a negative $b$ is allowed.

    Args:
        peak_overpressure: $P_s$ [Pa], positive.
        duration: Duration of the positive phase $t_d$ [s], positive.
        decay: $b$ [-].
    """
    peak, duration, decay = as_float_arrays(peak_overpressure, duration, decay)
    return peak * duration * impulse_fraction(decay)


@checked
def friedlander_decay(
    peak_overpressure: Float[ArrayLike, "..."],
    impulse: Float[ArrayLike, "..."],
    duration: Float[ArrayLike, "..."],
) -> Float[Array, "..."]:
    r"""Return the decay $b$ that gives a pulse its impulse [-].

    The root of `friedlander_impulse`, which is unique for every $k = i/(P_s t_d)$: 0 at
    $k = 1/2$. Above it $b$ is negative; above $e - 2 = 0.718$ it is below $-1$,
    and peak, impulse and duration do not belong to one Friedlander pulse.

    Args:
        peak_overpressure: $P_s$ [Pa], positive.
        impulse: Impulse of the positive phase $i$ [Pa s], positive.
        duration: Duration of the positive phase $t_d$ [s], positive.
    """
    peak, impulse, duration = as_float_arrays(peak_overpressure, impulse, duration)
    return decay_of_fraction(impulse / (peak * duration))


def friedlander_spectrum(
    frequency: Float[ArrayLike, "..."],
    peak_overpressure: Float[ArrayLike, "..."],
    duration: Float[ArrayLike, "..."],
    decay: Float[ArrayLike, "..."],
) -> Complex[Array, "..."]:
    r"""Return the Fourier transform of the whole record, tail included [Pa/Hz].

    $$P(f) = \int_0^\infty p(t)\,e^{-i\omega t}\,dt = P_s t_d\,
    \frac{\sigma - 1}{\sigma^2}, \qquad \sigma = b + i\,\omega t_d,\ \omega = 2\pi f$$

    At $b = 1$ its magnitude is $P_s t_d\,\omega t_d/(1 + \omega^2 t_d^2)$, largest at
    $f = 1/(2\pi t_d)$; otherwise it is largest at $\omega t_d = \sqrt{b^2 - 2(b-1)^2}$,
    or at $f = 0$ where that is not real. Inside `jit`, a decay that is not positive
    gives NaN: its record has no transform.

    Args:
        frequency: $f$ [Hz].
        peak_overpressure: $P_s$ [Pa], positive.
        duration: Duration of the positive phase $t_d$ [s], positive.
        decay: $b$ [-], positive.

    Raises:
        ValueError: The decay is not positive.
    """
    if not isinstance(decay, Tracer) and np.any(np.asarray(decay) <= 0):
        raise ValueError(
            "decay must be positive for a record to have a spectrum, "
            f"got {np.min(np.asarray(decay)):g}"
        )
    return _spectrum(frequency, peak_overpressure, duration, decay)


@checked
def _spectrum(
    frequency: Float[ArrayLike, "..."],
    peak_overpressure: Float[ArrayLike, "..."],
    duration: Float[ArrayLike, "..."],
    decay: Float[ArrayLike, "..."],
) -> Complex[Array, "..."]:
    frequency, peak, duration, decay = jnp.broadcast_arrays(
        *as_float_arrays(frequency, peak_overpressure, duration, decay)
    )
    decaying = decay > 0
    angle = 2.0 * jnp.pi * frequency * duration
    # the inverse is squared, not sigma, which would overflow at high frequencies
    inverse = 1.0 / jax.lax.complex(jnp.where(decaying, decay, 1.0), angle)
    scale = jnp.where(decaying, peak * duration, jnp.nan)
    late = jax.lax.complex(scale * (decay - 1.0), scale * angle)
    return late * inverse * inverse


@checked
def negative_phase_pressure(
    time: Float[ArrayLike, "..."],
    duration: Float[ArrayLike, "..."],
    negative_pressure: Float[ArrayLike, "..."],
    negative_duration: Float[ArrayLike, "..."],
) -> Float[Array, "..."]:
    r"""Return the overpressure in the negative phase [Pa]; zero before and after it.

    Args:
        time: Time $t$ since arrival [s], negative before it.
        duration: Duration of the positive phase $t_d$ [s], positive.
        negative_pressure: Largest underpressure $P^-$ [Pa], positive.
        negative_duration: Duration of the negative phase $t^-$ [s], positive.
    """
    time, duration, pressure, length = as_float_arrays(
        time, duration, negative_pressure, negative_duration
    )
    s = (time - duration) / length
    outside = (s < 0) | (s > 1)
    s = jnp.where(outside, 0.0, s)
    return jnp.where(outside, 0.0, -6.75 * pressure * s * (1.0 - s) ** 2)


@checked
def weak_shock_rise_time(
    peak_overpressure: Float[ArrayLike, "..."],
    impulse: Float[ArrayLike, "..."],
    duration: Float[ArrayLike, "..."],
) -> Float[Array, "..."]:
    """Return the rise time of a weak shock, from zero to the peak [s].

    Args:
        peak_overpressure: $P$ [Pa], positive.
        impulse: Impulse of the positive phase $i$ [Pa s], less than $P t_d$.
        duration: Duration of the positive phase $t_d$ [s], positive.
    """
    peak, impulse, duration = as_float_arrays(peak_overpressure, impulse, duration)
    filled = impulse / peak
    longest = filled * jnp.maximum(1.0 - filled / duration, 0.0)
    steady = RISE_TIME_TIMES_PEAK / peak
    return steady * longest / (steady + longest)


@jax.jit
def impulse_fraction(decay: Float[Array, "..."]) -> Float[Array, "..."]:
    """Return $k(b)$: impulse over peak times duration."""
    series = [(-1.0) ** n / math.factorial(n + 2) for n in range(SERIES_TERMS)]
    near, b = _split(decay)
    # (b + expm1(-b))/b^2, so divided that a large b does not overflow when squared
    far = (1.0 + jnp.expm1(-b) / b) / b
    return jnp.where(near, _polynomial(series, jnp.where(near, decay, 0.0)), far)


@jax.jit
def middle_fraction(decay: Float[Array, "..."]) -> Float[Array, "..."]:
    r"""Return $-k'(b) = \int_0^1 x\,(1-x)\,e^{-bx}\,dx$."""
    return -_fraction_and_slope(decay)[1]


@jax.custom_jvp
@jax.jit
def decay_of_fraction(fraction: Float[Array, "..."]) -> Float[Array, "..."]:
    r"""Return the decay $b$ of an impulse fraction $k > 0$, the inverse of $k(b)$.

    Newton's method, which always converges: $q(b) = 1/k(b)$ is convex and rising, so
    for $k \le 1/2$ the steps fall towards the root from any start above it: the tangent
    at zero gives $\tfrac32(1/k - 2)$, the asymptote $1/k - 1$. For $k > 1/2$ they are
    taken of $\ln q$, concave at negative $b$, and rise from below, where its tangent at
    zero puts $-3\ln 2k$. The derivative is that of the implicit function, not of the
    steps.
    """
    rising = fraction > 0.5
    inverse = 1.0 / fraction
    decay = jnp.where(
        rising,
        -3.0 * jnp.log(2.0 * fraction),
        jnp.minimum(1.5 * (inverse - 2.0), inverse - 1.0),
    )

    def step(_, decay):
        k, slope = _fraction_and_slope(decay)
        ratio = k / fraction
        residual = jnp.where(rising, -jnp.log(ratio), 1.0 - ratio)
        return decay + residual * (k / slope)

    return jax.lax.fori_loop(0, NEWTON_STEPS, step, decay)


@decay_of_fraction.defjvp
def _decay_of_fraction_jvp(primals, tangents):
    """Return the derivative of the implicit function: db/dk = 1/k'(b)."""
    (fraction,), (tangent,) = primals, tangents
    decay = decay_of_fraction(fraction)
    return decay, -tangent / middle_fraction(decay)


def _fraction_and_slope(decay):
    """Return k and dk/db."""
    return jax.jvp(impulse_fraction, (decay,), (jnp.ones_like(decay),))


def _split(decay):
    """Return True where the series is used, and the decay, replaced by 1 there."""
    # at |b| < 1 the closed forms lose digits; the replacement keeps 0/0 out of them
    near = jnp.abs(decay) < 1.0
    return near, jnp.where(near, 1.0, decay)


def _polynomial(coefficients: Sequence[float], x: Float[Array, "..."]):
    """Sum a series by Horner's rule."""
    value = jnp.full_like(x, coefficients[-1])
    for coefficient in reversed(coefficients[:-1]):
        value = value * x + coefficient
    return value
