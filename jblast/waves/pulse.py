r"""Blast waves at a position as pulses: pressure, means over samples, ground motion.

In air the wave has a front with a finite rise time. Time $t$ counts from the first
departure from the still air. With rise time $\tau$, peak $P$, duration $t_d$ and
suction $P^-$ of duration $t^-$ the wave has four pieces:

$$p = P\,(3x^2 - 2x^3), \quad x = t/\tau \qquad \text{the rise}$$
$$p = P \qquad \text{held for a time } t_h$$
$$p = P\,(1-s)\,e^{-bs}, \quad s = (t-\tau-t_h)/(t_d-\tau-t_h) \qquad
  \text{Friedlander's decay}$$
$$p = -\tfrac{27}{4}\,P^-\,s\,(1-s)^2, \quad s = (t - t_d)/t^- \qquad
  \text{the suction}$$

The decay is Friedlander's (1946) with the free $b$ of NAVFAC DM-2.08, eq. 13a; Parab's
thesis prints it with $b = 1$, eq. 3.5. The suction is Granstrom's cubic (1956), read in
DM-2.08, eq. 14a, where 27/4 is written 6.75. It is lowest at $s = 1/3$, with $-P^-$;
its impulse is $-\tfrac{9}{16} P^- t^-$.

Arrival, peak, duration and both impulses are exactly those given: the decay $b$ is
solved from the impulse that the rise leaves, $k = (i - P\tau/2)/(P(t_d-\tau))$. Up to
$k = e - 2 = 0.718$ nothing is held. There $b = -1$ and the decay starts level; a larger
share would rise behind the front to more than its peak, so instead the peak is held,
for the share $t_h/(t_d-\tau) = (k-(e-2))/(3-e)$, which joins with a level slope. The
laws of this package need it only outside their ranges. No such wave has $k \le 0$ or
$k \ge 1$, more impulse than a rectangle: its decay, and all of its pressure, is NaN.

An instrument's sample is a mean over the sample: a front between two samples is placed
correctly, and a step never overshoots. The means are the integrals of each piece over
the part of the sample that it covers, written as sums of terms of one sign, not as
differences of integrals from the arrival: as exact in single precision as their
arguments are. A time of day is not: give times relative to a nearby one.

Impulse and decay depend on the integral

$$k(b) = \int_0^1 (1-x)\,e^{-bx}\,dx = \frac{1}{b} - \frac{1-e^{-b}}{b^2}$$

which falls from $1/2$ at $b = 0$ as $1/b$, and grows as $e^{-b}/b^2$ for negative $b$.
The closed form cancels near zero, its derivatives more so. For $|b| < 1$ it is replaced
by a series in $b$, so that value and derivatives keep nearly all their digits. Below
$b = -700$ ($-80$ in single precision) it overflows.

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
would give the whole impulse, so a pulse with these values exists.

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

In the ground the pulse of a P wave has displacement and velocity

$$s(t) = A\,u^2 e^{-u}, \qquad \dot s(t) = \frac{A}{\tau}\,u\,(2 - u)\,e^{-u}, \qquad
u = (t - t_0)/\tau \ge 0$$

It is the shortest pulse of this kind that begins without a step of the velocity and
returns to rest. The shape is a choice: laws give two numbers of the pulse, and it has
exactly two parameters. The displacement is largest at $u = 2$, the velocity at
$u = 2 - \sqrt 2$, so a peak displacement $D$ and a peak velocity $v$ determine

$$A = \frac{e^2}{4} D, \qquad
\tau = (2\sqrt 2 - 2)\,e^{\sqrt 2 - 2} \frac{A}{v} = 0.852 \frac{D}{v}$$
"""

import math
from typing import NamedTuple, TypeVar

import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float

from jblast.constants import STANDARD_PRESSURE, STANDARD_SOUND_SPEED
from jblast.types import as_float_arrays, as_numbers
from jblast.waves.arguments import checked
from jblast.waves.friedlander import decay_of_fraction, impulse_fraction
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

LEVEL = math.e - 2.0
"""Impulse over peak times duration of a decay that starts level, $b = -1$ [-]."""
# 1 ms at 1 psf, the rule of thumb of sonic booms, from memory: good to a factor of 3.
RISE_TIME_TIMES_PEAK = 1e-3 * 47.88
"""Rise time times peak of a weak shock in air [Pa s]."""
# The first omitted term is below 1/(20 x 18!) = 8e-18, the rounding of float64.
AMPLITUDE_OVER_PEAK = math.exp(2.0) / 4.0
r"""Amplitude $A$ over peak displacement, which is at $u = 2$ [-]."""
PEAK_VELOCITY_FACTOR = (2.0 * math.sqrt(2.0) - 2.0) * math.exp(math.sqrt(2.0) - 2.0)
r"""Peak velocity over $A/\tau$ [-]."""
UNDERFLOW = 760.0
"""Time constants after which a ground pulse is exactly zero in double precision."""


class Pulse(NamedTuple):
    r"""One wave at a position. The fields broadcast.

    Attributes:
        arrival_time: Start of the rise [s]; infinite for no wave.
        peak: Largest overpressure, $P$ [Pa].
        rise_time: Time from zero to the peak, $\tau$ [s]; may be zero.
        duration: Duration of the positive phase with the rise, $t_d$ [s].
        decay: Friedlander's $b$ behind the peak, at least -1 [-].
        suction: Largest underpressure $P^-$ [Pa].
        suction_duration: Duration of the negative phase, $t^-$ [s].
        hold_time: Duration of the peak, $t_h$ [s]; zero for most waves.
    """

    arrival_time: Float[Array, "..."]
    peak: Float[Array, "..."]
    rise_time: Float[Array, "..."]
    duration: Float[Array, "..."]
    decay: Float[Array, "..."]
    suction: Float[Array, "..."]
    suction_duration: Float[Array, "..."]
    hold_time: Float[Array, "..."]

    @property
    def decay_duration(self) -> Float[Array, "..."]:
        """Duration from the end of the hold to the end of the overpressure [s]."""
        return self.duration - self.rise_time - self.hold_time

    @property
    def lasts(self) -> Float[Array, "..."]:
        """Duration of the whole wave [s]."""
        return self.duration + self.suction_duration

    def stretched(self, pace: Float[Array, "..."]) -> "Pulse":
        """Return the pulse that passes `pace` times as fast."""
        return self._replace(
            rise_time=self.rise_time / pace,
            hold_time=self.hold_time / pace,
            duration=self.duration / pace,
            suction_duration=self.suction_duration / pace,
        )

    @jax.jit
    def pressure(self, time: Float[ArrayLike, "..."]) -> Float[Array, "..."]:
        """Return the overpressure at times on the clock of the arrival [Pa]."""
        since = as_numbers(time) - self.arrival_time
        peaked = self.rise_time + self.hold_time
        x = jnp.clip(since / _not_zero(self.rise_time), 0.0, 1.0)
        s = jnp.clip((since - peaked) / self.decay_duration, 0.0, 1.0)
        q = 1.0 - jnp.clip((since - self.duration) / self.suction_duration, 0.0, 1.0)
        rise = x * x * (3.0 - 2.0 * x)
        decay = (1.0 - s) * jnp.exp(-self.decay * s)
        shape = jnp.where(since < self.rise_time, rise, decay)
        suction = 6.75 * self.suction * (1.0 - q) * q * q
        return jnp.where(since < 0, 0.0, self.peak * shape - suction)

    @jax.jit
    def mean(
        self, start: Float[ArrayLike, "..."], stop: Float[ArrayLike, "..."]
    ) -> Float[Array, "..."]:
        """Return the mean overpressure from start to stop [Pa].

        Args:
            start: Start of the sample, on the clock of the arrival [s].
            stop: End of the sample [s].
        """
        start, stop = as_float_arrays(start, stop)
        span = stop - start
        start, stop = start - self.arrival_time, stop - self.arrival_time
        peaked = self.rise_time + self.hold_time

        def part(first, last, length):
            """Return the sample's share, and middle and half width over the length."""
            width = span - jnp.maximum(first - start, 0) - jnp.maximum(stop - last, 0)
            width = jnp.maximum(width, 0)
            middle = 0.5 * (jnp.maximum(start, first) + jnp.minimum(stop, last))
            inside = jnp.clip(middle, first, last) - first
            return width / span, inside / length, 0.5 * width / length

        none = jnp.zeros_like(peaked)
        share, m, h = part(none, self.rise_time, _not_zero(self.rise_time))
        total = share * (m * m * (3.0 - 2.0 * m) + h * h * (1.0 - 2.0 * m))
        total = total + part(self.rise_time, peaked, 1.0)[0]
        share, m, h = part(peaked, self.duration, self.decay_duration)
        b, width = self.decay, 2.0 * h
        k = impulse_fraction(b * width)
        # e^{-b s0} [(1 - s1) (1 - e^{-y})/y + (s1 - s0) k(y)] with y = b (s1 - s0)
        shape = jnp.maximum(1.0 - m - h, 0) * (1.0 - b * width * k) + width * k
        total = total + share * shape * jnp.exp(-b * jnp.maximum(m - h, 0))
        share, m, h = part(self.duration, self.lasts, self.suction_duration)
        q = 1.0 - m
        suction = share * (q * q * m + h * h * (1.0 / 3.0 - q))
        return self.peak * total - 6.75 * self.suction * suction


class GroundPulse(NamedTuple):
    r"""One pulse of the ground, or several. The fields broadcast.

    Attributes:
        arrival_time: Start $t_0$ [s]; infinite for no pulse.
        amplitude: $A$ [m].
        time_constant: $\tau$ [s].
    """

    arrival_time: Float[Array, "..."]
    amplitude: Float[Array, "..."]
    time_constant: Float[Array, "..."]

    @property
    def lasts(self) -> Float[Array, "..."]:
        """Duration after which it is exactly zero [s]."""
        return UNDERFLOW * self.time_constant

    def stretched(self, pace: Float[Array, "..."]) -> "GroundPulse":
        """Return the pulse that passes `pace` times as fast."""
        return self._replace(
            amplitude=self.amplitude / pace, time_constant=self.time_constant / pace
        )

    @jax.jit
    def mean(
        self, start: Float[ArrayLike, "..."], stop: Float[ArrayLike, "..."]
    ) -> Float[Array, "..."]:
        r"""Return the mean velocity from start to stop [m/s].

        It is the difference of the displacements, written without cancellation:

        $$s(u + \delta) - s(u) = A\,e^{-u}\left[u^2 (e^{-\delta} - 1)
          + (2 u \delta + \delta^2)\,e^{-\delta}\right]$$

        Args:
            start: Starts of the intervals [s].
            stop: Ends of the intervals [s].
        """
        start, stop = as_float_arrays(start, stop)
        first = jnp.maximum(start - self.arrival_time, 0.0)
        # of a sample that contains the arrival only the part after it counts
        inside = jnp.minimum(jnp.maximum(stop - self.arrival_time, 0.0), stop - start)
        u, delta = first / self.time_constant, inside / self.time_constant
        # by expm1: a sample is much shorter than the time constant, and a difference of
        # exponentials would cancel
        rise = u**2 * jnp.expm1(-delta) + (2.0 * u + delta) * delta * jnp.exp(-delta)
        return self.amplitude * jnp.exp(-u) * rise / (stop - start)


AnyPulse = TypeVar("AnyPulse", bound=Pulse | GroundPulse)


def counted_from(pulse: AnyPulse, *times: Float[Array, ""]) -> AnyPulse:
    """Return a pulse with its arrival on a later clock.

    The times are subtracted one by one: their sum would lose a sample's length in
    single precision.

    Args:
        pulse: Its arrival is infinite if it never comes.
        times: Their sum is the origin of the new clock on the old one [s].
    """
    arrival = pulse.arrival_time
    for time in times:
        # inf - time would give a NaN slope by time; that of no arrival is zero
        arrival = jnp.where(jnp.isposinf(arrival), arrival, arrival - time)
    return pulse._replace(arrival_time=arrival)


@jax.jit
def pulse_of(
    arrival_time: Float[ArrayLike, "..."],
    peak: Float[ArrayLike, "..."],
    impulse: Float[ArrayLike, "..."],
    duration: Float[ArrayLike, "..."],
    rise_time: Float[ArrayLike, "..."],
    suction: Float[ArrayLike, "..."],
    suction_impulse: Float[ArrayLike, "..."],
) -> Pulse:
    """Return the wave with given peak, durations and impulses.

    Args:
        arrival_time: Start of the rise [s].
        peak: Overpressure [Pa], positive.
        impulse: Impulse of the positive phase [Pa s]; for its range see the docstring
            of the module.
        duration: Duration of the positive phase [s], positive.
        rise_time: Time from zero to the peak [s], below the duration; 0 for a sharp
            front.
        suction: Largest underpressure [Pa], positive.
        suction_impulse: Impulse of the negative phase [Pa s], positive.
    """
    arrival_time, peak, impulse, duration, rise_time, suction, suction_impulse = (
        as_float_arrays(
            arrival_time, peak, impulse, duration, rise_time, suction, suction_impulse
        )
    )
    behind = duration - rise_time
    fraction = (impulse - 0.5 * peak * rise_time) / (peak * behind)
    possible = (fraction > 0) & (fraction < 1)
    # a harmless input where no wave exists; the decay there is set to NaN below
    fraction = jnp.where(possible, fraction, 0.5)
    decay = decay_of_fraction(jnp.minimum(fraction, LEVEL))
    held = jnp.maximum(fraction - LEVEL, 0.0) / (1.0 - LEVEL)
    return Pulse(
        arrival_time=arrival_time,
        peak=peak,
        rise_time=rise_time,
        duration=duration,
        decay=jnp.where(possible, decay, jnp.nan),
        suction=suction,
        suction_duration=16.0 / 9.0 * suction_impulse / suction,
        hold_time=held * behind,
    )


@checked
def blast_pulse(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    sound_speed: Float[ArrayLike, "..."] = STANDARD_SOUND_SPEED,
    burst: str = "surface",
) -> Pulse:
    """Return the blast at a position, with a sharp front and time from detonation.

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
    return pulse_of(
        shock_kinematics_arrival_time(distance, mass, ambient, speed, burst),
        peak,
        shock_kinematics_impulse(distance, mass, ambient, speed, burst),
        shock_kinematics_duration(distance, mass, ambient, speed, burst),
        jnp.zeros_like(peak),
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
def ground_pulse_of(
    arrival_time: Float[ArrayLike, "..."],
    displacement: Float[ArrayLike, "..."],
    velocity: Float[ArrayLike, "..."],
) -> GroundPulse:
    """Return the pulse with given peak displacement and peak velocity.

    Args:
        arrival_time: Start [s].
        displacement: Peak displacement [m]; zero where the velocity is zero.
        velocity: Peak velocity [m/s].
    """
    arrival_time, displacement, velocity = as_float_arrays(
        arrival_time, displacement, velocity
    )
    amplitude = AMPLITUDE_OVER_PEAK * displacement
    moves = velocity > 0.0
    # a pulse of zero amplitude has any time constant; 1 keeps gradients finite
    tau = PEAK_VELOCITY_FACTOR * amplitude / jnp.where(moves, velocity, 1.0)
    return GroundPulse(arrival_time, amplitude, jnp.where(moves, tau, 1.0))


@checked
def friedlander_pressure(
    time: Float[ArrayLike, "..."],
    peak_overpressure: Float[ArrayLike, "..."],
    duration: Float[ArrayLike, "..."],
    decay: Float[ArrayLike, "..."],
) -> Float[Array, "..."]:
    r"""Return the overpressure of Friedlander's pulse, its tail included [Pa].

    $$p = P_s (1 - t/t_d)\,e^{-b\,t/t_d}$$

    The formula continues past $t_d$ as a negative tail. For $b \le 0$ it grows without
    end: stop at $t_d$.

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


def _not_zero(rise_time: Float[Array, "..."]) -> Float[Array, "..."]:
    """Return the rise time as a divisor: 1 for a sharp front."""
    return jnp.where(rise_time > 0, rise_time, 1.0)
