"""A flight for logs and telemetry: east at 2 m/s, then it hovers."""

import numpy as np

from jblast.autopilot.flight_record import FlightRecord
from jblast.observations.places import Frame

HOME = (47.0, 8.0, 500.0)


def eastward(seconds: float = 4.0) -> FlightRecord:
    time = np.arange(round(seconds / 0.01) + 1) * 0.01
    moves = np.zeros((time.size, 3))
    moves[:, 0] = np.where(time < seconds / 2, 2.0, 0.0)
    place = np.zeros((time.size, 3))
    place[:, 0] = np.minimum(2.0 * time, seconds)
    place[:, 2] = 10.0
    level = np.broadcast_to(np.array([0.0, 0, 0, 1]), (time.size, 4))
    return FlightRecord(
        time_s=time,
        position_m=place,
        velocity_m_s=moves,
        quaternion=level,
        body_rate_rad_s=np.zeros((time.size, 3)),
        controls=np.full((time.size, 4), 0.5),
        armed=time < seconds - 0.5,
        item=(time >= seconds / 2).astype(int),
        frame=Frame(*HOME),
        set_point_m=place,
    )
