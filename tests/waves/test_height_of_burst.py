import numpy as np
import pytest

from jblast.waves.height_of_burst import bursts_in_free_air, image_range


def test_the_image_stands_as_far_below_the_ground():
    rng = np.random.default_rng(0)
    charge, sensor = rng.uniform(-30.0, 30.0, (2, 100, 3))
    charge[:, 2], sensor[:, 2] = rng.uniform(0.0, 30.0, (2, 100))
    image = charge * np.array([1.0, 1.0, -1.0])
    np.testing.assert_allclose(
        image_range(
            np.linalg.norm(charge - sensor, axis=1), charge[:, 2], sensor[:, 2]
        ),
        np.linalg.norm(image - sensor, axis=1),
        rtol=1e-12,
    )


@pytest.mark.parametrize(
    ("height", "sensor", "free"),
    [
        (12.0, 12.0, True),  # 19.5 m more of way, 57 ms; a phase of 2.6 ms
        (12.0, 0.0, False),  # on the ground both come at once
        (0.0, 12.0, False),
        (-1.0, 12.0, False),
        (2.0, 2.0, True),  # 1.4 m more, 3.6 ms
        (0.5, 0.5, False),  # 0.1 m more
    ],
)
def test_one_kilogram_at_five_metres(height, sensor, free):
    # free air at Z = 5: a positive phase of 2.6 ms (README of the reference tables:
    # 1.69 ms at 1.42), the front at 380 m/s and slower
    assert bool(bursts_in_free_air(5.0, 1.0, height, sensor)) is free
