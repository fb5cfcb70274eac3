"""Speed limits of a mission, and the region where it may fly.

Defaults of PX4's parameters for missions of multicopters (from memory, in brackets).
"""

from typing import NamedTuple


class Limits(NamedTuple):
    """Defaults for a mission whose plan leaves them out.

    Attributes:
        speed_m_s: Over ground [MPC_XY_CRUISE].
        climb_m_s: [MPC_Z_V_AUTO_UP].
        descent_m_s: [MPC_Z_V_AUTO_DN].
        landing_m_s: Of the last metres [MPC_LAND_SPEED].
        acceleration_m_s2: Of the set point, in all directions [MPC_ACC_HOR is 3].
        acceptance_m: Of a waypoint that has no radius of its own; declared: PX4 has
            10 m, for aeroplanes too.
        return_m: Least height above home of the way back [RTL_RETURN_ALT].
        slow_below_m: Height from which a landing goes slowly [MPC_LAND_ALT2].
    """

    speed_m_s: float = 5.0
    climb_m_s: float = 3.0
    descent_m_s: float = 1.5
    landing_m_s: float = 0.7
    acceleration_m_s2: float = 2.0
    acceptance_m: float = 1.0
    return_m: float = 30.0
    slow_below_m: float = 5.0


FARTHEST_M = 20e3
"""From home: past it the ground is no plane (31 m at 20 km), and no battery lasts."""
CEILING_M = 4000.0
"""Above home: one density of air stands for all heights."""
MOST_LEGS = 5000
"""Of a plan, its jumps unrolled."""
TOUCH_M_S = 1.5
"""What a landing stands: faster is a crash. Declared: twice the speed of a landing."""
