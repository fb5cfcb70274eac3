"""The rows of a flight in lockstep as logs take them."""

import numpy as np

from jblast.autopilot.logs.record import FlightRecord
from jblast.autopilot.simulator.lockstep import Lockstep
from jblast.autopilot.simulator.rotors import Rotors
from jblast.observations.places.frame import Frame
from jblast.scene import Place


def lockstep_record(flight: Lockstep, rotors: Rotors, place: Place) -> FlightRecord:
    """Return the rows of a flight.

    Args:
        flight: The flight.
        rotors: Of the vehicle.
        place: Where the scene's origin lies.
    """
    rows = np.array([row.state for row in flight.rows])
    asked = np.array([row.asked_rad_s for row in flight.rows])
    return FlightRecord(
        time_s=np.array([row.time_s for row in flight.rows]),
        position_m=rows[:, :3],
        velocity_m_s=rows[:, 3:6],
        quaternion=rows[:, 6:10],
        body_rate_rad_s=rows[:, 10:13],
        controls=rows[:, 13:] / rotors.fastest_rad_s,
        armed=np.asarray(asked.any(axis=1)),
        item=np.zeros(len(rows), int),
        frame=Frame(*place),
    )
