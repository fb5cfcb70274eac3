"""Alpha, sRGB and the curve of a picture."""

import colorsys

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.test_util import check_grads

from jblast.sensors.camera.files.images import srgb_bytes
from jblast.sensors.camera.image import (
    blackbody_light,
    linear_to_srgb,
    luminance,
    picture_gain,
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


def test_fire_keeps_its_hue_and_grows_brighter_at_any_exposure():
    fire = np.asarray(blackbody_light(2000.0))
    hue = colorsys.rgb_to_hsv(*(fire / fire.max()))[0]
    shown = toned(np.geomspace(0.01, 1e4, 200)[:, None] * fire / fire.max())
    hues = [colorsys.rgb_to_hsv(*colour)[0] for colour in shown]
    np.testing.assert_allclose(hues, hue, atol=1e-9)
    assert (np.diff(luminance(shown)) > 0.0).all()
    assert shown.max() <= 1.0
    # clipped one by one, three times full scale is 7 degrees further towards yellow
    clipped = colorsys.rgb_to_hsv(*np.clip(3.0 * fire / fire.max(), 0.0, 1.0))[0]
    assert 360.0 * (clipped - hue) > 7.0


def test_pictures_are_written_with_the_curve():
    pixel = np.array([[[4.0, 2.0, 1.0]]])
    red, green, blue = srgb_bytes(pixel)[0, 0].astype(int)
    assert red == 255 > green > blue
    with_alpha = srgb_bytes(np.concatenate([pixel, [[[0.5]]]], axis=-1))[0, 0]
    np.testing.assert_array_equal(with_alpha, [red, green, blue, 128])


def test_less_light_is_shown_darker():
    assert picture_gain(np.pi * 3e4) == pytest.approx(1.0)
    # by hand from equation 11: 10 lx are 3.183 cd/m2 of a white wall
    key = 1.03 - 2.0 / (2.0 + np.log10(4.183))
    assert picture_gain(10.0) == pytest.approx(key / (1.03 - 2.0 / 6.4771), rel=1e-4)
    gains = [picture_gain(lux) for lux in (0.1, 1.0, 10.0, 1e3, 1e4, 94e3)]
    assert (np.diff(gains) > 0.0).all()
    assert gains[0] > 0.0
