"""About which point the moments of a profile are told: their levers give it away."""

import numpy as np
from jaxtyping import Float

from jblast.errors import InputError, argument
from jblast.vehicle.quadrotor.parameters import Vehicle

SIZES = 3.0
"""A wave's impulse acts on the vehicle itself: its lever about the centre of mass is no
longer than so many distances from there to the farthest rotor."""


def check_levers(cases: Float[np.ndarray, "case 10"], vehicle: Vehicle) -> None:
    """Refuse moments that cannot be about a vehicle's centre of mass.

    Args:
        cases: As `read_custom_profile` returns them.
        vehicle: On which they act.

    Raises:
        InputError: A case's moment is its impulse times a lever longer than `SIZES`
            times the vehicle's.
    """
    arms = np.linalg.norm(np.asarray(vehicle.rotor_position_m, float), axis=-1)
    size = float(arms.max())
    push, turn = (np.linalg.norm(cases[:, a:b], axis=1) for a, b in ((4, 7), (7, 10)))
    far = turn > SIZES * size * push
    if not far.any():
        return
    with np.errstate(divide="ignore"):
        levers = np.where(far, turn / push, 0.0)
    worst = int(np.argmax(levers))
    raise InputError(
        f"profile: case {worst + 1} of {len(cases)} has a moment of {turn[worst]:.3g} "
        f"N m s with an impulse of {push[worst]:.3g} N s, a lever of "
        f"{levers[worst]:.3g} m; expected at most {SIZES * size:.2g} m, {SIZES:g} "
        "times from the vehicle's centre to its rotors. Moments about another point "
        f"need {argument('moment_point_m')}: from that point to the "
        "centre of mass, body axes; 0,0,0 where they are about that after all"
    )
