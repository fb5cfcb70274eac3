r"""Kinney and Graham (1985): chemical and nuclear explosions in free air.

*Explosive Shocks in Air*, 2nd ed., read second-hand in two public programs (InfraPy,
Supracenter) that agree. For a TNT charge, with $Z = R/W^{1/3}$, 1 kg and standard air:

$$\frac{p}{P_0} = \frac{808\,[1 + (Z/4.5)^2]}{\sqrt{1 + (Z/0.048)^2}
  \sqrt{1 + (Z/0.32)^2} \sqrt{1 + (Z/1.35)^2}}$$
$$t_d = \frac{980\,[1 + (Z/0.54)^{10}]}{[1 + (Z/0.02)^3] [1 + (Z/0.74)^6]
  \sqrt{1 + (Z/6.9)^2}} \; \mathrm{ms}$$
$$i = \frac{0.067 \sqrt{1 + (Z/0.23)^4}}{Z^2 \sqrt[3]{1 + (Z/1.55)^3}} \;
  \mathrm{bar\,ms}$$

The impulse is in one of the programs only, without its unit: bar ms is from memory, and
puts it at 0.62 to 0.98 of that of Kingery and Bulmash, Z = 0.06 to 40. The shock speed
follows from the pressure by Rankine and Hugoniot, the arrival from the speed:

$$t = \frac{1}{c_0} \int_{r_c}^{R} \frac{dr}{\sqrt{1 + \tfrac67\, p/P_0}}$$

from the charge's radius $r_c$ = 0.053 m/kg^(1/3), where the time is zero. It is
tabulated as in `waves/curves.py`, in float64 to 1e-11.

Range: none was found in print, so the ranges are ours. Pressure and impulse: from the
charge's surface, Z = 0.053, to 40, as far as there is a Kingery-Bulmash curve to
compare with. Farther out the pressure falls as 1/Z, slower than a weak shock: 1.4
times `shock_kinematics` at Z = 100, 1.7 at 500. That hardly moves the shock any more:
its arrival stays within 0.2 % of `shock_kinematics` from Z = 7 on. So speed and arrival
hold to 1e4, past which absorption counts, and from 0.06: at the surface the arrival is
zero. Duration: Z = 4.2 to 33, where it is less than 30 % short of Kingery's and
Bulmash's.

Outside, the duration continues as printed to Z = 0.5, where the formula turns up
towards the charge (to 5 times Kingery's and Bulmash's at 0.2, and 0.98 s for 1 kg at
none), and to 300; past these as a power law, as the arrival inside 0.06. All others are
powers of Z at both ends and continue as printed.

Against Kingery and Bulmash in free air at Z = 0.5, 1, 2, 5, 10, 40: pressure 1.03,
1.08, 1.07, 0.93, 0.90, 1.23; duration 0.26, 0.29, 0.63, 0.74, 0.83, 0.67, far shorter
near the charge though both programs have the same digits.

Other air: by Sachs (`scaling.py`), as for every law here. Kinney and Graham multiply R
by $(P/P_0)^{1/3} (T_0/T)^{1/3}$, so by the density; but in an ideal gas a blast of
given energy has the one length $(W/P_0)^{1/3}$, and temperature enters only where a
time is given. The two differ by 1.2 % in distance for 10 K. Programs that write
$(T/T_0)^{1/3}$ (InfraPy, older infraGA) have it upside down.

For a nuclear burst, with $z = R/Y^{1/3}$ in m/kt^(1/3) and the duration for 1 kt:

$$\frac{p}{P_0} = 3.2 \cdot 10^6\, z^{-3} \sqrt{1 + (z/87)^2}\,(1 + z/800)$$
$$t_d = \frac{180 \sqrt{1 + (z/100)^3}}{\sqrt{1 + z/40}\,
  [1 + (z/285)^5]^{1/6}\, [1 + z/50000]^{1/6}} \; \mathrm{ms}$$

The charge's mass is chemical, $Y = 2W$, so z = 79.37 Z (`scaling.py`). The printed
range is not known either. Ours is that of the DNA's 1 kt standard (`dna_1kt.py`), 16 to
4000 m/kt^(1/3), over which this pressure is 1.00 to 1.22 times that. Both formulas are
powers of z at their ends and continue as printed. Compared with Kingery's and Bulmash's
TNT in free air the duration is 0.89 to 1.22 from Z = 1 to 40, and ten times as long at
0.2, where a bomb, without the size of a charge, has a higher pressure for longer.
"""

import math
from functools import cache

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Bool, Float

from jblast.constants import STANDARD_PRESSURE, STANDARD_SOUND_SPEED
from jblast.registry import Law, declared_scatter, register
from jblast.types import as_float_array, as_float_arrays
from jblast.waves.arguments import checked
from jblast.waves.curves import (
    Arrival,
    Break,
    BrokenPowerLaw,
    Tail,
    chebyshev_arrival,
    log_sound_fraction,
)
from jblast.waves.scaling import (
    LOG_NUCLEAR_SCALED_METRES,
    NUCLEAR_SCALED_METRES,
    log_scaled_distance,
    sachs_impulse_factor,
    sachs_time_factor,
    scaled_distance,
)

SOURCE = "Kinney & Graham 1985 (Explosive Shocks in Air), over two transcriptions"
# The table of Kingery and Bulmash ends here: nothing to compare with farther out.
LAST_COMPARED = 40.0
"""Largest valid scaled distance of pressure and impulse [m/kg^(1/3)]."""
# Within 30 % of the duration of Kingery and Bulmash; at 0.7 it is 23 % of theirs.
DURATION_COMPARES = (4.2, 33.0)
"""Valid scaled distances of the duration [m/kg^(1/3)]."""
# Farther out absorption changes an arrival (see `shock_kinematics`).
LAST_UNABSORBED = 1e4
"""Largest valid scaled distance of arrival and speed [m/kg^(1/3)]."""
_RANGE = "free air, Z = 0.053 to 40 m/kg^(1/3) (ours)"
_DURATION_RANGE = "free air, Z = 4.2 to 33 m/kg^(1/3) (ours)"
_ARRIVAL_RANGE = "free air, Z = 0.06 to 1e4 m/kg^(1/3) (ours); no absorption"
# The arrival of Kinney and Graham starts at the surface of the charge; from memory.
CHARGE_RADIUS = 0.053
"""Radius of 1 kg of TNT (1600 kg/m3) [m/kg^(1/3)]."""
# At the surface the arrival is zero, and its logarithm has no slope.
FIRST_ARRIVAL = 0.06
"""Smallest scaled distance of the integral [m/kg^(1/3)]; below, it is a power law."""
RELATIVE_PRESSURE = BrokenPowerLaw(
    808.0,
    0.0,
    (
        Break(4.5, 2.0, 1.0),
        Break(0.048, 2.0, -0.5),
        Break(0.32, 2.0, -0.5),
        Break(1.35, 2.0, -0.5),
    ),
)
"""Overpressure over the ambient pressure."""
DURATION = BrokenPowerLaw(
    0.980,
    0.0,
    (
        Break(0.54, 10.0, 1.0),
        Break(0.02, 3.0, -1.0),
        Break(0.74, 6.0, -1.0),
        Break(6.9, 2.0, -0.5),
    ),
    z_min=0.5,
    z_max=300.0,
)
"""Seconds for 1 kg.

Cut where it turns up towards the charge, and where it has become constant to 0.05 % a
factor e: past that its tenth power would cost single precision its digits.
"""
IMPULSE = BrokenPowerLaw(
    6.7, -2.0, (Break(0.23, 4.0, 0.5), Break(1.55, 3.0, -1.0 / 3.0))
)
"""Pa s for 1 kg: 1 bar ms = 100 Pa s."""
NUCLEAR_SOURCE = (
    "Kinney & Graham 1985 (Explosive Shocks in Air), nuclear, two transcriptions"
)
NUCLEAR_RANGE = (
    "free air, z = 16 to 4000 m/kt^(1/3) (Z = 0.2 to 50 m/kg^(1/3)), Y = 2 W (ours)"
)
NUCLEAR_RELATIVE_PRESSURE = BrokenPowerLaw(
    3.2e6, -3.0, (Break(87.0, 2.0, 0.5), Break(800.0, 1.0, 1.0))
)
"""Overpressure over the ambient pressure, of m/kt^(1/3)."""
NUCLEAR_DURATION = BrokenPowerLaw(
    0.180,
    0.0,
    (
        Break(100.0, 3.0, 0.5),
        Break(40.0, 1.0, -0.5),
        Break(285.0, 5.0, -1.0 / 6.0),
        Break(50000.0, 1.0, -1.0 / 6.0),
    ),
)
"""Seconds for 1 kt, of m/kt^(1/3)."""


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
    """Return True where pressure and impulse are valid, in free air only."""
    z = scaled_distance(slant_range, charge_mass, ambient_pressure)
    return (z >= CHARGE_RADIUS) & (z <= LAST_COMPARED) & (burst == "free-air")


def kinney_graham_duration_valid(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    burst: str = "free-air",
) -> Bool[Array, "..."]:
    """Return True where the duration is valid, a narrower range than the pressure."""
    z = scaled_distance(slant_range, charge_mass, ambient_pressure)
    first, last = DURATION_COMPARES
    return (z >= first) & (z <= last) & (burst == "free-air")


def kinney_graham_arrival_valid(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    burst: str = "free-air",
) -> Bool[Array, "..."]:
    """Return True where arrival and shock speed are valid, beyond the pressure too."""
    z = scaled_distance(slant_range, charge_mass, ambient_pressure)
    return (z >= FIRST_ARRIVAL) & (z <= LAST_UNABSORBED) & (burst == "free-air")


@cache
def kinney_graham_arrival() -> Arrival:
    """Return the arrival, scaled: everything in m/kg^(1/3)."""
    return chebyshev_arrival(
        _log_relative_pressure,
        kinney_graham_mach_number,
        start=CHARGE_RADIUS,
        start_time=0.0,
        first=FIRST_ARRIVAL,
        join=10.0,
        # Degrees by trial: each leaves less than 1e-11 of the arrival.
        degrees=(80, 50),
        tail=Tail(_log_relative_pressure, degree=30),
    )


def _log_relative_pressure(log_z: np.ndarray) -> np.ndarray:
    """Return ln(p/P0) in NumPy, as the curve does in JAX."""
    value = np.full_like(log_z, math.log(RELATIVE_PRESSURE.factor))
    # ln(1 + e^x) by logaddexp, which does not overflow far beyond a break.
    for z, power, share in RELATIVE_PRESSURE.breaks:
        value += share * np.logaddexp(0.0, power * (log_z - math.log(z)))
    return value


def kinney_graham_mach_number(log_z: Float[Array, "..."]) -> Float[Array, "..."]:
    r"""Return U/c by Rankine and Hugoniot: $\sqrt{1 + \tfrac67\, p/P_0}$."""
    relative = jnp.exp(RELATIVE_PRESSURE.log_value(log_z))
    return jnp.sqrt(1.0 + 6.0 / 7.0 * relative)


@checked
def kinney_graham_nuclear_pressure(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
) -> Float[Array, "..."]:
    """Return the peak incident overpressure in free air [Pa].

    Args:
        slant_range: Range $R$ [m], positive.
        charge_mass: TNT-equivalent mass $W$ [kg], half of the nuclear yield.
        ambient_pressure: $P_0$ [Pa], positive.
    """
    slant_range, charge_mass, ambient_pressure = as_float_arrays(
        slant_range, charge_mass, ambient_pressure
    )
    log_z = log_scaled_distance(slant_range, charge_mass, ambient_pressure)
    log_z = log_z + LOG_NUCLEAR_SCALED_METRES
    return ambient_pressure * jnp.exp(NUCLEAR_RELATIVE_PRESSURE.log_value(log_z))


@checked
def kinney_graham_nuclear_duration(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    sound_speed: Float[ArrayLike, "..."] = STANDARD_SOUND_SPEED,
) -> Float[Array, "..."]:
    """Return the duration of the positive phase [s].

    Args:
        slant_range: Range $R$ [m], positive.
        charge_mass: TNT-equivalent mass $W$ [kg], half of the nuclear yield.
        ambient_pressure: $P_0$ [Pa], positive.
        sound_speed: $c_0$ [m/s], positive.
    """
    log_z = log_scaled_distance(slant_range, charge_mass, ambient_pressure)
    # Times of 1 kt grow with Y^(1/3), those of Sachs with W^(1/3).
    per_kilogram = jnp.exp(
        NUCLEAR_DURATION.log_value(log_z + LOG_NUCLEAR_SCALED_METRES)
        - LOG_NUCLEAR_SCALED_METRES
    )
    return sachs_time_factor(charge_mass, ambient_pressure, sound_speed) * per_kilogram


def kinney_graham_nuclear_valid(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    burst: str = "free-air",
) -> Bool[Array, "..."]:
    """Return True where the formulas are valid, in free air only."""
    z = scaled_distance(slant_range, charge_mass, ambient_pressure)
    z = z * NUCLEAR_SCALED_METRES
    return (z >= 16.0) & (z <= 4000.0) & (burst == "free-air")


for _quantity, _function, _valid, _range, _sd, _joins in (
    (
        "air_arrival_s",
        kinney_graham_arrival_time,
        kinney_graham_arrival_valid,
        _ARRIVAL_RANGE,
        0.01,
        (FIRST_ARRIVAL,),
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
            title="Kinney-Graham",
            function=_function,
            range=_range,
            source=SOURCE,
            valid=_valid,
            scatter=declared_scatter(shot=_sd, record=_sd),
            scatter_source="declared",
            joins=_joins,
        )
    )

for _nuclear_quantity, _nuclear_function in (
    ("peak_overpressure_pa", kinney_graham_nuclear_pressure),
    ("positive_duration_s", kinney_graham_nuclear_duration),
):
    register(
        Law(
            quantity=_nuclear_quantity,
            name="kinney_graham_nuclear",
            function=_nuclear_function,
            range=NUCLEAR_RANGE,
            source=NUCLEAR_SOURCE,
            valid=kinney_graham_nuclear_valid,
            scatter=declared_scatter(shot=0.10, record=0.10),
            scatter_source="declared",
        )
    )
