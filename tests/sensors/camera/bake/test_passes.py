import numpy as np

from jblast.sensors.camera.bake.coding import averaged, layers_of, light_of_heat


def channels(light, alpha, size=24):
    whole = np.full((size, size), alpha, np.float32)
    return {c: whole * light for c in "RGB"} | {"A": whole}


def test_thin_gas_is_as_hot_as_thick_gas_of_the_same_source():
    for alpha in (0.05, 0.5, 1.0):
        emitted = channels(light_of_heat(np.array([0.8])).item(), alpha)
        heat, shade, opacity = layers_of(emitted, channels(0.3, alpha))
        np.testing.assert_allclose(heat, 0.8, atol=1e-5)  # single precision
        np.testing.assert_allclose(opacity, alpha, rtol=1e-6)
        # far enough from the border, beyond which nothing is
        np.testing.assert_allclose(shade[5:-5, 5:-5], 0.3, rtol=1e-5)


def test_where_nothing_is_nothing_glows():
    heat, _, alpha = layers_of(channels(0.0, 0.0), channels(0.0, 0.0))
    assert heat.max() == alpha.max() == 0.0


def test_averaging_keeps_the_light_and_spreads_a_point():
    point = np.zeros((15, 15))
    point[7, 7] = 1.0
    spread = averaged(point)
    assert spread.shape == point.shape
    np.testing.assert_allclose(spread.sum(), 1.0, rtol=1e-12)
    np.testing.assert_allclose(spread, spread.T, atol=1e-15)
    assert 0.1 < spread[7, 7] < 0.3


def test_what_many_rays_would_show_is_nearer_after_averaging():
    draw = np.random.default_rng(1)
    noisy = channels(0.3, 1.0)
    noise = draw.normal(0.0, 0.1, (24, 24)).astype(np.float32)
    noisy = {c: v + noise * (c != "A") for c, v in noisy.items()}
    shade = layers_of(channels(0.0, 1.0), noisy).shade[5:-5, 5:-5, 0]
    assert np.std(shade - 0.3) < 0.5 * np.std(noise)
