"""Numbers in another unit are those in SI."""

import numpy as np
import pytest

from jblast.units import in_si


@pytest.mark.parametrize(
    ("value", "unit", "si"),
    [
        (12.4, "ms", 0.0124),
        (1.1, "ft", 0.33528),
        (7.0, "percent", 0.07),
        (1.5, "psi", 1.5 * 6894.757293168361),
    ],
)
def test_a_number_in_another_unit(value, unit, si):
    (found,) = in_si(np.array([value]), unit)
    assert found == pytest.approx(si, rel=1e-15)
