r"""The blast of a point source in air of gamma 1.4, from the strong shock to sound.

The solution of the equations of motion for energy released at a point, as a function of
$\lambda = R\,(P_0/E)^{1/3}$ with $E = 4.184$ MJ/kg times the mass. To $\lambda = 100$
(Z = 346) it runs through what `jblast.waves.euler` computed (`front.py`):
the pressure is within 1e-6 of the method of characteristics in all 41 rows of its table
there (S. Hancock, blast-ips, table S1x4, itself good to 7e-7) and within 2e-6 of that
solver between the nodes; the arrival, integrated from the speed
(`arrival.py`), is within 4e-6 of the table and 5e-6 of the solver's.
Beyond the grid, to Z = 1e4, the weak-shock continuation joins the solver, with its
error stated: against the same table 0.02 % low at $\lambda$ = 228, 0.09 % at 664,
0.21 % at 2359 (Z = 8150), 0.37 % at 1.07e4, 0.7 % at 5.7e5
(`calibration/results/point_source.txt`).

Whose energy? A charge of TNT is no point, and its products burn on: by the pressure in
free air of Kingery and Bulmash it acts as a point source of 1.5 MJ/kg at Z = 0.3, 3.0
at 0.5, 5.35 at 1, 6.4 at 2, 5.2 at 10 to 20, 4.1 at 40. So with 4.184 MJ/kg this law
gives 2.7 times their pressure at Z = 0.3, 1.4 at 0.5, 0.80 at 1, 0.73 at 2, 0.91 at 10
and 20, and the arrival is 0.36, 0.57, 0.88, 1.06, 1.02 and 1.02 of theirs.

Range: $\lambda \ge 0.1$ (Z = 0.346, 158 ambient pressures: real air has lost
its gamma of 1.4 well before) to Z = 1e4 of arrival and speed, where absorption has to
be reckoned with; the pressure to Z = 300, past which recorded peaks are half of a weak
shock's (`waves/shock/far_scatter.py`).
Outside it goes on, finite: by the strong limit and the weak-shock law.
"""

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Bool, Float

from jblast.constants import (
    STANDARD_PRESSURE,
    STANDARD_SOUND_SPEED,
    TNT_SPECIFIC_ENERGY,
)
from jblast.registry import Law, declared_scatter, register
from jblast.types import as_float_array, as_float_arrays
from jblast.waves.arguments import checked
from jblast.waves.curves.arrival import log_sound_fraction
from jblast.waves.laws.point_source.arrival import point_source_arrival
from jblast.waves.laws.point_source.front import (
    ENDS,
    log_overpressure_ratio,
    point_source_mach_number,
)
from jblast.waves.scaling import scaled_distance
from jblast.waves.shock.far_scatter import FAR_END, measured_far_scatter

LENGTH = (TNT_SPECIFIC_ENERGY / STANDARD_PRESSURE) ** (1.0 / 3.0)
"""Scaled distance of lambda = 1 [m/kg^(1/3)]: 3.456."""

RANGE = (ENDS[0] * LENGTH, 1e4)
"""Scaled distances where the law holds [m/kg^(1/3)]."""


def _log_lambda(slant_range, charge_mass, ambient_pressure) -> Float[Array, "..."]:
    """Return the logarithm of the distance in units of $(E/P_0)^{1/3}$."""
    radius, mass, ambient = as_float_arrays(slant_range, charge_mass, ambient_pressure)
    return jnp.log(radius) - jnp.log(TNT_SPECIFIC_ENERGY * mass / ambient) / 3.0


@checked
def point_source_pressure(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
) -> Float[Array, "..."]:
    """Return the peak incident overpressure [Pa].

    Args:
        slant_range: Range $R$ [m], positive.
        charge_mass: Hydrodynamic energy $E$ as TNT of 4.184 MJ/kg [kg], positive.
        ambient_pressure: $P_0$ [Pa], positive.
    """
    log_lambda = _log_lambda(slant_range, charge_mass, ambient_pressure)
    return as_float_array(ambient_pressure) * jnp.exp(
        log_overpressure_ratio(log_lambda)
    )


@checked
def point_source_shock_speed(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    sound_speed: Float[ArrayLike, "..."] = STANDARD_SOUND_SPEED,
) -> Float[Array, "..."]:
    r"""Return the speed of the shock front, $c_0\sqrt{1 + \tfrac67 p/P_0}$ [m/s].

    Args:
        slant_range: Range $R$ [m], positive.
        charge_mass: Hydrodynamic energy $E$ as TNT of 4.184 MJ/kg [kg], positive.
        ambient_pressure: $P_0$ [Pa], positive.
        sound_speed: $c_0$ [m/s], positive.
    """
    log_lambda = _log_lambda(slant_range, charge_mass, ambient_pressure)
    return as_float_array(sound_speed) * point_source_mach_number(log_lambda)


@checked
def point_source_arrival_time(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    sound_speed: Float[ArrayLike, "..."] = STANDARD_SOUND_SPEED,
) -> Float[Array, "..."]:
    r"""Return the time from detonation to the arrival of the shock [s].

    $$t = \int_0^R dr/U$$

    Args:
        slant_range: Range $R$ [m], positive.
        charge_mass: Hydrodynamic energy $E$ as TNT of 4.184 MJ/kg [kg], positive.
        ambient_pressure: $P_0$ [Pa], positive.
        sound_speed: $c_0$ [m/s], positive.
    """
    log_lambda = _log_lambda(slant_range, charge_mass, ambient_pressure)
    sound_time = as_float_array(slant_range) / as_float_array(sound_speed)
    return sound_time * jnp.exp(log_sound_fraction(log_lambda, point_source_arrival()))


def point_source_valid(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    burst: str = "surface",
) -> Bool[Array, "..."]:
    """Return where arrival and speed hold: Z from 0.346 to 1e4, in free air."""
    z = scaled_distance(slant_range, charge_mass, ambient_pressure)
    return (z >= RANGE[0]) & (z <= RANGE[1]) & (burst == "free-air")


def point_source_pressure_valid(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    burst: str = "surface",
) -> Bool[Array, "..."]:
    """Return where the pressure holds: Z from 0.346 to 300, in free air."""
    z = scaled_distance(slant_range, charge_mass, ambient_pressure)
    return (z >= RANGE[0]) & (z <= FAR_END) & (burst == "free-air")


for _quantity, _function, _valid, _last, _sd, _far in (
    (
        "air_arrival_s",
        point_source_arrival_time,
        point_source_valid,
        "1e4 m/kg^(1/3)",
        0.01,
        None,
    ),
    (
        "peak_overpressure_pa",
        point_source_pressure,
        point_source_pressure_valid,
        "300 m/kg^(1/3)",
        0.10,
        measured_far_scatter("peak_overpressure_pa"),
    ),
    (
        "shock_speed_m_s",
        point_source_shock_speed,
        point_source_valid,
        "1e4 m/kg^(1/3)",
        0.01,
        None,
    ),
):
    register(
        Law(
            quantity=_quantity,
            name="point_source",
            function=_function,
            range=f"free air, Z = 0.346 to {_last}; source small and light",
            source="jblast.waves.euler to Z = 346, weak-shock tail; 1/U integrated",
            valid=_valid,
            scatter=declared_scatter(shot=_sd, record=_sd),
            scatter_source="declared",
            joins=tuple(LENGTH * end for end in ENDS),
            far_scatter=_far,
        )
    )
