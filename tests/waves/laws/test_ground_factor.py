import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.waves.laws.kingery_bulmash import ground_factor, kingery_bulmash_pressure


@pytest.mark.parametrize(
    ("z", "factor"),
    [
        (0.2, 1.38),
        (0.5, 1.46),
        (1.0, 1.66),
        (2.0, 1.65),
        (5.0, 1.73),
        (10.0, 1.88),
        (20.0, 2.01),
    ],
)
def test_the_factors_are_the_printed_ones(z, factor):
    # half of the last printed digit
    assert float(ground_factor(z, 1.0)) == pytest.approx(factor, abs=5e-3)


def test_free_air_charged_with_it_gives_the_pressure_on_the_ground():
    mass, ambient = 50.0, 8e4
    r = jnp.geomspace(0.2, 20.0, 500) * (mass * 101_325.0 / ambient) ** (1 / 3)
    factor = ground_factor(r, mass, ambient)
    np.testing.assert_allclose(
        kingery_bulmash_pressure(r, factor * mass, ambient, burst="free-air"),
        kingery_bulmash_pressure(r, mass, ambient),
        rtol=1e-8,  # the table leaves 2e-9
    )


def test_it_is_constant_outside_its_table():
    factor = ground_factor(np.array([0.01, 0.2, 20.0, 1e5]), 1.0)
    assert float(factor[0]) == float(factor[1])
    np.testing.assert_allclose(factor[2], factor[3], rtol=1e-14)
    slope = jax.vmap(jax.grad(lambda z: ground_factor(z, 1.0)))
    assert slope(jnp.array([0.01, 1e5])).tolist() == [0.0, 0.0]


def test_log_slopes_are_those_of_finite_differences_and_of_sachs():
    @jax.jit
    def law(x):
        r, mass, ambient = jnp.exp(x)
        return jnp.log(ground_factor(r, mass, ambient))

    h = 1e-5
    for z in (0.25, 0.7, 1.3, 4.0, 15.0):
        x = jnp.log(jnp.array([z, 1.0, 101_325.0]))
        slopes = jax.grad(law)(x)
        step = jnp.array([h, 0.0, 0.0])
        central = (law(x + step) - law(x - step)) / (2 * h)
        # h^2/6 times a third derivative below 100, rounding 1e-16 / h
        assert float(slopes[0]) == pytest.approx(float(central), abs=1e-8)
        np.testing.assert_allclose(slopes[1:], slopes[0] * np.array([-1.0, 1.0]) / 3.0)


def test_two_derivatives_are_finite_everywhere():
    def law(x):
        return ground_factor(jnp.exp(x), 1.0)

    x = jnp.log(jnp.array([1e-3, 0.2, 1.0, 20.0, 1e6]))
    for function in (law, jax.grad(law), jax.grad(jax.grad(law))):
        assert jnp.isfinite(jax.jit(jax.vmap(function))(x)).all()


def test_a_batch_is_a_loop_in_single_precision_too():
    z = jnp.geomspace(0.01, 1e4, 40)
    loop = [float(ground_factor(one, 1.0)) for one in z]
    np.testing.assert_allclose(jax.jit(ground_factor)(z, 1.0), loop, rtol=1e-13)
    single = ground_factor(z.astype("float32"), 1.0)
    assert single.dtype == jnp.float32
    np.testing.assert_allclose(single, loop, rtol=2e-6)


def test_a_distance_of_zero_is_refused():
    with pytest.raises(ValueError, match="slant_range must be positive, got 0 m"):
        ground_factor(0.0, 1.0)
