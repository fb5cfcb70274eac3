import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.test_util import check_grads
from scipy import constants

from jblast.sensors.camera.image import (
    FIRST_RADIATION,
    LINEAR_SRGB,
    LUMINANCE,
    SECOND_RADIATION,
    WAVELENGTHS,
    blackbody_light,
    matching_functions,
    relative_xyz,
)

WEIGHTS = np.array(LUMINANCE)


def blackbody_xyz(temperature):
    xyz, scale = relative_xyz(jnp.asarray(temperature, float))
    return scale[..., None] * xyz


def chromaticity(temperature):
    xyz = np.asarray(blackbody_xyz(temperature))
    return xyz[:2] / xyz.sum()


def test_2856_kelvin_is_illuminant_a():
    # CIE 15: (0.44758, 0.40745); 0.002 is what the fit of the curves is good to
    np.testing.assert_allclose(chromaticity(2856.0), [0.44758, 0.40745], atol=0.002)


def test_a_very_hot_body_is_as_blue_as_the_locus_ends():
    # Planckian locus for T to infinity: (0.2399, 0.2341)
    np.testing.assert_allclose(chromaticity(1e9), [0.2399, 0.2341], atol=0.003)


def test_platinum_at_its_freezing_point_was_the_candela():
    # 60 cd/cm2 by the definition of 1948, at 2041.4 K (ITS-90); the fit is good to 1 %
    assert float(blackbody_xyz(2041.4)[1]) == pytest.approx(60e4, rel=0.01)


def test_the_constants_are_codata_s():
    h, c, k = constants.h, constants.c, constants.k
    # ten digits
    assert pytest.approx(2 * h * c**2, rel=1e-9) == FIRST_RADIATION
    assert pytest.approx(h * c / k, rel=1e-9) == SECOND_RADIATION


def test_every_lobe_is_as_others_print_it():
    # The same fit with widths in nm and three digits, as encyclopedias have it; rounded
    # to 0.05 nm in 12 they move the curves by this much
    nanometres = 1e9 * WAVELENGTHS

    def lobe(height, middle, below, above):
        away = nanometres - middle
        return height * np.exp(-0.5 * (away / np.where(away < 0, below, above)) ** 2)

    red = lobe(1.056, 599.8, 37.9, 31.0) + lobe(0.362, 442.0, 16.0, 26.7)
    red += lobe(-0.065, 501.1, 20.4, 26.2)
    green = lobe(0.821, 568.8, 46.9, 40.5) + lobe(0.286, 530.9, 16.3, 31.1)
    blue = lobe(1.217, 437.0, 11.8, 36.0) + lobe(0.681, 459.0, 26.0, 13.8)
    curves = zip(matching_functions().T, (red, green, blue), strict=True)
    for (ours, printed), apart in zip(curves, (0.0011, 0.0009, 0.0022), strict=True):
        np.testing.assert_allclose(ours, printed, rtol=0, atol=apart)


def test_light_of_equal_energy_is_white():
    # CIE 1931: all three curves hold 106.857 nm; the fit is good to 0.2 %
    step = 1e9 * (WAVELENGTHS[1] - WAVELENGTHS[0])
    np.testing.assert_allclose(step * matching_functions().sum(0), 106.857, rtol=2e-3)


@pytest.mark.parametrize("temperature", [300.0, 798.0, 1500.0, 2200.0, 6504.0])
def test_light_is_never_negative_and_keeps_the_luminance(temperature):
    light = np.asarray(blackbody_light(temperature))
    assert (light > 0).all()
    luminance = blackbody_xyz(temperature)[1]
    np.testing.assert_allclose(light @ WEIGHTS, luminance, rtol=1e-12)


def test_colours_that_srgb_has_are_left_as_they_are():
    xyz = np.asarray(blackbody_xyz(4000.0))
    # lifted by (smoothing / 2)^2 over the channel: 1e-4 of the least
    np.testing.assert_allclose(blackbody_light(4000.0), LINEAR_SRGB @ xyz, rtol=2e-4)


def test_it_has_gradients_and_batches():
    temperatures = jnp.array([700.0, 1900.0, 2500.0])
    check_grads(jax.jit(lambda t: jnp.log(blackbody_light(t))), (temperatures,), 1)
    batch = blackbody_light(temperatures)
    assert batch.shape == (3, 3)
    np.testing.assert_allclose(batch[1], blackbody_light(1900.0), rtol=1e-13)
