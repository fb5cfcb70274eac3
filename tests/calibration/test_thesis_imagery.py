from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest

from calibration.bake import fibonacci_lattice, packing_distance
from calibration.thesis_imagery import NUMBERS, ROLL, flight
from jblast.scene.camera import quaternion_matrix

ROOT = Path(__file__).parents[2]
KEPT = ROOT / "calibration" / "results" / "thesis_imagery.txt"


@pytest.mark.parametrize(("time_s", "rolled"), [(0.0, 1.0), (0.6, 0.0), (1.2, -1.0)])
def test_the_camera_flies_past_looking_at_the_blast_and_rolls(time_s, rolled):
    place, turn = (np.asarray(part) for part in flight().at(jnp.asarray(time_s)))
    right, down, ahead = np.asarray(quaternion_matrix(turn)).T
    towards = np.array([0.0, 0.0, 7.0]) - place
    # rows 50 ms apart, and straight between them: 1e-5 of a turn of half a degree
    np.testing.assert_allclose(ahead, towards / np.linalg.norm(towards), atol=1e-4)
    level = np.hypot(ahead[0], ahead[1])
    assert abs(right[2]) == pytest.approx(abs(rolled) * np.sin(ROLL) * level, abs=1e-4)
    assert np.sign(np.round(right[2], 4)) == -rolled  # its right side down, then up
    assert down[2] < 0.0


def test_the_kept_angles_are_those_of_the_lattice():
    rows = [line.split() for line in KEPT.read_text().splitlines()]
    kept = {int(row[0]): float(row[1]) for row in rows if row and row[0].isdigit()}
    assert set(kept) == set(NUMBERS)
    for number, degrees in kept.items():
        told = np.degrees(packing_distance(fibonacci_lattice(number)))
        assert degrees == pytest.approx(told, abs=6e-3)  # printed to 0.01
