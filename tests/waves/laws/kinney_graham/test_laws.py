"""Laws of Kinney and Graham: slopes, scaling, batches and where they hold."""

import jax.numpy as jnp
import numpy as np
import pytest

from jblast.constants import STANDARD_PRESSURE, STANDARD_SOUND_SPEED
from jblast.waves.laws import kinney_graham as kg


def test_far_away_the_pressure_is_one_over_the_distance():
    far = 808 / 4.5**2 * 0.048 * 0.32 * 1.35
    # what is left of the bend at 4.5: (4.5 / 1e5)^2
    assert float(kg.kinney_graham_pressure(1e5, 1.0)) == pytest.approx(
        far / 1e5 * STANDARD_PRESSURE, rel=1e-8
    )


def test_the_shock_speed_is_rankine_hugoniot():
    z = jnp.geomspace(0.05, 1e5, 100)
    relative = kg.kinney_graham_pressure(z, 1.0) / STANDARD_PRESSURE
    mach = kg.kinney_graham_shock_speed(z, 1.0) / STANDARD_SOUND_SPEED
    np.testing.assert_allclose(mach**2, 1 + 6 / 7 * relative, rtol=1e-13)


def test_each_quantity_says_where_it_holds():
    expected = {
        kg.kinney_graham_valid: (0.053, 40.0),
        kg.kinney_graham_duration_valid: kg.DURATION_COMPARES,
        kg.kinney_graham_arrival_valid: (0.06, 1e4),
    }
    for valid, (first, last) in expected.items():
        # 8 kg: twice as far
        distance = 2.0 * np.array(
            [0.99 * first, 1.01 * first, 0.99 * last, 1.01 * last]
        )
        assert valid(distance, 8.0).tolist() == [False, True, True, False]


def test_nothing_is_valid_on_the_surface():
    for valid in (
        kg.kinney_graham_valid,
        kg.kinney_graham_duration_valid,
        kg.kinney_graham_arrival_valid,
    ):
        assert bool(valid(10.0, 1.0, burst="free-air"))
        assert not bool(valid(10.0, 1.0, burst="surface"))
