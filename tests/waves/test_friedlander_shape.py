import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.waves.friedlander_shape import (
    decay_of_fraction,
    impulse_fraction,
    late_fraction,
    middle_fraction,
)

WEIGHTS = {
    impulse_fraction: lambda x: 1 - x,
    late_fraction: lambda x: x,
    middle_fraction: lambda x: x * (1 - x),
}
every_integral = pytest.mark.parametrize("integral", WEIGHTS, ids=lambda f: f.__name__)

# Both sides of the change to the series at 1, and the change itself.
DECAYS = [-5.0, -1.0001, -1.0, -0.9999, -0.3, 0.0, 1e-8, 0.7, 0.9999, 1.0, 1.0001, 9.0]


def moment(integral, decay, order=0):
    """Integrate by quadrature; each order is one more derivative by the decay.

    Forty nodes of Gauss are exact to rounding for e^(-b x) with |b| up to 30 and more.
    """
    nodes, weights = np.polynomial.legendre.leggauss(40)
    x = (nodes + 1) / 2
    return weights / 2 @ (WEIGHTS[integral](x) * (-x) ** order * np.exp(-decay * x))


@every_integral
@pytest.mark.parametrize("decay", DECAYS)
def test_value_and_two_derivatives_are_the_integrals(integral, decay):
    first = jax.grad(integral)
    # Rounding of terms that cancel by up to 60 in the second derivative of the closed
    # form of the middle at |b| = 1: 1e-14; quadrature 1e-14.
    for order, function in enumerate((integral, first, jax.grad(first))):
        np.testing.assert_allclose(
            function(jnp.array(decay)), moment(integral, decay, order), rtol=2e-13
        )


@every_integral
def test_single_precision_keeps_six_digits(integral):
    decay = jnp.concatenate([-jnp.geomspace(1e-4, 60, 400), jnp.geomspace(1e-4, 1e6)])
    single = integral(decay.astype("float32"))
    assert single.dtype == jnp.float32
    exact = integral(decay.astype("float32").astype(float))
    # Cancellation by at most 12 just above |b| = 1, of roundings of 6e-8.
    np.testing.assert_allclose(single.astype(float), exact, rtol=2e-6)


def test_the_first_terms_are_those_of_the_series():
    # 1/2 - b/6 + b^2/24: the next term is b^3/120
    b = jnp.array([-1e-3, 1e-3])
    np.testing.assert_allclose(
        impulse_fraction(b), 0.5 - b / 6 + b**2 / 24, rtol=0, atol=1e-9 / 100
    )


def test_early_and_late_make_the_whole():
    b = jnp.array([-3.0, 0.5, 4.0])
    np.testing.assert_allclose(
        impulse_fraction(b) + late_fraction(b), -jnp.expm1(-b) / b, rtol=1e-14
    )


def test_the_decay_is_found_to_rounding_over_eighteen_decades():
    fraction = jnp.geomspace(1e-6, 1e12, 2001)
    # k is steep in b where b = -35: a rounding of b there is 35 of k.
    np.testing.assert_allclose(
        impulse_fraction(decay_of_fraction(fraction)), fraction, rtol=1e-14
    )


def test_in_single_precision_the_decay_is_found_too():
    decay = jnp.concatenate([jnp.linspace(-5.0, 5.0, 101), jnp.geomspace(5.0, 1e5)])
    fraction = impulse_fraction(decay).astype("float32")
    found = decay_of_fraction(fraction)
    assert found.dtype == jnp.float32
    exact = decay_of_fraction(fraction.astype(float))
    # Rounding of k, 6e-8, times b or 6k, whichever is more.
    np.testing.assert_allclose(found.astype(float), exact, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("fraction", [0.04, 0.1, 0.45, 0.5, 0.55, 0.7, 3.0])
def test_slope_and_curvature_are_those_of_the_inverse_function(fraction):
    fraction = jnp.array(fraction)
    decay = decay_of_fraction(fraction)
    k1, k2 = (
        moment(impulse_fraction, float(decay), 1),
        moment(impulse_fraction, float(decay), 2),
    )
    slope = jax.grad(decay_of_fraction)
    np.testing.assert_allclose(slope(fraction), 1 / k1, rtol=1e-12)
    np.testing.assert_allclose(jax.grad(slope)(fraction), -k2 / k1**3, rtol=1e-12)


def test_a_batch_equals_its_loop_with_and_without_jit():
    fraction = jnp.geomspace(0.01, 2.0, 30)
    loop = [float(decay_of_fraction(k)) for k in fraction]
    # Near zero the root keeps its absolute digits only.
    for batch in (decay_of_fraction, jax.jit(jax.vmap(decay_of_fraction))):
        np.testing.assert_allclose(batch(fraction), loop, rtol=1e-13, atol=1e-14)
