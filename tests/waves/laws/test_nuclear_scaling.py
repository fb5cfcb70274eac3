import math

import pytest

from jblast.waves.laws.nuclear_scaling import (
    LOG_NUCLEAR_SCALED_METRES,
    NUCLEAR_SCALED_METRES,
)


def test_half_a_kiloton_of_tnt_at_its_scaled_metre_is_one_nuclear_kiloton_at_79_37():
    mass = 0.5e6
    assert 1.0 * mass ** (1 / 3) == pytest.approx(NUCLEAR_SCALED_METRES, rel=1e-14)
    assert pytest.approx(79.37, abs=0.005) == NUCLEAR_SCALED_METRES
    assert math.exp(LOG_NUCLEAR_SCALED_METRES) == pytest.approx(NUCLEAR_SCALED_METRES)
