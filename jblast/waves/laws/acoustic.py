r"""Arrival at the speed of sound, the limit of a blast wave far away.

The strong shock near the charge is ahead of sound, and never loses that lead. By
`shock_kinematics` it is 3.0 m/kg^(1/3) at Z = 20, 3.7 at 100 and 4.3 at 500 on the
surface (2.6, 3.1 and 3.4 in free air). It grows slowly, as the square root of ln Z. By
this law an arrival does not constrain the mass, and it is late: by 18 % at Z = 20,
3.8 % at 100, 0.86 % at 500. Prefer `shock_kinematics`, which includes the lead.
"""

from typing import Any

from jblast.constants import STANDARD_PRESSURE
from jblast.registry import Law, declared_scatter, register
from jblast.waves.arguments import Number, checked
from jblast.waves.scaling import scaled_distance
from jblast.waves.tables import Numbers

# Farther out the lead of the shock is less than the declared scatter of 1 %.
NEAREST_SCALED_DISTANCE = 500.0
"""Smallest scaled distance of the law [m/kg^(1/3)]."""


@checked
def acoustic_arrival_time(slant_range: Number, sound_speed: Number) -> Numbers:
    r"""Return the travel time of sound in still air [s].

    $$t_a = R/c_0$$

    Args:
        slant_range: Range $R$ [m].
        sound_speed: Ambient sound speed $c_0$ [m/s], positive.
    """
    return slant_range / sound_speed


def acoustic_valid(
    slant_range: Number,
    charge_mass: Number,
    ambient_pressure: Number = STANDARD_PRESSURE,
) -> Any:
    """Return True where the lead of the shock is below 1 % of the range: Z >= 500."""
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
