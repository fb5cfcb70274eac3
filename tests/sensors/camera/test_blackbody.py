import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.test_util import check_grads

from jblast.sensors.camera.blackbody import (
    LINEAR_SRGB,
    blackbody_light,
    blackbody_xyz,
    matching_functions,
)
from jblast.sensors.camera.grey_composite import LUMINANCE

WEIGHTS = np.array(LUMINANCE)


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


def test_the_curves_have_the_heights_of_the_tables():
    # CIE 1931: 1.0622 at 600 nm, 1.0 at 555 nm, 1.7721 at 445 nm; 1 % of the fit
    functions = matching_functions()
    for axis, wavelength, value in ((0, 600, 1.0622), (1, 555, 1.0), (2, 445, 1.7721)):
        found = functions[(wavelength - 360) // 5, axis]
        assert found == pytest.approx(value, rel=0.015)


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


def test_single_precision_stays_finite_from_a_cold_night_to_a_star():
    temperatures = jnp.array([200.0, 288.0, 2200.0, 1e5], jnp.float32)
    light, gradient = jax.jvp(blackbody_light, (temperatures,), (temperatures,))
    assert light.dtype == jnp.float32
    assert np.isfinite(light).all()
    assert np.isfinite(gradient).all()
    double = blackbody_light(temperatures[2:].astype(jnp.float64))
    np.testing.assert_allclose(light[2:], double, rtol=1e-4)
