"""Alpha, sRGB and the curve of a picture."""

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
    linear_to_srgb,
    matching_functions,
    picture_gain,
    relative_xyz,
    srgb_to_linear,
    straight,
    toned,
)


def test_straight_alpha_has_finite_gradients_and_nothing_is_black():
    layer = jnp.array([[0.1, 0.2, 0.4, 0.5], [0.0, 0.0, 0.0, 0.0]])
    expected = [[0.2, 0.4, 0.8, 0.5], [0.0, 0.0, 0.0, 0.0]]
    np.testing.assert_allclose(straight(layer), expected)
    gradient = jax.grad(lambda a: straight(a).sum())(layer)
    assert np.isfinite(gradient).all()


def test_srgb_values_are_those_of_the_standard():
    # IEC 61966-2-1: 21.586 % of full light is the value 128; the line ends at 0.0031308
    assert float(linear_to_srgb(jnp.array(0.21586))) * 255 == pytest.approx(
        128, abs=0.01
    )
    # the two pieces of the standard, with its rounded constants, meet to 1e-7
    for border in (0.0031308, 0.0031308 + 1e-12):
        value = linear_to_srgb(jnp.array(border))
        assert float(value) == pytest.approx(0.04045, abs=1e-6)


def test_srgb_and_linear_light_are_inverses_with_finite_gradients():
    light = jnp.array([-0.1, 0.0, 1e-9, 0.002, 0.01, 0.5, 1.0, 40.0])
    np.testing.assert_allclose(srgb_to_linear(linear_to_srgb(light)), light, atol=1e-12)
    for curve in (srgb_to_linear, linear_to_srgb):
        check_grads(jax.jit(curve), (light,), order=1)
        assert np.isfinite(jax.vmap(jax.grad(curve))(light)).all()


def khronos(colour, start=0.8 - 0.04, desaturation=0.15):
    """The specification's sample program, without its offset for reflections."""
    peak = max(colour)
    if peak < start:
        return np.array(colour)
    d = 1.0 - start
    new_peak = 1.0 - d * d / (peak + d - start)
    colour = np.array(colour) * new_peak / peak
    g = 1.0 - 1.0 / (desaturation * (peak - new_peak) + 1.0)
    return colour * (1.0 - g) + g


def test_the_curve_is_that_of_the_specification_from_full_scale_on():
    for colour in ((3.0, 1.2, 0.2), (0.5, 7.0, 0.0), (1.1, 1.0, 1.0), (40.0, 2.0, 9.0)):
        np.testing.assert_allclose(
            toned(np.array(colour)), khronos(colour, start=1.0), rtol=1e-12
        )


def test_light_up_to_full_scale_is_unchanged_and_grey_is_clipped():
    light = np.random.default_rng(0).random((50, 3))
    np.testing.assert_array_equal(toned(light), light)
    grey = np.array([[-1.0], [0.0], [0.4], [1.0], [9.0]])
    np.testing.assert_array_equal(toned(grey)[:, 0], [0.0, 0.0, 0.4, 1.0, 1.0])
    np.testing.assert_allclose(toned(jnp.asarray(4 * light)), toned(4 * light))


def test_less_light_is_shown_darker():
    assert picture_gain(np.pi * 3e4) == pytest.approx(1.0)
    # by hand from equation 11: 10 lx are 3.183 cd/m2 of a white wall
    key = 1.03 - 2.0 / (2.0 + np.log10(4.183))
    assert picture_gain(10.0) == pytest.approx(key / (1.03 - 2.0 / 6.4771), rel=1e-4)
    gains = [picture_gain(lux) for lux in (0.1, 1.0, 10.0, 1e3, 1e4, 94e3)]
    assert (np.diff(gains) > 0.0).all()
    assert gains[0] > 0.0


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


def test_platinum_at_its_freezing_point_was_the_candela():
    # 60 cd/cm2 by the definition of 1948, at 2041.4 K (ITS-90); the fit is good to 1 %
    assert float(blackbody_xyz(2041.4)[1]) == pytest.approx(60e4, rel=0.01)


def test_the_constants_are_codata_s():
    h, c, k = constants.h, constants.c, constants.k
    # ten digits
    assert pytest.approx(2 * h * c**2, rel=1e-9) == FIRST_RADIATION
    assert pytest.approx(h * c / k, rel=1e-9) == SECOND_RADIATION


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
