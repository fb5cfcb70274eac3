"""Laws of Kingery and Bulmash: smooth, finite, scaled by charge and air."""

import math
from functools import cache

import jax.numpy as jnp
import numpy as np
import pytest

from jblast.constants import STANDARD_PRESSURE
from jblast.waves.laws import kingery_bulmash as kb
from jblast.waves.laws.kingery_bulmash import kingery_bulmash_curve
from tests.tools.slopes import with_slopes
from tests.waves.laws.kingery_bulmash.curves import LAWS

BURSTS = ("surface", "free-air")
every_law = pytest.mark.parametrize("quantity", LAWS)
both_bursts = pytest.mark.parametrize("burst", BURSTS)


@cache
def log_law(quantity, burst):
    """Give ln y of ln Z, at 1 kg in standard air, its slope and its curvature."""
    return with_slopes(
        lambda log_z: jnp.log(LAWS[quantity](jnp.exp(log_z), 1.0, burst=burst))
    )


@every_law
@both_bursts
def test_log_slopes_at_the_ends_of_the_table_are_the_same_from_both_sides(
    quantity, burst
):
    law, h = log_law(quantity, burst), 1e-5
    curve = kingery_bulmash_curve(quantity, burst)
    for end in (curve.z_min, curve.z_max):
        x = math.log(end)
        for side in (-h, h):
            # One-sided differences of second order: h^2 times a third derivative of
            # up to 1e3, rounding 4e-15 / 1e-5.
            (here, near, far), (slope, *_), _ = law([x, x + side, x + 2 * side])
            one_sided = (-3 * here + 4 * near - far) / (2 * side)
            assert one_sided == pytest.approx(slope, abs=1e-6)


@every_law
def test_past_the_table_the_log_slope_stays(quantity):
    _, slopes, _ = log_law(quantity, "surface")(np.log([40.0, 1e5, 1e-3, 1e-2]))
    assert slopes[1] == pytest.approx(slopes[0], rel=1e-12)
    assert slopes[3] == pytest.approx(slopes[2], rel=1e-12)


def test_nothing_is_valid_past_40_nor_below_the_first_row():
    surface = {0.06: False, 0.07: True, 39.9: True, 40.1: False}
    for z, valid in surface.items():
        assert bool(kb.kingery_bulmash_valid(z, 1.0)) is valid
    assert bool(kb.kingery_bulmash_valid(0.06, 1.0, burst="free-air"))
    assert not kb.kingery_bulmash_duration_valid(0.17, 1.0)
    assert kb.kingery_bulmash_duration_valid(0.18, 1.0)
    assert not kb.kingery_bulmash_duration_valid(0.14, 1.0, burst="free-air")
    assert kb.kingery_bulmash_duration_valid(0.15, 1.0, burst="free-air")
    assert not kb.kingery_bulmash_duration_valid(40.1, 1.0)


def test_the_range_counts_scaled_metres():
    # 100 m of 1 t is Z = 10; of 1 kg it is 100; of 1 kg in an eighth of the air, 50.
    assert kb.kingery_bulmash_valid(100.0, 1e3)
    assert not kb.kingery_bulmash_valid(100.0, 1.0)
    assert kb.kingery_bulmash_valid(70.0, 1.0, STANDARD_PRESSURE / 8)


@both_bursts
def test_wind_times_front_speed_and_density_is_the_overpressure(burst):
    ambient, sound = 9e4, 330.0
    r = np.geomspace(1.0, 40.0, 100)
    wind = kb.kingery_bulmash_blast_wind(r, 1.0, ambient, sound, burst)
    speed = kb.kingery_bulmash_shock_speed(r, 1.0, ambient, sound, burst)
    density = 1.4 * ambient / sound**2
    # momentum; their tabulated speed is within 0.6 % of the jump relation past Z = 1
    np.testing.assert_allclose(
        wind * speed * density,
        kb.kingery_bulmash_pressure(r, 1.0, ambient, burst),
        rtol=0.006,
    )
