"""Tables of flights: rows of one flight over time, or a row for each vehicle.

`jblast discover` reads the table of a flight. Besides position, velocity and attitude
it has the direction of the rotors' thrust (body z in world axes), because acceleration
by thrust is linear in this direction, and not in the quaternion.
"""

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from jblast.files import table_text
from jblast.study.flight_results import (
    EXPOSURES,
    METRICS,
    ROWS,
    Flights,
    hold_words,
    metric,
)
from jblast.study.thinning import largest_since

AXES = ("east", "north", "up")
COLUMNS = {
    "position_m": [f"{axis}_m" for axis in AXES],
    "velocity_m_s": [f"velocity_{axis}_m_s" for axis in AXES],
    "quaternion": [f"quaternion_{part}" for part in "ijkw"],
    "body_rate_rad_s": [f"body_rate_{axis}_rad_s" for axis in "xyz"],
    "rotor_speed_rad_s": [f"rotor_speed_{n}_rad_s" for n in "1234"],
    "force_n": [f"force_{axis}_n" for axis in AXES],
    "moment_n_m": [f"moment_{axis}_n_m" for axis in "xyz"],
}
"""Columns of the table of a flight, by part of the trajectory."""
LOADS = ("force_n", "moment_n_m")
"""Parts of which a blast of some milliseconds must not fall between two rows."""
MET = ("arrival_s", "distance_m", "scaled_distance", "in_range")
"""Numbers of an `Encounter` in a row of several vehicles."""


def flight_csv(flown: Flights) -> str:
    """Return the rows of one flight as CSV, up to its divergence if it diverged.

    Of several controllers it has the first. A longer flight than of `ROWS` rows is
    thinned: force and moment of a row are the largest ones since the row before.
    """
    every, flight = -(-flown.trajectory.time_s.size // ROWS), flown.trajectory
    kept, comment, more = slice(None, None, every), "mission", {}
    if flown.mission is None:
        comment = f"position hold {hold_words(next(iter(flown.holds)))}"
    else:
        aim = np.asarray(flight.set_point_m)[kept]
        more = {f"set_point_{axis}_m": aim[:, n] for n, axis in enumerate(AXES)}
    columns = {"time_s": np.asarray(flight.time_s)[kept]}
    for part, names in COLUMNS.items():
        values = np.asarray(getattr(flight, part))
        rows = kept
        if part in LOADS:
            rows = largest_since(np.linalg.norm(values, axis=1), every)
        columns |= zip(names, values[rows].T, strict=True)
    columns["path_error_m"] = np.asarray(flight.path_error_m)[kept]
    rows = np.stack([*columns.values()])
    # the rows of a flight are not finite after its divergence
    known = np.isfinite(rows).all(axis=0)
    first = [*columns].index("quaternion_i")
    # SciPy has the scalar last, as the columns have
    turned = Rotation.from_quat(rows[first : first + 4, known].T).as_matrix()
    pull = {f"pull_{axis}": turned[:, n, 2] for n, axis in enumerate(AXES)}
    whole = [*rows[:, known], *pull.values(), *(x[known] for x in more.values())]
    numbers = ([f"{value:.12g}" for value in row] for row in np.stack(whole).T)
    head = f"{flown.vehicle.model}, {comment}, clock of the scene"
    return table_text([[*columns, *pull, *more], *numbers], [head])


def flights_csv(flights: Flights) -> str:
    """Return a row for each vehicle and controller: sampled parameters and results."""
    names, rows = [], []
    for hold, flown in flights.holds.items():
        columns: dict[str, Any] = {"vehicle": range(flights.count)}
        columns |= {"hold": [hold] * flights.count, **flights.drawn}
        for n, blast in enumerate(flights.blasts):
            columns |= {
                f"{name}.{blast}".rstrip("."): getattr(flown.encounter, name)[:, n]
                for name in MET
            }
        columns |= {name: metric(flown, name) for name in (*METRICS, *EXPOSURES)}
        columns |= {
            name: getattr(flown.metrics, name) for name in ("settled", "crashed")
        }
        columns["lost"] = flown.lost
        names = [*columns]
        cells = (map(_cell, np.asarray(values)) for values in columns.values())
        rows += zip(*cells, strict=True)
    return table_text([names, *rows])


def _cell(value: Any) -> str:
    if isinstance(value, str):
        return value
    if isinstance(value, bool | np.bool_):
        return "true" if value else "false"
    return f"{value:.9g}"
