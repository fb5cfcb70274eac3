import math
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.constants import STANDARD_PRESSURE
from jblast.waves.laws.dna_1kt import (
    dna_1kt_arrival_time,
    dna_1kt_pressure,
    dna_1kt_valid,
)
from jblast.waves.laws.kingery_bulmash import kingery_bulmash_pressure

ONE_KILOTON = 0.5e6
"""Mass of TNT with the air blast of 1 kt nuclear [kg]."""
AIR = (STANDARD_PRESSURE, 340.5)
"""The ambient air of the standard."""


@pytest.mark.parametrize("r", [1.0, 16.0, 83.4, 445.42, 4000.0, 1e6])
def test_the_printed_formulas_come_out_for_one_kiloton(r):
    x = r / 445.42
    weak = math.sqrt(math.log(x + 3 * math.exp(-math.sqrt(x) / 3)))
    assert float(dna_1kt_pressure(r, ONE_KILOTON)) == pytest.approx(
        3.04e11 / r**3 + 1.13e9 / r**2 + 7.9e6 / (r * weak), rel=1e-12
    )
    assert float(dna_1kt_arrival_time(r, ONE_KILOTON, *AIR)) == pytest.approx(
        r**2 * (6.7 + r) / (7.12e6 + 7.32e4 * r + 340.5 * r**2), rel=1e-12
    )


# formulas.md 7: it equals Kingery & Bulmash, spherical, for 0.43-0.50 kt of TNT at 100
# to 1600 m. In between these places it is 0.41 (150 m) to 0.51 kt (600 m).
@pytest.mark.parametrize(
    ("r", "kilotons"),
    [(100.0, 0.43), (200.0, 0.43), (400.0, 0.49), (800.0, 0.50), (1600.0, 0.49)],
)
def test_one_kiloton_nuclear_is_nearly_half_a_kiloton_of_tnt(r, kilotons):
    pressure = float(dna_1kt_pressure(r, ONE_KILOTON))
    kingery_bulmash = partial(kingery_bulmash_pressure, r, burst="free-air")
    low, high = 1e5, 2e6
    for _ in range(40):
        mass = math.sqrt(low * high)
        stronger = float(kingery_bulmash(mass)) > pressure
        low, high = (low, mass) if stronger else (mass, high)
    assert low / 1e6 == pytest.approx(kilotons, abs=0.005)


# formulas.md 11: p/P0 of the exact point source, and 7: the standard is 0.50-0.81 of
# that of 1 kt, 4.184 TJ.
@pytest.mark.parametrize(
    ("scaled", "exact"),
    [
        (0.1, 157.8),
        (0.3, 6.721),
        (1.0, 0.4986),
        (3.0, 0.09463),
        (10.0, 0.02046),
        (30.0, 5.64e-3),
        (100.0, 1.459e-3),
        (1e3, 1.196e-4),
        (1e6, 8.54e-8),
    ],
)
def test_its_pressure_is_a_half_to_four_fifths_of_the_point_source(scaled, exact):
    r = scaled * (4.184e12 / STANDARD_PRESSURE) ** (1 / 3)
    ratio = float(dna_1kt_pressure(r, ONE_KILOTON)) / STANDARD_PRESSURE / exact
    assert 0.50 <= ratio <= 0.81


def test_close_in_it_is_a_strong_shock_and_far_out_a_weak_one():
    slope = jax.grad(lambda x: jnp.log(dna_1kt_pressure(jnp.exp(x), ONE_KILOTON)))
    # the second term is 1.13e9 / 3.04e11 of the first at a metre
    assert float(slope(math.log(1e-3))) == pytest.approx(-3.0, abs=1e-5)
    r = 1e9
    # what is left of the second term at this place: 1.13e9/7.9e6/r
    weak = -1 - 0.5 / math.log(r / 445.42)
    assert float(slope(math.log(r))) == pytest.approx(weak, abs=1e-6)


def test_far_away_the_arrival_is_that_of_sound_for_the_sound_speed_given():
    # exactly: the fraction rounds to one
    for sound_speed in (300.0, 340.29, 340.5, 360.0):
        arrival = dna_1kt_arrival_time(1e20, 1.0, 5e4, sound_speed)
        assert float(arrival) == pytest.approx(1e20 / sound_speed, rel=1e-15)
    # and the shock has run 208 m ahead for a kiloton: 7.32e4/340.5 - 6.7
    lead = 1e7 - 340.5 * float(dna_1kt_arrival_time(1e7, ONE_KILOTON, *AIR))
    assert lead == pytest.approx(7.32e4 / 340.5 - 6.7, rel=1e-3)


def test_the_two_fits_are_consistent():
    # one over the slope of the arrival against Rankine and Hugoniot from the pressure;
    # two separate fits: 3 % from 100 m on
    r = jnp.geomspace(100.0, 4000.0, 60)
    slowness = jax.vmap(lambda x: jax.grad(dna_1kt_arrival_time)(x, ONE_KILOTON, *AIR))
    relative = dna_1kt_pressure(r, ONE_KILOTON) / STANDARD_PRESSURE
    mach = jnp.sqrt(1 + 6 / 7 * relative)
    np.testing.assert_allclose(1 / (340.5 * slowness(r)), mach, rtol=0.03)


def test_it_holds_in_free_air_from_16_to_4000_metres_for_a_kiloton():
    r = np.array([15.9, 16.1, 3990.0, 4010.0])
    assert dna_1kt_valid(r, ONE_KILOTON).tolist() == [False, True, True, False]
    # 1 kg: Z = 0.2016 and 50.4
    z = np.array([0.2, 0.203, 50.0, 51.0])
    assert dna_1kt_valid(z, 1.0).tolist() == [False, True, True, False]
    assert not dna_1kt_valid(100.0, ONE_KILOTON, burst="surface")
