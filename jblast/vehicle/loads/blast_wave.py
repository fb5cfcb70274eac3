r"""The blast wave at a vehicle: overpressure, wind, and its part within a step.

Overpressure: Friedlander's pulse, then the cubic suction of
`waves.pulse.Pulse`. Arrival, peak, duration, decay and suction are those of
`waves.pulse.blast_pulse`, also used for gauges. The two differ in the duration of
the suction, for the reason below.

Wind: at the front that of Rankine and Hugoniot, $u_s = 5c_0x/(7\sqrt{1+6x/7})$ with
$x = p/P_0$. Behind it, with $x$ of the moment and the afterflow of a spherical wave,

$$u(t) = \frac{5 c_0}{7}\frac{x}{\sqrt{1+6x/7}} + \frac{1}{\rho_0 R}\int_0^t p\,dt$$

The first term is that of a plane wave. The momentum equation adds the integral where
the front is a sphere: exact for sound (Landau and Lifshitz 1987, Fluid Mechanics, art.
70). So the wind outlasts the overpressure, by 60 % of its duration at Z = 2 and 9 % at
Z = 10. Against the shock solver `calibration/euler.py` (point source, free air) this
wind carries 0.89 of $\int u|u|\,dt$ at Z = 2, 0.96 at 3.5, 0.98 at 5, 1.00 at 10 and
20; a wind of the shape of the overpressure, as in handbooks, 0.52, 0.64, 0.70, 0.79 and
0.85.

The whole wave has no impulse, like any spherical sound (the same article): the suction
lasts $t^- = \tfrac{16}{9}\,i^+/P^-$, so the wind ends at zero. The suction of a gauge
record has the impulse of the published tables: 1.05 to 1.16 times the positive one at Z
= 5 to 36, 1.3 at 2, 1.5 at 1 and 3 at 0.5, and lasts longer by the same factors.

The density of the wind is that behind a shock of the same overpressure. The front adds
an impulse on a body that it crosses. The part of a wave that passes a moving vehicle
within a step is bounded by the times since arrival at both ends of the step, and each
phase in it is integrated by Gauss's rule.

A load is evaluated at every step of every flight, and the laws themselves (polynomials
blended at joins, Chebyshev series, Newton's steps for the decay) cost more than the
flight. So they are tabulated once, for 1 kg in standard air, as cubic splines with
nodes every 0.02 in $\ln Z$. Arrival is within 1e-6 of its law, peak 1e-5, duration 2e-3
(at the joins, which the spline smooths). Outside the range of validity of all laws the
decay is constant, above 0.13 everywhere. Beyond its last point the suction is a
constant share of the peak. Below Z = 0.07 all curves are constant; above Z = 1000 they
are power laws.
"""

from functools import cache
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from jblast.constants import (
    AIR_HEAT_CAPACITY_RATIO,
    STANDARD_PRESSURE,
    STANDARD_SOUND_SPEED,
)
from jblast.types import as_numbers
from jblast.vehicle.quadrotor import Body
from jblast.vehicle.state import Number, State, Vector, three
from jblast.waves.paths import slant_range
from jblast.waves.pulse import blast_pulse
from jblast.waves.scaling import (
    log_scaled_distance,
    sachs_distance_factor,
    sachs_time_factor,
)
from jblast.waves.shock import plane_wave_wind
from jblast.waves.tables import Table, hermite_table, spline_slopes

FIRST, LAST = 0.07, 1000.0
"""Range of scaled distance of the curves [m/kg^(1/3)].

The lower end is next to the surface of a TNT charge (radius 0.053). At the upper end
the overpressure is near 100 Pa, far below any effect on a vehicle.
"""
# Node spacing in ln Z: 2 % of distance, which resolves the curvature of the laws.
SPACING = 0.02
RANGE = {"surface": (0.178, 40.0), "free-air": (0.147, 36.975)}
"""Range of validity of all laws: durations start later than pressures, and suctions in
free air end sooner [m/kg^(1/3)]."""
NODES = 8
"""Gauss nodes per phase; the error of the drag's impulse is below 1e-3 if a step
contains the whole wave."""


class WaveCurves(NamedTuple):
    """Curves against ln Z.

    Attributes:
        sound_fraction: $c_0 t_a/R$, in ln.
        peak: $p/P_0$, in ln.
        duration: $t_d$ of 1 kg in standard air, in ln [s].
        decay: $b$ itself [-].
        suction: $P^-/P_0$, in ln.
    """

    sound_fraction: Table
    peak: Table
    duration: Table
    decay: Table
    suction: Table


@cache
def wave_curves(burst: str) -> WaveCurves:
    """Tabulate the laws of a burst, "surface" or "free-air"."""
    count = int(np.ceil(np.log(LAST / FIRST) / SPACING)) + 1
    log_z, step = np.linspace(np.log(FIRST), np.log(LAST), count, retstep=True)
    # Also if first called while a program is traced: the cache must hold numbers.
    with jax.ensure_compile_time_eval():
        columns = [
            np.asarray(x, float)
            for x in jax.jit(_laws, static_argnums=1)(jnp.exp(log_z), burst)
        ]
    logs = [np.log(column) for column in columns]
    tables = (
        hermite_table(float(log_z[0]), float(step), y, spline_slopes(log_z, y))
        for y in logs
    )
    return WaveCurves(*tables)


def _laws(z: Float[Array, " node"], burst: str) -> tuple[Float[Array, " node"], ...]:
    """Return the values at the curves' nodes; for the decay its exponential."""
    first, last = RANGE[burst]
    # One call for three sets of distances, because the laws compile slowly: as they
    # are, clipped to all ranges (for the decay) and below the last point (for the
    # suction).
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
    r"""Parameters of a blast wave at a position.

    Attributes:
        peak: Overpressure over the ambient pressure [-].
        duration_s: Of the positive phase.
        decay: Friedlander's $b$ [-].
        suction: Maximum underpressure over the ambient pressure [-].
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


def overpressure(wave: Wave, since_s: Float[Array, "..."]) -> Float[Array, "..."]:
    """Return overpressure over ambient pressure [-] at a time since arrival.

    The peak at the arrival itself; zero before it and after the suction.
    """
    x, s = _phases(wave, since_s)
    pulse = wave.peak * (1 - x) * jnp.exp(-wave.decay * x)
    # 6.75 s (1 - s)^2 is the cubic of unit maximum, at s = 1/3.
    return jnp.where(
        since_s < 0, 0.0, pulse - 6.75 * wave.suction * s * jnp.square(1 - s)
    )


def wind_speed(wave: Wave, since_s: Float[Array, "..."]) -> Float[Array, "..."]:
    """Return the wind speed away from the charge [m/s] at a time since arrival.

    That behind the front at the arrival itself; zero before it and after the suction.
    """
    x, s = _phases(wave, since_s)
    positive = _pulse_impulse(x, wave.peak, wave.duration_s, wave.decay)
    square = s * s
    negative = 6.75 * (square / 2 - 2 / 3 * s * square + square * square / 4)
    impulse = positive - wave.suction * wave.suction_s * negative
    plane = plane_wave_wind(overpressure(wave, since_s), wave.sound_speed_m_s)
    return plane + wave.afterflow_m_s2 * impulse


def density_ratio(overpressure: Float[Array, "..."]) -> Float[Array, "..."]:
    """Return the density behind a shock over ambient density [-], also for suctions.

    Args:
        overpressure: Overpressure over ambient pressure [-], above -1.
    """
    return (7 + 6 * overpressure) / (7 + overpressure)


def _phases(
    wave: Wave, since_s: Float[Array, "..."]
) -> tuple[Float[Array, "..."], Float[Array, "..."]]:
    """Return the elapsed shares of positive and negative phase, 0 to 1."""
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
    # The closed form loses digits as 1 / b**2: below b = 0.1 it would need a series.
    # The curves keep b above 0.13.
    gone = -jnp.expm1(-decay * x)
    part = ((decay - 1) * gone + decay * x * (1 - gone)) / jnp.square(decay)
    return peak * duration_s * part


class Surroundings(NamedTuple):
    """Ambient air.

    Attributes:
        pressure_pa: Ambient pressure.
        sound_speed_m_s: Speed of sound in still air.
        wind_m_s: Ambient wind, east, north, up; it advects the waves.
    """

    pressure_pa: Float[Array, ""]
    sound_speed_m_s: Float[Array, ""]
    wind_m_s: Float[Array, "3"]


class Blast(eqx.Module):
    """Position, time and TNT masses of a charge, or of several along the last axis.

    The methods are those of a single one.

    Attributes:
        position_m: East, north, up.
        time_s: Time of detonation; infinite: it never happens.
        mass_kg: TNT mass of equal pressure.
        impulse_mass_kg: TNT mass of equal impulse.
        free_air: Weight of the curves of a burst in free air: 0 for one on the surface,
            between 0 and 1 the curves are blended in their logarithms.
    """

    position_m: Float[Array, "*batch 3"] = eqx.field(converter=as_numbers)
    time_s: Float[Array, "*batch"] = eqx.field(converter=as_numbers)
    mass_kg: Float[Array, "*batch"] = eqx.field(converter=as_numbers)
    impulse_mass_kg: Float[Array, "*batch"] = eqx.field(converter=as_numbers)
    free_air: Float[Array, "*batch"] = eqx.field(converter=as_numbers)

    def way(
        self, air: Surroundings, position_m: Float[Array, "... 3"]
    ) -> tuple[Float[Array, "..."], Float[Array, "... 3"], Float[Array, "..."]]:
        """Return distance [m], direction and speed of sound along it [m/s].

        The distance is at least that of the first node of the curves.
        """
        source = jnp.broadcast_to(self.position_m, position_m.shape)
        distance = slant_range(source, position_m)
        nearest = FIRST * sachs_distance_factor(self.mass_kg, air.pressure_pa)
        distance = jnp.maximum(distance, nearest)
        away = (position_m - source) / distance[..., None]
        along = away[..., 0] * air.wind_m_s[0] + away[..., 1] * air.wind_m_s[1]
        return distance, away, air.sound_speed_m_s + along

    def travel_time_s(
        self, air: Surroundings, position_m: Float[Array, "... 3"]
    ) -> Float[Array, "..."]:
        """Return the time from detonation to the front [s]."""
        distance, _, speed = self.way(air, position_m)
        log_z = log_scaled_distance(distance, self.mass_kg, air.pressure_pa)
        fraction = jnp.exp(self._curve("sound_fraction", log_z))
        return distance / speed * fraction

    def wave(self, air: Surroundings, position_m: Float[Array, "... 3"]) -> Wave:
        """Return the wave at positions."""
        distance, _, _ = self.way(air, position_m)
        pressure, sound_speed = air.pressure_pa, air.sound_speed_m_s
        log_z, own = (
            log_scaled_distance(distance, mass, pressure)
            for mass in (self.mass_kg, self.impulse_mass_kg)
        )
        peak, suction = (jnp.exp(self._curve(n, log_z)) for n in ("peak", "suction"))
        decay = self._curve("decay", log_z)
        time = sachs_time_factor(self.impulse_mass_kg, pressure, sound_speed)
        duration = time * jnp.exp(self._curve("duration", own))
        impulse = _pulse_impulse(jnp.ones_like(peak), peak, duration, decay)
        return Wave(
            peak=peak,
            duration_s=duration,
            decay=decay,
            suction=suction,
            suction_s=16 / 9 * impulse / suction,
            sound_speed_m_s=sound_speed,
            afterflow_m_s2=jnp.square(sound_speed)
            / (AIR_HEAT_CAPACITY_RATIO * distance),
        )

    def _curve(self, name: str, log_z: Float[Array, "..."]) -> Float[Array, "..."]:
        # No law is valid below the first node.
        inside = jnp.maximum(log_z, jnp.log(jnp.asarray(FIRST, log_z.dtype)))
        surface, free_air = (getattr(wave_curves(b), name)(inside) for b in RANGE)
        return surface + self.free_air * (free_air - surface)


class NodePlace(NamedTuple):
    """Position of a quadrature node in its phase, or arrays over all nodes.

    Attributes:
        share: Share of its phase, 0 to 1.
        weight: Weight of the rule.
        later: True in the negative phase.
    """

    share: Float[Array, "*node"]
    weight: Float[Array, "*node"]
    later: Bool[Array, "*node"]


class Node(NamedTuple):
    """Wave at a node.

    Attributes:
        since: Time since arrival [s].
        part: Weight of the node, in time of the flight [s].
        wind: Speed [m/s].
        density: [kg/m3].
    """

    since: Number
    part: Number
    wind: Number
    density: Number


def nodes(dtype: np.dtype) -> NodePlace:
    """Return all nodes in order of time: Gauss's rule in each phase."""
    place, weight = np.polynomial.legendre.leggauss(NODES)
    return NodePlace(
        jnp.asarray(np.tile((place + 1) / 2, 2), dtype),
        jnp.asarray(np.tile(weight / 2, 2), dtype),
        jnp.asarray(np.repeat([False, True], NODES)),
    )


class Passage(NamedTuple):
    """The part of a wave that passes a vehicle within a step.

    Attributes:
        wave: Wave at the vehicle.
        away: Direction from the charge.
        start_s: Time since arrival at the step's beginning.
        end_s: Time since arrival at its end.
        rate: Change of the time since arrival per time; not 1 if the vehicle moves
            along the wave's direction.
        air_density: Ambient density [kg/m3].
    """

    wave: Wave
    away: Vector
    start_s: Number
    end_s: Number
    rate: Number
    air_density: Number

    def node(self, place: NodePlace) -> Node:
        """Return the wave at a node."""
        wave = self.wave
        zero, past = jnp.zeros_like(self.end_s), wave.duration_s + wave.suction_s
        first, middle, last = (
            jnp.clip(edge, self.start_s, self.end_s)
            for edge in (zero, wave.duration_s, past)
        )
        begin = jnp.where(place.later, middle, first)
        width = jnp.where(place.later, last - middle, middle - first)
        since = begin + width * place.share
        density = self.air_density * density_ratio(overpressure(wave, since))
        part = place.weight * width / self.rate
        return Node(since, part, wind_speed(wave, since), density)


def blast_passage(
    blast: Blast,
    air: Surroundings,
    start_s: Float[Array, ""],
    end_s: Float[Array, ""],
    state: State,
    acceleration: Float[Array, "3"],
) -> Passage:
    """Return the part of a wave that passes within a step.

    Args:
        blast: The charge.
        air: Ambient air.
        start_s: Beginning of the step.
        end_s: End of the step.
        state: State of the vehicle at its beginning.
        acceleration: Acceleration of the vehicle without the blast, world [m/s2].
    """
    step = end_s - start_s
    way = (state.velocity_m_s + acceleration * step / 2) * step
    places = jnp.stack([state.position_m, state.position_m + way])
    came = blast.time_s + blast.travel_time_s(air, places)
    first, last = start_s - came[0], end_s - came[1]
    met = jnp.clip(-first / (last - first), 0, 1)
    # The wave is evaluated midway between the positions at the arrival and at half of
    # the positive phase (or the step's end): most of the drag acts there.
    half = blast.wave(air, state.position_m + met * way).duration_s / 2
    left = jnp.minimum(1, met + half / step)
    place = state.position_m + (met + left) / 2 * way
    _, away, _ = blast.way(air, place)
    density = AIR_HEAT_CAPACITY_RATIO * air.pressure_pa
    return Passage(
        wave=blast.wave(air, place),
        away=three(away),
        start_s=first,
        end_s=last,
        rate=(last - first) / step,
        air_density=density / jnp.square(air.sound_speed_m_s),
    )


def crossing_time(body: Body, wave: Wave) -> Number:
    """Return the front's crossing time of a sphere of the body's mean area [s]."""
    speed = wave.sound_speed_m_s * jnp.sqrt(1 + 6 / 7 * wave.peak)
    area = jnp.mean(body.area_m2)
    known = ~(area <= 0)
    diameter = jnp.sqrt(4 / jnp.pi * jnp.where(known, area, 1.0))
    # Without an area the front crosses in some microseconds: any positive time gives
    # the same impulse of an area of zero.
    return jnp.where(known, diameter, 1e-3) / speed


def front_impulse(
    body: Body, passage: Passage, since_s: Float[Array, "..."]
) -> Float[Array, "..."]:
    r"""Return the impulse of pressure gradient and added mass until a time [N s].

    $\rho_0 V (1 + C_m)\,Du/Dt$. With the ambient density the gradient's part is exact
    across a shock, $p_s/U = \rho_0 u_s$. The impulse is $\rho_0 V (1 + C_m)$ times the
    change of $u$, so a jump is complete at any step. The added mass also resists the
    vehicle's own acceleration; this is neglected, since $\rho_0 V C_m$ is below 1e-3 of
    its mass.
    """
    wave = passage.wave
    crossed = jnp.clip(since_s / crossing_time(body, wave) + 0.5, 0, 1)
    moved = passage.air_density * body.volume_m3 * (1 + body.added_mass_coefficient)
    return moved * crossed * wind_speed(wave, jnp.maximum(since_s, 0))
