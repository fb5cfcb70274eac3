"""An autopilot's motors, and the rotors that they turn.

PX4 numbers those of a quadrotor X: ahead right, behind left (both counter-clockwise),
ahead left, behind right (clockwise). A control is a share of the greatest speed, 0 to
1: thrust goes with its square, which PX4 is told by THR_MDL_FAC = 1.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from jblast.errors import InputError
from jblast.vehicle import Vehicle

CORNERS = ((1, -1), (-1, 1), (1, 1), (-1, -1))
"""Signs of ahead and left of PX4's motors 1 to 4."""
MOTOR_WORDS = "1 ahead right, 2 behind left, 3 ahead left, 4 behind right"
ARMED, LOCKSTEP = 128, 1
"""Bits of the mode, and of the flags, of HIL_ACTUATOR_CONTROLS."""


class Rotors(NamedTuple):
    """Which motor turns which rotor.

    Attributes:
        of_motor: The rotor of each motor.
        fastest_rad_s: The greatest speed.
    """

    of_motor: Int[np.ndarray, "4"]
    fastest_rad_s: float

    def speeds(self, controls: Float[np.ndarray, "4"]) -> Float[np.ndarray, "4"]:
        """Return the rotors' speeds by the motors' controls; NaN is a motor at rest."""
        turned = np.zeros(4)
        turned[self.of_motor] = np.clip(np.nan_to_num(controls), 0.0, 1.0)
        return turned * self.fastest_rad_s


def rotors_of(vehicle: Vehicle) -> Rotors:
    """Return which motor turns which rotor.

    Raises:
        InputError: The rotors do not stand as those of an X.
    """
    signs = np.sign(np.asarray(vehicle.rotor_position_m))[:, :2].astype(int)
    places = [(int(x), int(y)) for x, y in signs]
    if sorted(places) != sorted(CORNERS):
        raise InputError(
            f"vehicle {vehicle.name!r}: expected rotors at the corners of an X, as "
            "PX4's generic quadrotor has them, got others"
        )
    order = np.array([places.index(corner) for corner in CORNERS])
    return Rotors(order, float(vehicle.rotor_speed_max_rad_s))
