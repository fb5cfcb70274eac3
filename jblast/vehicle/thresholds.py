"""From what on a blast may do more to a vehicle than move it.

No source was found that measured what blast a Crazyflie, a Hummingbird or an Iris
withstands. What stands here is declared, each number with where it is taken from; where
there is nothing to take it from it is None, unknown. Below all of them a vehicle may be
damaged; past one it need not be.
"""

from typing import NamedTuple


class Threshold(NamedTuple):
    """A number that an exposure is held against.

    Attributes:
        value: In the unit of the exposure; None: unknown.
        source: Where it is taken from, or that there is nothing.
    """

    value: float | None
    source: str


PARKED = Threshold(
    55e3,
    "declared: parked aircraft are past repair at 8 psi (DoD 6055.9-STD, C2.3, from "
    "memory); nothing is published of this vehicle",
)
FIRE = Threshold(0.0, "declared: any time in some 2000 K")

THRESHOLDS = {
    "crazyflie": {
        "peak_overpressure_pa": PARKED,
        "peak_acceleration_m_s2": Threshold(
            24 * 9.81,
            "declared: range of its accelerometer, 24 g (BMI088, Crazyflie 2.1), past "
            "which it knows its attitude no more; nothing is published of its frame",
        ),
        "fireball_time_s": FIRE,
    },
    "hummingbird": {
        "peak_overpressure_pa": PARKED,
        "peak_acceleration_m_s2": Threshold(
            None, "unknown: nothing is published of frame or accelerometer"
        ),
        "fireball_time_s": FIRE,
    },
    "iris": {
        "peak_overpressure_pa": PARKED,
        "peak_acceleration_m_s2": Threshold(
            16 * 9.81,
            "declared: range of its accelerometer, 16 g (MPU-6000, Pixhawk, from "
            "memory), past which it knows its attitude no more; nothing is published "
            "of its frame",
        ),
        "fireball_time_s": FIRE,
    },
}
"""Of the vehicles with a name, by the exposure's."""
