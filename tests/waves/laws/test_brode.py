import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import brentq

from jblast.waves.laws.brode import FARTHEST_Z, JOIN, brode_pressure, brode_valid
from jblast.waves.laws.kingery_bulmash import kingery_bulmash_pressure

HALF_BLEND = math.sqrt(1.05)


def near(z):
    """In bar."""
    return 6.7 / z**3 + 1.0


def far(z):
    """In bar."""
    return 0.975 / z + 1.455 / z**2 + 5.85 / z**3 - 0.019


def log_slope(z):
    return jax.vmap(jax.grad(lambda x: jnp.log(brode_pressure(jnp.exp(x), 1.0))))(
        jnp.log(z)
    )


def test_outside_the_blend_it_is_the_printed_branches():
    z = np.geomspace(0.05, JOIN / HALF_BLEND, 100)
    np.testing.assert_allclose(brode_pressure(z, 1.0), 1e5 * near(z), rtol=1e-13)
    z = np.geomspace(JOIN * HALF_BLEND, FARTHEST_Z, 100)
    np.testing.assert_allclose(brode_pressure(z, 1.0), 1e5 * far(z), rtol=1e-13)


def test_the_branches_change_between_where_each_is_10_bar():
    first = (6.7 / 9.0) ** (1 / 3)
    second = brentq(lambda z: far(z) - 10.0, 0.8, 1.2, xtol=1e-13)
    assert pytest.approx(first, abs=5e-5) == 0.9063
    assert second == pytest.approx(0.9295, abs=5e-5)
    assert pytest.approx(math.sqrt(first * second), rel=1e-9) == JOIN
    assert far(JOIN) / near(JOIN) == pytest.approx(1.07, abs=5e-3)


def test_the_second_branch_ends_at_a_tenth_of_a_bar():
    assert far(FARTHEST_Z) == pytest.approx(0.1, rel=1e-9)
    assert float(brode_pressure(FARTHEST_Z, 1.0)) == pytest.approx(1e4, rel=1e-9)


def test_far_away_where_the_print_is_negative_it_is_a_power_law():
    assert far(53.0) < 0
    end, beyond, further = log_slope(jnp.array([0.9999 * FARTHEST_Z, 53.0, 1e5]))
    # a ten-thousandth inside, times a curvature below 2
    np.testing.assert_allclose([beyond, further], end, rtol=0, atol=2e-4)
    assert float(brode_pressure(53.0, 1.0)) > 0


@pytest.mark.parametrize(
    ("z", "ratio"), [(1.0, 0.88), (2.0, 0.80), (5.0, 0.90), (10.0, 0.89)]
)
def test_ratios_to_kingery_bulmash_are_the_printed_ones(z, ratio):
    reference = kingery_bulmash_pressure(z, 1.0, burst="free-air")
    got = float(brode_pressure(z, 1.0) / reference)
    assert got == pytest.approx(ratio, abs=5e-3)


def test_valid_in_free_air_from_one_half_to_a_tenth_of_a_bar():
    z = np.array([0.49, 0.51, 9.92, 9.93])
    assert brode_valid(z, 1.0, burst="free-air").tolist() == [False, True, True, False]
    assert not brode_valid(z, 1.0, burst="surface").any()
