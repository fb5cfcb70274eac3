"""The front of a shock: Kingery and Bulmash, then the tail of a weak shock."""

import math

import jax.numpy as jnp
import numpy as np
import pytest

from jblast.constants import STANDARD_PRESSURE, STANDARD_SOUND_SPEED
from jblast.errors import InputError
from jblast.waves.laws.kingery_bulmash import (
    kingery_bulmash_curve,
    kingery_bulmash_pressure,
    kingery_bulmash_shock_speed,
)
from jblast.waves.laws.shock_kinematics import (
    JOIN,
    front_tail,
    shock_kinematics_pressure,
    shock_kinematics_shock_speed,
    shock_kinematics_valid,
)
from jblast.waves.shock import weak_shock_tail
from tests.waves.laws.shock_kinematics.cases import FIRST, both_bursts, log_law


@both_bursts
def test_pressure_is_kingery_bulmash_up_to_the_join(burst):
    z = jnp.geomspace(0.01, 20.0, 100)[:-1]
    # The same polynomial: rounding of an exponent of 20.
    np.testing.assert_allclose(
        shock_kinematics_pressure(z, 1.0, burst=burst),
        kingery_bulmash_pressure(z, 1.0, burst=burst),
        rtol=1e-13,
    )


@both_bursts
def test_the_tail_meets_the_curve_in_value_and_slope(burst):
    law, join, h = log_law("pressure", burst), math.log(JOIN), 1e-5
    kingery_bulmash = kingery_bulmash_curve("incident_pressure", burst)
    value, slope, _ = law(join)
    assert value == pytest.approx(
        float(kingery_bulmash.log_value(jnp.asarray(join))), abs=1e-13
    )
    # The slope to the left is Kingery's and Bulmash's, to the right the formula's.
    assert slope == pytest.approx(kingery_bulmash.segments[0].log_slope(join), rel=1e-9)
    reach = join - math.log(front_tail(burst).length)
    assert slope == pytest.approx(-1 - 0.5 / reach, rel=1e-12)
    for side in (-h, h):
        # Second order: h^2 times a third derivative below 10, rounding 1e-15 / h.
        near, far = law([join + side, join + 2 * side])[0]
        one_sided = (-3 * value + 4 * near - far) / (2 * side)
        assert one_sided == pytest.approx(slope, abs=1e-8)


def test_a_curve_flatter_than_sound_has_no_tail():
    curve = kingery_bulmash_curve("incident_pressure", "surface").segments[0]
    with pytest.raises(InputError, match="slope at join must be steeper than -1"):
        weak_shock_tail(curve, 0.0674)


@both_bursts
def test_the_shock_speed_is_rankine_hugoniot(burst):
    z = jnp.geomspace(0.05, 1e5, 100)
    relative = shock_kinematics_pressure(z, 1.0, burst=burst) / STANDARD_PRESSURE
    # M^2 = 1 + 6x/7 from the exact jump conditions; rounding.
    mach = shock_kinematics_shock_speed(z, 1.0, burst=burst) / STANDARD_SOUND_SPEED
    np.testing.assert_allclose(mach**2, 1 + 6 / 7 * relative, rtol=1e-13)


@both_bursts
def test_the_speed_agrees_with_the_printed_speed_curve(burst):
    z = jnp.geomspace(FIRST[burst], 40.0, 300)
    ratio = shock_kinematics_shock_speed(
        z, 1.0, burst=burst
    ) / kingery_bulmash_shock_speed(z, 1.0, burst=burst)
    # Reference README: 0.5 % for Z >= 1 up to the join, up to 5 % near the charge.
    assert jnp.abs(ratio - 1)[z >= 1].max() < 0.006
    assert jnp.abs(ratio - 1).max() < 0.05


@both_bursts
def test_it_is_valid_from_the_first_row_to_ten_thousand(burst):
    first = FIRST[burst]
    z = jnp.array([0.99 * first, 1.01 * first, 40.0, 400.0, 9.9e3, 1.01e4])
    valid = shock_kinematics_valid(z, 1.0, burst=burst)
    assert valid.tolist() == [False, True, True, True, True, False]
