r"""A shock front from the charge to the acoustic limit, in one consistent picture.

Peak overpressure: Kingery and Bulmash up to $Z = 20$ m/kg^(1/3), from there the
weak-shock tail that meets it in value and slope. Not from 40, where their table ends:
its last stretch bends away (`python -m calibration.laws tail` prints it).
Surface: $A$ = 170256 Pa m/kg^(1/3), $b$ = 2.7953 m/kg^(1/3); free air: 105693, 4.8852.

Shock speed, by Rankine and Hugoniot for air of $\gamma$ = 1.4:
$$U = c_0 \sqrt{1 + \tfrac{6}{7}\, p/P_0}$$

Arrival, starting from the Kingery-Bulmash time at their first $Z$:
$$t = t_{KB}(R_1) + \int_{R_1}^{R} dr/U$$
so that $dt/dR = 1/U$ to rounding, which tends to $1/c_0$. The integral is tabulated at
first use (under 5 ms, `waves/curves.py`); in float64 its relative error is below
1e-10.

Listed points: at $Z = 20$ value and slope are continuous, curvature is not. At the
first $Z$ the slope of the arrival jumps (1 % surface, 7 % free air): below it, not
valid, the arrival goes on as Kingery's and Bulmash's power law.

Within the table the arrival is that of Kingery and Bulmash to 3.4 % (worst near
Z = 0.2, where the start decides), to 0.9 % past Z = 2. Below Z = 0.5 real air is slower
than the ideal gas: U is up to 5 % above their shock speed.

Range of arrival and speed: from the first $Z$ (0.0674 surface, 0.0531 free air) to 1e4;
past that the formulas continue, finite. Neither wind nor absorption is modelled.
Z = 1e4 is 10 km for 1 kg, where ISO 9613-1 (20 C, 70 % humidity) takes 3.4 dB at
125 Hz, above the 20 Hz or so where such a pulse is strongest; larger charges are lower
in pitch and lose less. That limit is a choice, not a measurement.

Range of the pressure: to Z = 300. Past it the median of recorded peaks is half of the
law, with a scatter of a factor of 1.6; from 200 on the scatter grows as measured
(`waves/shock.py`). A peak that is off by a factor of two changes the speed by 0.05 % at
Z = 300.

Duration and impulse of the positive phase are those of Kingery and Bulmash to the end
of their table, Z = 40 m/kg^(1/3), and from there those of a weak shock (Landau 1945;
Whitham 1974, section 9.3), whose front absorbs the wave behind it:

$$t_d = t_{40} \sqrt{\frac{\ln(Z/b)}{\ln(40/b)}}, \qquad i = i_{40}\,\frac{40}{Z}$$

with the length $b$ of the tail of the pressure. Peak times duration then falls as
$1/Z$, so the impulse keeps its share of it: 0.42 on the surface and 0.47 in free air,
near the 1/2 of the triangle that every such pulse becomes. A record then has the front,
the duration and the impulse of one pulse at all distances.

Past 40 the curves are blended over 5 % in Z, where the slope of the duration falls from
0.31 to 0.18 (free air: 0.28 to 0.23), that of the impulse from -1.02 to -1 (-1.10).

Absorption, turbulence and weather are not modelled. `ford_2021`, fitted to recordings
on the surface, has durations 13 % shorter at Z = 100 and 13 % longer at 1000, impulses
21 % and 44 % smaller. For a log `ford_2021` is chosen there, not this law
(`fidelity.errors`).

Range of duration and impulse: from the start of Kingery's and Bulmash's tables to
Z = 300. Past it the median of recorded impulses is 0.7 of this, of durations 1.2 to 1.3
times; from 200 on the scatter grows as measured (`waves/shock.py`).
"""

import math
from collections.abc import Callable
from functools import cache, partial

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Bool, Float

from jblast.constants import STANDARD_PRESSURE, STANDARD_SOUND_SPEED
from jblast.registry import Law, declared_scatter, register
from jblast.types import as_float_array
from jblast.waves.arguments import checked
from jblast.waves.curves import (
    BLEND_WIDTH,
    Arrival,
    Tail,
    chebyshev_arrival,
    log_sound_fraction,
    smooth_step,
)
from jblast.waves.laws.kingery_bulmash import (
    kingery_bulmash_curve,
    kingery_bulmash_joins,
)
from jblast.waves.scaling import (
    log_scaled_distance,
    sachs_impulse_factor,
    sachs_pressure_factor,
    sachs_time_factor,
    scaled_distance,
)
from jblast.waves.shock import (
    FAR_END,
    WeakShockTail,
    measured_far_scatter,
    weak_shock_tail,
)

# Up to here absorption is negligible in an arrival (docstring of the module).
LAST_VALID = 1e4
"""Largest valid scaled distance of arrival and speed [m/kg^(1/3)]."""
_FIRST = "Z = 0.0674 (free-air 0.0531)"
_TO_SOUND = f"{_FIRST} to 1e4 m/kg^(1/3); no absorption"
_RECORDED = f"{_FIRST} to 300 m/kg^(1/3); no absorption"
END_OF_TABLE = 40.0
"""Largest scaled distance of the Kingery-Bulmash curves [m/kg^(1/3)]."""
BLEND = END_OF_TABLE * math.sqrt(1.0 + BLEND_WIDTH)
"""Centre of the blend, which begins at the end of the table [m/kg^(1/3)]."""
# Not at 40, where the table ends: its last segment departs from a weak shock
# (`python -m calibration.laws tail`).
JOIN = 20.0
"""Scaled distance at the start of the tail [m/kg^(1/3)]."""
LOG_STANDARD_PRESSURE = math.log(STANDARD_PRESSURE)


@checked
def shock_kinematics_pressure(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    burst: str = "surface",
) -> Float[Array, "..."]:
    """Return the peak incident overpressure [Pa].

    Args:
        slant_range: Range $R$ [m], positive.
        charge_mass: TNT-equivalent mass $W$ [kg], positive.
        ambient_pressure: $P_0$ [Pa], positive.
        burst: "surface" (hemispherical) or "free-air" (spherical).
    """
    log_z = log_scaled_distance(slant_range, charge_mass, ambient_pressure)
    return sachs_pressure_factor(ambient_pressure) * jnp.exp(
        front_log_pressure(log_z, burst)
    )


@checked
def shock_kinematics_shock_speed(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    sound_speed: Float[ArrayLike, "..."] = STANDARD_SOUND_SPEED,
    burst: str = "surface",
) -> Float[Array, "..."]:
    """Return the speed of the shock front [m/s]: above $c_0$, and tending to it.

    Args:
        slant_range: Range $R$ [m], positive.
        charge_mass: TNT-equivalent mass $W$ [kg], positive.
        ambient_pressure: $P_0$ [Pa], positive.
        sound_speed: $c_0$ [m/s], positive.
        burst: "surface" (hemispherical) or "free-air" (spherical).
    """
    log_z = log_scaled_distance(slant_range, charge_mass, ambient_pressure)
    return as_float_array(sound_speed) * front_mach_number(log_z, burst)


@checked
def shock_kinematics_arrival_time(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    sound_speed: Float[ArrayLike, "..."] = STANDARD_SOUND_SPEED,
    burst: str = "surface",
) -> Float[Array, "..."]:
    """Return the time from detonation to the arrival of the shock [s].

    Args:
        slant_range: Range $R$ [m], positive.
        charge_mass: TNT-equivalent mass $W$ [kg], positive.
        ambient_pressure: $P_0$ [Pa], positive.
        sound_speed: $c_0$ [m/s], positive.
        burst: "surface" (hemispherical) or "free-air" (spherical).
    """
    log_z = log_scaled_distance(slant_range, charge_mass, ambient_pressure)
    sound_time = as_float_array(slant_range) / as_float_array(sound_speed)
    return sound_time * jnp.exp(log_sound_fraction(log_z, shock_arrival(burst)))


def _validity(quantity: str, last: float) -> Callable[..., Bool[Array, "..."]]:
    """Return the validity function: True from the first tabulated Z to `last`."""

    def valid(
        slant_range: Float[ArrayLike, "..."],
        charge_mass: Float[ArrayLike, "..."],
        ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
        burst: str = "surface",
    ) -> Bool[Array, "..."]:
        z = scaled_distance(slant_range, charge_mass, ambient_pressure)
        return (z >= kingery_bulmash_curve(quantity, burst).z_min) & (z <= last)

    return valid


shock_kinematics_valid = _validity("incident_pressure", LAST_VALID)
"""Validity of arrival and speed: True from the first tabulated Z to 1e4."""


@checked
def shock_kinematics_duration(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    sound_speed: Float[ArrayLike, "..."] = STANDARD_SOUND_SPEED,
    burst: str = "surface",
) -> Float[Array, "..."]:
    """Return the duration of the positive phase [s].

    Args:
        slant_range: Range $R$ [m], positive.
        charge_mass: TNT-equivalent mass $W$ [kg], positive.
        ambient_pressure: $P_0$ [Pa], positive.
        sound_speed: $c_0$ [m/s], positive.
        burst: "surface" (hemispherical) or "free-air" (spherical).
    """
    length = math.log(front_tail(burst).length)
    start = math.log(END_OF_TABLE) - length
    log_value = _continued(
        "positive_phase_duration",
        burst,
        log_scaled_distance(slant_range, charge_mass, ambient_pressure),
        # a weak shock lengthens as the root of ln(Z/b)
        lambda log_z: 0.5 * (jnp.log(log_z - length) - math.log(start)),
    )
    factor = sachs_time_factor(charge_mass, ambient_pressure, sound_speed)
    return factor * jnp.exp(log_value)


@checked
def shock_kinematics_impulse(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    sound_speed: Float[ArrayLike, "..."] = STANDARD_SOUND_SPEED,
    burst: str = "surface",
) -> Float[Array, "..."]:
    """Return the incident impulse of the positive phase [Pa s].

    Args:
        slant_range: Range $R$ [m], positive.
        charge_mass: TNT-equivalent mass $W$ [kg], positive.
        ambient_pressure: $P_0$ [Pa], positive.
        sound_speed: $c_0$ [m/s], positive.
        burst: "surface" (hemispherical) or "free-air" (spherical).
    """
    log_value = _continued(
        "incident_impulse",
        burst,
        log_scaled_distance(slant_range, charge_mass, ambient_pressure),
        # peak times duration of a weak shock falls as 1/Z
        lambda log_z: math.log(END_OF_TABLE) - log_z,
    )
    factor = sachs_impulse_factor(charge_mass, ambient_pressure, sound_speed)
    return factor * jnp.exp(log_value)


def _continued(
    quantity: str,
    burst: str,
    log_z: Float[Array, "..."],
    log_growth: Callable[[Float[Array, "..."]], Float[Array, "..."]],
) -> Float[Array, "..."]:
    """Return ln of a curve of the table with its continuation beyond the table.

    Args:
        quantity: Name in the table.
        burst: "surface" or "free-air".
        log_z: ln of the scaled distance.
        log_growth: ln of the far curve over its value at the end of the table.
    """
    curve = kingery_bulmash_curve(quantity, burst)
    near = curve.log_value(log_z)
    end = math.log(END_OF_TABLE)
    at_end = curve.segments[-1].log_value(end)
    # Clamped, because nearer than b the growth would be the root of a negative number.
    far = at_end + log_growth(jnp.maximum(log_z, end))
    return near + smooth_step(log_z, BLEND) * (far - near)


@cache
def shock_arrival(burst: str) -> Arrival:
    """Return the arrival of one burst, scaled: everything in m/kg^(1/3)."""
    pressure = kingery_bulmash_curve("incident_pressure", burst).segments[0]
    arrival = kingery_bulmash_curve("arrival_time", burst).segments[0]
    tail, start = front_tail(burst), math.log(pressure.z_min)
    return chebyshev_arrival(
        lambda log_z: pressure.log_value(log_z) - LOG_STANDARD_PRESSURE,
        partial(front_mach_number, burst=burst),
        start=pressure.z_min,
        start_time=STANDARD_SOUND_SPEED * math.exp(arrival.log_value(start)),
        first=pressure.z_min,
        join=JOIN,
        # Degrees by trial: each leaves less than 1e-10 of the arrival.
        degrees=(90, 50),
        tail=Tail(
            lambda log_z: tail.log_pressure(log_z) - LOG_STANDARD_PRESSURE,
            degree=18,
            log_length=math.log(tail.length),
        ),
        inner_slope=arrival.log_slope(start),
    )


@cache
def front_tail(burst: str) -> WeakShockTail:
    """Return the tail that continues the pressure curve of a burst."""
    curve = kingery_bulmash_curve("incident_pressure", burst)
    return weak_shock_tail(curve.segments[-1], JOIN)


def front_log_pressure(log_z: Float[Array, "..."], burst: str) -> Float[Array, "..."]:
    """Return ln p (p in Pa) at standard ambient pressure."""
    near = log_z < math.log(JOIN)
    # each branch has an input in its own range, so that no unused gradient is NaN
    near_curve = kingery_bulmash_curve("incident_pressure", burst)
    return jnp.where(
        near,
        near_curve.log_value(jnp.where(near, log_z, math.log(JOIN))),
        front_tail(burst).log_pressure(jnp.where(near, math.log(JOIN), log_z)),
    )


def front_mach_number(log_z: Float[Array, "..."], burst: str) -> Float[Array, "..."]:
    """Return U/c."""
    return jnp.sqrt(
        1.0
        + 6.0 / 7.0 * jnp.exp(front_log_pressure(log_z, burst) - LOG_STANDARD_PRESSURE)
    )


for _quantity, _function, _range, _valid, _sd, _far in (
    (
        "air_arrival_s",
        shock_kinematics_arrival_time,
        _TO_SOUND,
        shock_kinematics_valid,
        0.01,
        None,
    ),
    (
        "peak_overpressure_pa",
        shock_kinematics_pressure,
        _RECORDED,
        _validity("incident_pressure", FAR_END),
        0.10,
        measured_far_scatter("peak_overpressure_pa"),
    ),
    (
        "shock_speed_m_s",
        shock_kinematics_shock_speed,
        _TO_SOUND,
        shock_kinematics_valid,
        0.01,
        None,
    ),
):
    register(
        Law(
            quantity=_quantity,
            name="shock_kinematics",
            function=_function,
            range=_range,
            source="Kingery & Bulmash 1984 to Z = 20, weak-shock tail, 1/U integrated",
            valid=_valid,
            scatter=declared_scatter(shot=_sd, record=_sd),
            scatter_source="declared",
            joins=(*kingery_bulmash_joins(), JOIN),
            far_scatter=_far,
        )
    )

for _phase_quantity, _phase_function, _phase_valid, _phase_first in (
    (
        "positive_duration_s",
        shock_kinematics_duration,
        _validity("positive_phase_duration", FAR_END),
        "0.178 (free-air 0.147)",
    ),
    (
        "positive_impulse_pa_s",
        shock_kinematics_impulse,
        _validity("incident_impulse", FAR_END),
        "0.0674 (free-air 0.0531)",
    ),
):
    register(
        Law(
            quantity=_phase_quantity,
            name="shock_kinematics",
            function=_phase_function,
            range=f"Z = {_phase_first} to 300 m/kg^(1/3); no absorption",
            source="Kingery & Bulmash 1984 to Z = 40, weak shock from there",
            valid=_phase_valid,
            scatter=declared_scatter(shot=0.10, record=0.10),
            scatter_source="declared",
            joins=kingery_bulmash_joins(),
            far_scatter=measured_far_scatter(_phase_quantity),
        )
    )
