"""What is said of logs of a batch that cannot be read; nothing is compiled."""

import jax.numpy as jnp
import numpy as np
import pytest

from jblast.errors import InputError
from jblast.inference.many.residuals import checked, faults_of
from jblast.scene import Scene
from jblast.sensors import layout_of
from tests.inference.logs import log

PLACE = (40.0, 0.0, 1.0)
LAYOUT = layout_of(
    log(
        ("a", "peak_overpressure_pa", 9000.0, 100.0, PLACE),
        ("a", "air_arrival_s", 0.09, 1e-3, PLACE),
        ("a", "bearing_rad", 0.1, 1e-3, PLACE),
    ),
    Scene(),
)
GOOD = np.array([9000.0, -0.09, -0.1])
SIGMA = np.array([0.01, 1e-3, 1e-3])


@pytest.mark.parametrize(
    ("row", "value", "said"),
    [
        (0, -1.0, "peak_overpressure_pa: expected a positive number, got -1.0"),
        (0, np.inf, "peak_overpressure_pa: expected a positive number, got inf"),
        (1, np.nan, "air_arrival_s: expected a finite time, got nan"),
        (2, np.inf, "bearing_rad: expected a finite angle, got inf"),
    ],
)
def test_a_reading_that_cannot_be_is_told_with_what_was_expected(row, value, said):
    values = np.tile(GOOD, (3, 1))
    values[1, row] = value
    found = faults_of(LAYOUT, values, SIGMA, jnp.array([False, True, False]))
    assert found == ((1, f"log 1, row {row}, {said}"),)


@pytest.mark.parametrize("sigma", [-1e-3, np.nan, np.inf])
def test_an_error_that_cannot_be_is_told(sigma):
    sigmas = np.tile(SIGMA, (2, 1))
    sigmas[1, 1] = sigma
    found = faults_of(LAYOUT, np.tile(GOOD, (2, 1)), sigmas, jnp.array([False, True]))
    said = f"log 1, row 1, air_arrival_s: expected a finite sigma, got {sigma}"
    assert found == ((1, said),)


def test_errors_that_all_logs_share_have_to_be_finite():
    with pytest.raises(InputError, match="expected finite errors"):
        checked(LAYOUT, np.tile(GOOD, (2, 1)), np.array([0.01, np.nan, 1e-3]))
    with pytest.raises(InputError, match=r"sigma: expected \(3,\) or \(2, 3\)"):
        checked(LAYOUT, np.tile(GOOD, (2, 1)), SIGMA[:2])
    with pytest.raises(InputError, match=r"expected \(log, row\) with 3 rows"):
        checked(LAYOUT, GOOD, SIGMA)
