import jax
import numpy as np
import pytest

from jblast.waves.laws.kingery_bulmash import kingery_bulmash_pressure
from jblast.waves.propagation import (
    hemispherical_spreading_loss,
    spherical_spreading_loss,
)


def test_each_doubling_of_range_costs_six_decibels():
    ranges = np.array([1.0, 2.0, 4.0, 10.0])
    # 6.02 dB, and 20 dB for a decade
    np.testing.assert_allclose(
        spherical_spreading_loss(ranges, 1.0), [0.0, 6.02, 12.04, 20.0], atol=5e-3
    )


@pytest.mark.parametrize(
    ("law", "solid_angle"),
    [
        (spherical_spreading_loss, 4 * np.pi),
        (hemispherical_spreading_loss, 2 * np.pi),
    ],
)
def test_the_energy_through_every_shell_is_that_of_the_source(law, solid_angle):
    radius = np.array([0.5, 3.0, 70.0, 2e3])
    intensity = 10 ** (-law(radius, 3.0) / 10)  # of that at 3 m in free air
    np.testing.assert_allclose(
        solid_angle * radius**2 * intensity, 4 * np.pi * 3.0**2, rtol=1e-12
    )


def test_hard_ground_raises_the_amplitude_by_root_two():
    gain = spherical_spreading_loss(50.0, 2.0) - hemispherical_spreading_loss(50.0, 2.0)
    np.testing.assert_allclose(10 ** (gain / 20), np.sqrt(2.0), rtol=1e-12)


def test_far_blasts_gain_two_of_the_three_decibels_in_pressure():
    # by Kingery and Bulmash at Z = 20, where their ground factor is 2.0 (two digits)
    gain = 20 * np.log10(
        kingery_bulmash_pressure(20.0, 1.0, burst="surface")
        / kingery_bulmash_pressure(20.0, 1.0, burst="free-air")
    )
    # 2^(1/3) where p goes as 1/R; at Z = 20 as R^-1.2, so a little more: 2.4 dB
    assert 2.0 < gain < 2.7


def test_the_slope_is_that_of_the_logarithm():
    slope = jax.grad(spherical_spreading_loss, argnums=(0, 1))(50.0, 2.0)
    unit = 20 / np.log(10)
    np.testing.assert_allclose(slope, [unit / 50.0, -unit / 2.0], rtol=1e-12)


def test_a_range_that_is_none_is_refused():
    with pytest.raises(ValueError, match="slant_range must be positive, got 0 m"):
        spherical_spreading_loss(0.0, 1.0)
    with pytest.raises(ValueError, match="reference_range must be positive"):
        hemispherical_spreading_loss(1.0, -1.0)
