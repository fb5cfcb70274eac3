"""Cases of a custom profile, and files of them."""

from pathlib import Path

import numpy as np

from jblast.vehicle.loads.impulse_table import COLUMNS

# delay, distance, polar and azimuthal angle: seen towards (-1, -1, -1) and along x
ASIDE = float(np.degrees(np.arccos(-1 / np.sqrt(3))))
ROWS = [
    [0.015, 8.66, ASIDE, -135.0, 0.09, 0.10, 0.21, -0.001, -21.0, 10.0],
    [0.030, 17.32, ASIDE, -135.0, 0.03, 0.03, 0.06, -0.0003, -6.0, 3.0],
]


def written(path: Path, rows, columns=COLUMNS) -> Path:
    lines = [",".join(columns), *(",".join(map(repr, row)) for row in rows)]
    path.write_text("\n".join(lines) + "\n")
    return path
