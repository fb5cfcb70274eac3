import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.test_util import check_grads

from jblast.sensors.camera.image import (
    linear_to_srgb,
    opaque,
    over,
    premultiplied,
    srgb_to_linear,
    straight,
)

KEY = jax.random.key(3)
LAYERS = jax.random.uniform(KEY, (3, 5, 4))


def test_a_layer_hides_by_its_alpha():
    layer = jnp.array([1.0, 0.5, 0.0, 0.25])
    background = jnp.array([0.2, 0.2, 0.8])
    np.testing.assert_allclose(over(layer, background), [0.4, 0.275, 0.6])


def test_layers_may_be_laid_over_in_any_grouping():
    one, two, three = LAYERS
    left, right = over(over(one, two), three), over(one, over(two, three))
    np.testing.assert_allclose(left, right, rtol=1e-13)
    np.testing.assert_allclose(over(one, opaque(two[:, :3]))[:, 3], 1.0)


def test_premultiplied_and_straight_are_inverses_and_nothing_is_black():
    np.testing.assert_allclose(straight(premultiplied(LAYERS)), LAYERS, rtol=1e-14)
    nothing = jnp.array([0.0, 0.0, 0.0, 0.0])
    np.testing.assert_array_equal(over(nothing, nothing), nothing)
    gradient = jax.grad(lambda a: straight(a).sum())(nothing)
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
