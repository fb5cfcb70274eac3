import jax
import jax.numpy as jnp
import numpy as np

from jblast.waves.curves import chebyshev_sum


def test_the_sum_is_that_of_numpy():
    coefficients = [0.3, -1.2, 0.7, 0.05, -0.4]
    x = np.linspace(2.0, 5.0, 50)
    series = np.polynomial.Chebyshev(coefficients, domain=[2.0, 5.0])
    # a few roundings of numbers of order one
    np.testing.assert_allclose(
        chebyshev_sum(coefficients, jnp.asarray(x), 2.0, 5.0), series(x), atol=1e-14
    )


def test_its_derivative_is_that_of_the_series():
    coefficients = [0.3, -1.2, 0.7, 0.05, -0.4]
    series = np.polynomial.Chebyshev(coefficients, domain=[2.0, 5.0])
    slope = jax.grad(lambda x: chebyshev_sum(coefficients, x, 2.0, 5.0))
    for x in (2.0, 3.1, 5.0):
        np.testing.assert_allclose(slope(x), series.deriv()(x), rtol=1e-12)


def test_at_the_ends_the_signs_add_up_or_alternate():
    ones = [1.0] * 4
    assert float(chebyshev_sum(ones, jnp.asarray(7.0), 3.0, 7.0)) == 4.0
    assert float(chebyshev_sum(ones, jnp.asarray(3.0), 3.0, 7.0)) == 0.0
