r"""A blast wave at a place: its overpressure, and the wind that blows with it.

Overpressure: Friedlander's pulse, then the cubic suction of `waves/waveform.py`.
Arrival, peak, duration, decay and suction are those of `waves.waveform.blast_pulse`,
from which a gauge's record follows too (`waves.blast_pressure`); the two differ in one
thing, how long the suction lasts, for the reason below.

Wind: at the front Rankine's and Hugoniot's, $u_s = 5c_0x/(7\sqrt{1+6x/7})$ with
$x = p/P_0$. Behind it, with $x$ of the moment and the afterflow of a spherical wave,

$$u(t) = \frac{5 c_0}{7}\frac{x}{\sqrt{1+6x/7}} + \frac{1}{\rho_0 R}\int_0^t p\,dt$$

The first term is a plane wave's; to it the momentum equation adds the integral where
the front is a sphere: exact for sound (Landau and Lifshitz 1987, Fluid Mechanics, art.
70). So the wind outlasts the overpressure, by 60 % of its duration at Z = 2 and 9 % at
Z = 10. Against the shock solver of `waves.euler` (point source, free air) this wind
carries 0.89 of $\int u|u|\,dt$ at Z = 2, 0.96 at 3.5, 0.98 at 5, 1.00 at 10 and 20; a
wind of the shape of the overpressure, as handbooks have it, 0.52, 0.64, 0.70, 0.79 and
0.85.

The whole wave has no impulse, as no spherical sound has one (the same article): the
suction lasts $t^- = \tfrac{16}{9}\,i^+/P^-$, so the wind ends at zero. A record has the
impulse of the tables of the suction: 1.05 to 1.16 times the positive one at Z = 5 to
36, 1.3 at 2, 1.5 at 1 and 3 at 0.5, and lasts as much longer.

The density of the wind is that behind a shock of the moment's overpressure.

A load asks at every step of every flight, and the laws themselves (polynomials blended
at joins, Chebyshev series, Newton's steps for the decay) cost more than the flight. So
they are tabulated once, for 1 kg in standard air: a cubic spline over even steps of
$\ln Z$ of 0.02. Arrival is within 1e-6 of its law, peak 1e-5, duration 2e-3 (at the
joins, which the spline rounds off). Outside the range in which they all hold the decay
is held, above 0.13 everywhere; past its last point the suction is held as a share of
the peak. Nearer than Z = 0.07 everything is as it is there; past Z = 1000 a power law.
"""

from functools import cache
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.constants import STANDARD_PRESSURE, STANDARD_SOUND_SPEED
from jblast.waves.curves import HermiteCurve, natural_log_spline
from jblast.waves.scaling import log_scaled_distance, sachs_time_factor
from jblast.waves.shock import plane_wave_wind
from jblast.waves.waveform import blast_pulse

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


class Wave(NamedTuple):
    r"""What passes a place.

    Attributes:
        peak: Overpressure over the ambient pressure [-].
        duration_s: Of the positive phase.
        decay: Friedlander's $b$ [-].
        suction: Greatest underpressure over the ambient pressure [-].
        suction_s: Duration of the negative phase.
        sound_speed_m_s: $c_0$.
        afterflow_m_s2: $P_0/(\rho_0 R)$.
    """

    peak: Float[Array, "..."]
    duration_s: Float[Array, "..."]
    decay: Float[Array, "..."]
    suction: Float[Array, "..."]
    suction_s: Float[Array, "..."]
    sound_speed_m_s: Float[Array, "..."]
    afterflow_m_s2: Float[Array, "..."]


def arrival_time(
    distance_m: Float[Array, "..."],
    mass_kg: Float[Array, "..."],
    pressure_pa: Float[Array, "..."],
    sound_speed_m_s: Float[Array, "..."],
    burst: str,
) -> Float[Array, "..."]:
    """Return the time from detonation to the front [s].

    Args:
        distance_m: Range $R$ [m], positive.
        mass_kg: TNT that makes the same pressure [kg].
        pressure_pa: Ambient $P_0$ [Pa].
        sound_speed_m_s: $c_0$ [m/s].
        burst: "surface" or "free-air".
    """
    log_z = _held(log_scaled_distance(distance_m, mass_kg, pressure_pa))
    fraction = jnp.exp(wave_curves(burst).sound_fraction.value(log_z))
    return distance_m / sound_speed_m_s * fraction


def wave_at(
    distance_m: Float[Array, "..."],
    mass_kg: Float[Array, "..."],
    impulse_mass_kg: Float[Array, "..."],
    pressure_pa: Float[Array, "..."],
    sound_speed_m_s: Float[Array, "..."],
    burst: str,
) -> Wave:
    """Return the wave at a distance.

    Args:
        distance_m: Range $R$ [m], positive.
        mass_kg: TNT that makes the same pressure: decides peak, decay and suction [kg].
        impulse_mass_kg: TNT that makes the same impulse: decides the duration [kg].
        pressure_pa: Ambient $P_0$ [Pa].
        sound_speed_m_s: $c_0$ [m/s].
        burst: "surface" or "free-air".
    """
    curves = wave_curves(burst)
    log_z = _held(log_scaled_distance(distance_m, mass_kg, pressure_pa))
    own = _held(log_scaled_distance(distance_m, impulse_mass_kg, pressure_pa))
    time = sachs_time_factor(impulse_mass_kg, pressure_pa, sound_speed_m_s)
    peak, suction = (
        jnp.exp(curve.value(log_z)) for curve in (curves.peak, curves.suction)
    )
    decay = curves.decay.value(log_z)
    duration = time * jnp.exp(curves.duration.value(own))
    impulse = _pulse_impulse(jnp.ones_like(peak), peak, duration, decay)
    return Wave(
        peak=peak,
        duration_s=duration,
        decay=decay,
        suction=suction,
        suction_s=16 / 9 * impulse / suction,
        sound_speed_m_s=sound_speed_m_s,
        afterflow_m_s2=jnp.square(sound_speed_m_s) / (1.4 * distance_m),
    )


def overpressure(wave: Wave, since_s: Float[Array, "..."]) -> Float[Array, "..."]:
    """Return the overpressure over the ambient pressure, at a time since arrival [-].

    The limit from inside at the arrival; zero before it and past the suction.
    """
    x, s = _phases(wave, since_s)
    pulse = wave.peak * (1 - x) * jnp.exp(-wave.decay * x)
    return jnp.where(
        since_s < 0, 0.0, pulse - 6.75 * wave.suction * s * jnp.square(1 - s)
    )


def wind_speed(wave: Wave, since_s: Float[Array, "..."]) -> Float[Array, "..."]:
    """Return the speed of the air away from the charge, at a time since arrival [m/s].

    The limit from inside at the arrival; zero before it and past the suction.
    """
    x, s = _phases(wave, since_s)
    positive = _pulse_impulse(x, wave.peak, wave.duration_s, wave.decay)
    square = s * s
    negative = 6.75 * (square / 2 - 2 / 3 * s * square + square * square / 4)
    impulse = positive - wave.suction * wave.suction_s * negative
    plane = plane_wave_wind(overpressure(wave, since_s), wave.sound_speed_m_s)
    return plane + wave.afterflow_m_s2 * impulse


def density_ratio(overpressure: Float[Array, "..."]) -> Float[Array, "..."]:
    """Return the density behind a shock over the ambient one, suctions too [-].

    Args:
        overpressure: Over the ambient pressure [-], above -1.
    """
    return (7 + 6 * overpressure) / (7 + overpressure)


def _held(log_z: Float[Array, "..."]) -> Float[Array, "..."]:
    """Stay where the curves start: nothing is known nearer."""
    return jnp.maximum(log_z, jnp.log(jnp.asarray(FIRST, log_z.dtype)))


def _phases(
    wave: Wave, since_s: Float[Array, "..."]
) -> tuple[Float[Array, "..."], Float[Array, "..."]]:
    """Return how far both phases have gone, 0 to 1."""
    x = jnp.clip(since_s / wave.duration_s, 0, 1)
    s = jnp.clip((since_s - wave.duration_s) / wave.suction_s, 0, 1)
    return x, s


def _pulse_impulse(
    x: Float[Array, "..."],
    peak: Float[Array, "..."],
    duration_s: Float[Array, "..."],
    decay: Float[Array, "..."],
) -> Float[Array, "..."]:
    """Return the pulse's impulse until a share x of its duration; b at least 0.1."""
    gone = -jnp.expm1(-decay * x)
    part = ((decay - 1) * gone + decay * x * (1 - gone)) / jnp.square(decay)
    return peak * duration_s * part
