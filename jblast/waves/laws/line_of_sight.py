"""Light from a charge: the arrival of the flash, and the direction of its source.

Both follow a straight line from the charge to the sensor. Refraction bends it by some
1e-5 rad a kilometre near level ground; a compass and a level are far worse.
"""

import math
from typing import Any

from jblast.constants import LIGHT_SPEED
from jblast.registry import Law, declared_scatter, register
from jblast.types import namespace
from jblast.waves.arguments import Number, checked
from jblast.waves.tables import Numbers


@checked
def light_arrival_time(slant_range: Number) -> Numbers:
    r"""Return the travel time of light [s].

    $$t = R/c$$

    The speed is that in vacuum; air would delay it by 0.03 %: 1 ns a kilometre.

    Args:
        slant_range: Range $R$ [m].
    """
    return slant_range / LIGHT_SPEED


@checked
def bearing(toward_east: Number, toward_north: Number) -> Numbers:
    r"""Return the direction of the charge, clockwise from north [rad], 0 to $2\pi$.

    A charge exactly above or below has none: the result is zero, with slope zero.

    Args:
        toward_east: East component from sensor to charge [m].
        toward_north: North component from sensor to charge [m].
    """
    east, north, xp = toward_east, toward_north, namespace(toward_east, toward_north)
    aside = (east != 0) | (north != 0)
    # guarded on the input: the slope of arctan2 at (0, 0) is NaN
    angle = xp.arctan2(xp.where(aside, east, 0.0), xp.where(aside, north, 1.0))
    return xp.mod(angle, 2 * math.pi)


@checked
def elevation(toward_east: Number, toward_north: Number, toward_up: Number) -> Numbers:
    r"""Return the direction of the charge, above the horizon [rad].

    The horizon is level. Over a distance $d$ the Earth drops by $d^2/2R$, an angle of
    $d/2R$ = 8e-5 rad per kilometre.

    Args:
        toward_east: East component from sensor to charge [m].
        toward_north: North component from sensor to charge [m].
        toward_up: Upward component from sensor to charge [m].
    """
    xp = namespace(toward_east, toward_north, toward_up)
    squared = xp.square(toward_east) + xp.square(toward_north)
    # negated comparison, so that NaN stays NaN; guarded roots have a finite slope
    aside = ~(squared <= 0)
    level = xp.where(aside, xp.sqrt(xp.where(aside, squared, 1.0)), 0.0)
    apart = aside | (toward_up != 0)
    return xp.arctan2(xp.where(apart, toward_up, 0.0), xp.where(apart, level, 1.0))


def line_of_sight_valid(toward_east: Number, toward_north: Number) -> Any:
    """Return False exactly above or below the charge, where no bearing exists."""
    return (toward_east != 0) | (toward_north != 0)


for _quantity, _name, _function, _valid, _range, _source in (
    (
        "flash_time_s",
        "light",
        light_arrival_time,
        lambda slant_range: slant_range == slant_range,
        "everywhere",
        "SI Brochure, 9th edition",
    ),
    *(
        (
            quantity,
            "line_of_sight",
            function,
            line_of_sight_valid,
            "aside of the charge's vertical",
            "geometry",
        )
        for quantity, function in (
            ("bearing_rad", bearing),
            ("elevation_rad", elevation),
        )
    ),
):
    register(
        Law(
            quantity=_quantity,
            name=_name,
            function=_function,
            range=_range,
            source=_source,
            valid=_valid,
            scatter=declared_scatter(shot=0.0, record=0.0),
            scatter_source="exact",
        )
    )
