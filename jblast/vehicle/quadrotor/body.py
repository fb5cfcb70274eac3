"""What a blast acts on beside the rotors, and how it is read from a table of names."""

from collections.abc import Mapping
from typing import Any

import equinox as eqx
from jaxtyping import Array, Float

from jblast.errors import InputError
from jblast.vehicle.quadrotor.numbers import floats, number, numbers

BODY = (
    "body_area",
    "body_drag_coefficient",
    "body_volume",
    "added_mass_coefficient",
    "pressure_centre",
)


class Body(eqx.Module):
    """What a blast acts on beside the rotors. Leading axes are a batch's.

    Attributes:
        area_m2: Projected along the body's x, y and z axes [m2].
        drag_coefficient: On those areas [-].
        volume_m3: Of the air it displaces [m3].
        added_mass_coefficient: $C_m$ [-]: 0.5 for a sphere.
        pressure_centre_m: Where these forces act, from the centre of mass, body [m].
    """

    area_m2: Float[Array, "*batch 3"] = eqx.field(converter=floats)
    drag_coefficient: Float[Array, "*batch"] = eqx.field(converter=floats)
    volume_m3: Float[Array, "*batch"] = eqx.field(converter=floats)
    added_mass_coefficient: Float[Array, "*batch"] = eqx.field(converter=floats)
    pressure_centre_m: Float[Array, "*batch 3"] = eqx.field(converter=floats)


def read_body(parameters: Mapping[str, Any]) -> Body | None:
    """Return what a blast acts on, or None if none of it is told."""
    if not any(key in parameters for key in BODY):
        return None
    area = numbers(parameters.get("body_area"), "body_area", (3,), least=0.0)
    centre = numbers(parameters.get("pressure_centre"), "pressure_centre", (3,))
    drag, volume, added = (
        number(parameters, key, least=0.0)
        for key in ("body_drag_coefficient", "body_volume", "added_mass_coefficient")
    )
    return Body(area, drag, volume, added, centre)


def required_body(body: Body | None) -> Body:
    """Return what a blast acts on.

    Raises:
        InputError: Nothing is known of it.
    """
    if body is None:
        raise InputError(
            f"vehicle: expected one with {', '.join(BODY[:-1])} and {BODY[-1]} for a "
            "blast to act on, got none of them"
        )
    return body
