"""A flight as a table of CSV, which `jblast discover` reads.

Beside the parts of a trajectory it has the direction in which the rotors pull, body z
in the world's axes: in it the thrust's push is linear, in the quaternion it is not.
"""

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from jblast.report.tables import comma_separated
from jblast.vehicle import Trajectory

WORLD, BODY, ROTORS = ("east", "north", "up"), "xyz", "1234"
COLUMNS = {
    "position_m": [f"{axis}_m" for axis in WORLD],
    "velocity_m_s": [f"velocity_{axis}_m_s" for axis in WORLD],
    "quaternion": [f"quaternion_{part}" for part in "ijkw"],
    "body_rate_rad_s": [f"body_rate_{axis}_rad_s" for axis in BODY],
    "rotor_speed_rad_s": [f"rotor_speed_{n}_rad_s" for n in ROTORS],
    "force_n": [f"force_{axis}_n" for axis in WORLD],
    "moment_n_m": [f"moment_{axis}_n_m" for axis in BODY],
}
"""Columns by the trajectory's parts."""

PULL = [f"pull_{axis}" for axis in WORLD]


def trajectory_csv(
    trajectory: Trajectory, path_error_m: Float[np.ndarray, " time"], comment: str
) -> str:
    """Return the rows of one flight, up to where it was lost if it was.

    Args:
        trajectory: The flight.
        path_error_m: Of each row.
        comment: What is said of it in the first line.
    """
    names = [name for part in COLUMNS.values() for name in part]
    parts = [np.asarray(trajectory.time_s)[:, None]]
    parts += [np.asarray(getattr(trajectory, name)) for name in COLUMNS]
    rows = np.hstack([*parts, path_error_m[:, None]])
    rows = rows[np.isfinite(rows).all(axis=1)]
    first = 1 + names.index("quaternion_i")
    attitude = Rotation.from_quat(rows[:, first : first + 4]).as_matrix()
    rows = np.hstack([rows, attitude[:, :, 2]])
    columns = ["time_s", *names, "path_error_m", *PULL]
    numbers = ([f"{value:.12g}" for value in row] for row in rows)
    return f"# {comment}\n" + comma_separated([columns, *numbers])
