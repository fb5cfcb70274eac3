"""Where a camera's carrier was: the table of a flight, as `jblast fly` writes it."""

import csv
from pathlib import Path

import jax.numpy as jnp
import numpy as np

from jblast.errors import InputError, read_text, shown
from jblast.sensors.camera.geometry.camera_path import CameraPath

PLACE = ("east_m", "north_m", "up_m")
TURN = ("quaternion_i", "quaternion_j", "quaternion_k", "quaternion_w")
COLUMNS = ("time_s", *PLACE, *TURN)


def read_camera_path(path: str | Path) -> CameraPath:
    """Read a path: CSV with time_s, east_m, north_m, up_m and quaternion_i, j, k, w.

    Other columns, and lines that begin with #, are passed over.

    Args:
        path: The file; the quaternion is that from body to world, k before w.

    Raises:
        InputError: A column is missing, a value no finite number, the times do not
            rise, a quaternion is zero, or there are fewer than two rows.
    """
    lines = [
        (number, line)
        for number, line in enumerate(
            read_text(path, "a CSV file of a flight").splitlines(), start=1
        )
        if line.strip() and not line.lstrip().startswith("#")
    ]
    table = list(csv.reader(line for _, line in lines))
    header = [name.strip() for name in table[0]] if table else []
    for name in COLUMNS:
        if name not in header:
            raise InputError(
                f"{path}: expected a column {name}, as of the flight.csv of a flight, "
                f"got {shown(', '.join(header))}"
            )
    if len(table) < 3:
        raise InputError(
            f"{path}: expected two rows or more after the header, got {len(table) - 1}"
        )
    places = [header.index(name) for name in COLUMNS]
    rows = []
    for (number, _), cells in zip(lines[1:], table[1:], strict=True):
        try:
            row = [float(cells[place]) for place in places]
        except (ValueError, IndexError):
            row = [np.nan]
        if not np.isfinite(row).all():
            raise InputError(
                f"{path}: line {number}: expected finite numbers in "
                f"{', '.join(COLUMNS)}, got {shown(', '.join(cells))}"
            )
        rows.append(row)
    values = np.array(rows)
    late = np.flatnonzero(np.diff(values[:, 0]) <= 0.0)
    if len(late):
        raise InputError(
            f"{path}: line {lines[late[0] + 2][0]}: expected times that rise, got "
            f"{values[late[0] + 1, 0]:g} s after {values[late[0], 0]:g} s"
        )
    length = np.linalg.norm(values[:, 4:], axis=1, keepdims=True)
    if not length.all():
        number = lines[1 + int(np.argmin(length))][0]
        raise InputError(
            f"{path}: line {number}: expected a quaternion that is not zero, got zeros"
        )
    return CameraPath(
        jnp.asarray(values[:, 0]),
        jnp.asarray(values[:, 1:4]),
        jnp.asarray(values[:, 4:] / length),
    )
