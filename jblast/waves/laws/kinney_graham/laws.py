r"""Air blast of a TNT charge in free air, after Kinney and Graham.

Kinney and Graham (1985), *Explosive Shocks in Air*, 2nd ed., read second-hand in two
public programs (InfraPy, Supracenter) that agree; the formulas stand in
`curves.py`. The impulse is in one of them only, without its unit: bar ms
is from memory, and puts it at 0.62 to 0.98 of Kingery's and Bulmash's, Z = 0.06 to 40.
The shock speed follows from the pressure by Rankine and Hugoniot, the arrival from it:

$$t = \frac{1}{c_0} \int_{r_c}^{R} \frac{dr}{\sqrt{1 + \tfrac67\, p/P_0}}$$

from the charge's radius $r_c$ = 0.053 m/kg^(1/3); `arrival.py` tabulates
it, in float64 to 1e-11.

Range: we could read none, so the ranges are ours. Pressure and impulse: from the
charge's surface, Z = 0.053, to 40, as far as there is a Kingery-Bulmash curve to
compare with. Farther out the pressure falls as 1/Z, slower than a weak shock: 1.4
times `shock_kinematics` at Z = 100, 1.7 at 500. That hardly moves the shock any more:
its arrival stays within 0.2 % of `shock_kinematics` from Z = 7 on. So speed and arrival
hold to 1e4, past which absorption counts, and from 0.06: at the surface the arrival is
zero. Duration: Z = 4.2 to 33, where it is less than 30 % short of Kingery's and
Bulmash's.

Outside, the duration goes on as printed to Z = 0.5, where the formula turns up towards
the charge (to 5 times Kingery's and Bulmash's at 0.2, and 0.98 s for 1 kg at none), and
to 300; past these as a power law, as the arrival inside 0.06. All others are powers of
Z by themselves at both ends and go on as printed.

Against Kingery and Bulmash in free air at Z = 0.5, 1, 2, 5, 10, 40: pressure 1.03,
1.08, 1.07, 0.93, 0.90, 1.23; duration 0.26, 0.29, 0.63, 0.74, 0.83, 0.67, far shorter
near the charge though both programs have the same digits.

Other air: by Sachs (`scaling.py`), as every law here. Kinney and Graham multiply R by
$(P/P_0)^{1/3} (T_0/T)^{1/3}$, so by the density; but in an ideal gas a blast of given
energy has the one length $(W/P_0)^{1/3}$, and temperature enters only where a time is
given. The two differ by 1.2 % in distance for 10 K. Programs that write $(T/T_0)^{1/3}$
(InfraPy, older infraGA) have it upside down.
"""

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Bool, Float

from jblast.constants import STANDARD_PRESSURE, STANDARD_SOUND_SPEED
from jblast.registry import Law, declared_scatter, register
from jblast.types import as_float_array, as_float_arrays
from jblast.waves.arguments import checked
from jblast.waves.curves.arrival import log_sound_fraction
from jblast.waves.laws.kinney_graham.arrival import (
    CHARGE_RADIUS,
    FIRST,
    kinney_graham_arrival,
)
from jblast.waves.laws.kinney_graham.curves import (
    DURATION,
    IMPULSE,
    RELATIVE_PRESSURE,
    kinney_graham_mach_number,
)
from jblast.waves.scaling import (
    log_scaled_distance,
    sachs_impulse_factor,
    sachs_time_factor,
    scaled_distance,
)

SOURCE = "Kinney & Graham 1985 (Explosive Shocks in Air), over two transcriptions"
LAST_COMPARED = 40.0
"""Scaled distance to which there is a table to compare with [m/kg^(1/3)]."""
DURATION_COMPARES = (4.2, 33.0)
"""Scaled distances between which the duration is within 30 % of Kingery's and Bulmash's
[m/kg^(1/3)]; at 0.7 it is 23 % of theirs."""
LAST_UNABSORBED = 1e4
"""Scaled distance up to which absorption may be forgotten [m/kg^(1/3)]."""


@checked
def kinney_graham_pressure(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
) -> Float[Array, "..."]:
    """Return the peak incident overpressure in free air [Pa].

    Args:
        slant_range: Range $R$ [m], positive.
        charge_mass: TNT-equivalent mass $W$ [kg], positive.
        ambient_pressure: $P_0$ [Pa], positive.
    """
    slant_range, charge_mass, ambient_pressure = as_float_arrays(
        slant_range, charge_mass, ambient_pressure
    )
    log_z = log_scaled_distance(slant_range, charge_mass, ambient_pressure)
    return ambient_pressure * jnp.exp(RELATIVE_PRESSURE.log_value(log_z))


@checked
def kinney_graham_duration(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    sound_speed: Float[ArrayLike, "..."] = STANDARD_SOUND_SPEED,
) -> Float[Array, "..."]:
    """Return the duration of the positive phase [s].

    The arguments here and below:

    Args:
        slant_range: Range $R$ [m], positive.
        charge_mass: TNT-equivalent mass $W$ [kg], positive.
        ambient_pressure: $P_0$ [Pa], positive.
        sound_speed: $c_0$ [m/s], positive.
    """
    log_z = log_scaled_distance(slant_range, charge_mass, ambient_pressure)
    return sachs_time_factor(charge_mass, ambient_pressure, sound_speed) * jnp.exp(
        DURATION.log_value(log_z)
    )


@checked
def kinney_graham_impulse(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    sound_speed: Float[ArrayLike, "..."] = STANDARD_SOUND_SPEED,
) -> Float[Array, "..."]:
    """Return the incident impulse of the positive phase [Pa s]."""
    log_z = log_scaled_distance(slant_range, charge_mass, ambient_pressure)
    return sachs_impulse_factor(charge_mass, ambient_pressure, sound_speed) * jnp.exp(
        IMPULSE.log_value(log_z)
    )


@checked
def kinney_graham_arrival_time(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    sound_speed: Float[ArrayLike, "..."] = STANDARD_SOUND_SPEED,
) -> Float[Array, "..."]:
    """Return the time from the shock's leaving the charge to its arrival [s].

    Its derivative by the range is one over the shock speed, to rounding. Earlier than
    Kingery and Bulmash near the charge: by 53 % at Z = 0.1,
    16 % at 0.3, 6 % at 1, 0.2 % at 10.
    """
    log_z = log_scaled_distance(slant_range, charge_mass, ambient_pressure)
    sound_time = as_float_array(slant_range) / as_float_array(sound_speed)
    return sound_time * jnp.exp(log_sound_fraction(log_z, kinney_graham_arrival()))


@checked
def kinney_graham_shock_speed(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    sound_speed: Float[ArrayLike, "..."] = STANDARD_SOUND_SPEED,
) -> Float[Array, "..."]:
    """Return the speed of the shock front [m/s]: above $c_0$, and tending to it."""
    log_z = log_scaled_distance(slant_range, charge_mass, ambient_pressure)
    return as_float_array(sound_speed) * kinney_graham_mach_number(log_z)


def kinney_graham_valid(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    burst: str = "free-air",
) -> Bool[Array, "..."]:
    """Return where pressure and impulse hold; on the surface nothing does."""
    z = scaled_distance(slant_range, charge_mass, ambient_pressure)
    return (z >= CHARGE_RADIUS) & (z <= LAST_COMPARED) & (burst == "free-air")


def kinney_graham_duration_valid(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    burst: str = "free-air",
) -> Bool[Array, "..."]:
    """Return where the duration holds: not as near nor as far as the others."""
    z = scaled_distance(slant_range, charge_mass, ambient_pressure)
    first, last = DURATION_COMPARES
    return (z >= first) & (z <= last) & (burst == "free-air")


def kinney_graham_arrival_valid(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    burst: str = "free-air",
) -> Bool[Array, "..."]:
    """Return where arrival and shock speed hold: farther than the pressure."""
    z = scaled_distance(slant_range, charge_mass, ambient_pressure)
    return (z >= FIRST) & (z <= LAST_UNABSORBED) & (burst == "free-air")


_RANGE = "free air, Z = 0.053 to 40 m/kg^(1/3) (ours)"
_DURATION_RANGE = "free air, Z = 4.2 to 33 m/kg^(1/3) (ours)"
_ARRIVAL_RANGE = "free air, Z = 0.06 to 1e4 m/kg^(1/3) (ours); no absorption"

for _quantity, _function, _valid, _range, _sd, _joins in (
    (
        "air_arrival_s",
        kinney_graham_arrival_time,
        kinney_graham_arrival_valid,
        _ARRIVAL_RANGE,
        0.01,
        (FIRST,),
    ),
    (
        "peak_overpressure_pa",
        kinney_graham_pressure,
        kinney_graham_valid,
        _RANGE,
        0.10,
        (),
    ),
    (
        "positive_impulse_pa_s",
        kinney_graham_impulse,
        kinney_graham_valid,
        _RANGE,
        0.10,
        (),
    ),
    (
        "positive_duration_s",
        kinney_graham_duration,
        kinney_graham_duration_valid,
        _DURATION_RANGE,
        0.10,
        (DURATION.z_min, DURATION.z_max),
    ),
    (
        "shock_speed_m_s",
        kinney_graham_shock_speed,
        kinney_graham_arrival_valid,
        _ARRIVAL_RANGE,
        0.01,
        (),
    ),
):
    register(
        Law(
            quantity=_quantity,
            name="kinney_graham",
            function=_function,
            range=_range,
            source=SOURCE,
            valid=_valid,
            scatter=declared_scatter(shot=_sd, record=_sd),
            scatter_source="declared",
            joins=_joins,
        )
    )
