r"""Wind and dynamic pressure behind the front of Kingery and Bulmash.

Their tables hold neither: both follow from the incident pressure by the jump relations
of `shock/rankine_hugoniot.py`. For air as an ideal gas, so above some ten bar (Z below
1) they are rougher than the pressure is.
"""

from jaxtyping import Array, ArrayLike, Float

from jblast.constants import STANDARD_PRESSURE, STANDARD_SOUND_SPEED
from jblast.registry import Law, declared_scatter, register
from jblast.waves.arguments import checked
from jblast.waves.laws.kingery_bulmash.laws import (
    RANGE,
    SOURCE,
    kingery_bulmash_pressure,
    kingery_bulmash_valid,
)
from jblast.waves.laws.kingery_bulmash.table import kingery_bulmash_joins
from jblast.waves.shock.rankine_hugoniot import blast_wind, dynamic_pressure


@checked
def kingery_bulmash_blast_wind(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    sound_speed: Float[ArrayLike, "..."] = STANDARD_SOUND_SPEED,
    burst: str = "surface",
) -> Float[Array, "..."]:
    """Return the peak speed of the air behind the front [m/s].

    Args:
        slant_range: Range $R$ [m], positive.
        charge_mass: TNT-equivalent mass $W$ [kg], positive.
        ambient_pressure: $P_0$ [Pa], positive.
        sound_speed: $c_0$ [m/s], positive.
        burst: "surface" (hemispherical) or "free-air" (spherical).
    """
    peak = kingery_bulmash_pressure(slant_range, charge_mass, ambient_pressure, burst)
    return blast_wind(peak, ambient_pressure, sound_speed)


@checked
def kingery_bulmash_dynamic_pressure(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    burst: str = "surface",
) -> Float[Array, "..."]:
    """Return the peak dynamic pressure of the wind [Pa].

    Args:
        slant_range: Range $R$ [m], positive.
        charge_mass: TNT-equivalent mass $W$ [kg], positive.
        ambient_pressure: $P_0$ [Pa], positive.
        burst: "surface" (hemispherical) or "free-air" (spherical).
    """
    peak = kingery_bulmash_pressure(slant_range, charge_mass, ambient_pressure, burst)
    return dynamic_pressure(peak, ambient_pressure)


for _quantity, _function in {
    "blast_wind_m_s": kingery_bulmash_blast_wind,
    "dynamic_pressure_pa": kingery_bulmash_dynamic_pressure,
}.items():
    register(
        Law(
            quantity=_quantity,
            name="kingery_bulmash",
            function=_function,
            range=f"{RANGE}; ideal gas",
            source=f"{SOURCE}; Rankine-Hugoniot",
            valid=kingery_bulmash_valid,
            scatter=declared_scatter(shot=0.10, record=0.10),
            scatter_source="declared",
            joins=kingery_bulmash_joins(),
        )
    )
