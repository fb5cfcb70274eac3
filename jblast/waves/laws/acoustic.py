r"""Arrival at the speed of sound: where the blast wave ends up far away.

The strong shock near the charge runs ahead of sound and never loses that lead: by
`shock_kinematics` 3.0 m/kg^(1/3) at Z = 20, 3.7 at 100 and 4.3 at 500 on the surface
(2.6, 3.1 and 3.4 in free air), and it keeps growing, ever more slowly, as the square
root of ln Z. An arrival says nothing about the mass by this law, and the law is late:
by 18 % at Z = 20, 3.8 % at 100, 0.86 % at 500. `shock_kinematics` carries the lead
along and is to be preferred.
"""

from jaxtyping import Array, ArrayLike, Bool, Float

from jblast.constants import STANDARD_PRESSURE
from jblast.registry import Law, declared_scatter, register
from jblast.types import as_float_arrays
from jblast.waves.arguments import checked
from jblast.waves.scaling import scaled_distance

NEAREST_SCALED_DISTANCE = 500.0
"""Where the lead of the shock has become less than the declared 1 % [m/kg^(1/3)]."""


@checked
def acoustic_arrival_time(
    slant_range: Float[ArrayLike, "..."],
    sound_speed: Float[ArrayLike, "..."],
) -> Float[Array, "..."]:
    r"""Return the travel time of sound in still air [s].

    $$t_a = R/c_0$$

    Args:
        slant_range: Range $R$ [m].
        sound_speed: Ambient sound speed $c_0$ [m/s], positive.
    """
    slant_range, sound_speed = as_float_arrays(slant_range, sound_speed)
    return slant_range / sound_speed


def acoustic_valid(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
) -> Bool[Array, "..."]:
    """Return where the shock's lead is less than 1 % of the way: Z of 500 and more."""
    z = scaled_distance(slant_range, charge_mass, ambient_pressure)
    return z >= NEAREST_SCALED_DISTANCE


register(
    Law(
        quantity="air_arrival_s",
        name="acoustic",
        function=acoustic_arrival_time,
        range="Z >= 500 m/kg^(1/3) (shock's lead over sound below 1 %)",
        source="definition of the sound speed",
        valid=acoustic_valid,
        scatter=declared_scatter(shot=0.01, record=0.01),
        scatter_source="declared",
    )
)
