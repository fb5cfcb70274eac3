import jax
import jax.numpy as jnp
import numpy as np

from jblast.inference.many.solver import newton


def on_lanes(cost):
    """A cost of one lane as that of lanes, and its gradient."""

    def both(y):
        return jax.vmap(jax.value_and_grad(cost), 1, (0, 1))(y)

    return both


def test_a_curvature_that_gauss_newton_does_not_see_is_no_trouble():
    # of residuals (y0^2 - c)/s and y0: Gauss-Newton sees 1 at y0 = 0, where it is 5
    def cost(y):
        return 0.5 * ((y[0] ** 2 + 2.0) ** 2 + y[0] ** 2 + (y[1] - 3.0) ** 2)

    start = jnp.array([[0.8, -1e-6], [0.0, 2.0]])
    end = newton(on_lanes(cost), start, jnp.full(2, 1e-14))
    np.testing.assert_allclose(end, [[0.0, 0.0], [3.0, 3.0]], atol=1e-12)


def test_a_saddle_is_left_for_a_minimum():
    def cost(y):
        return 0.25 * y[0] ** 4 - 0.5 * y[0] ** 2 + y[1] ** 2

    start = jnp.array([[1e-3], [0.5]])
    end = newton(on_lanes(cost), start, jnp.zeros(1))
    np.testing.assert_allclose(end, [[1.0], [0.0]], atol=1e-9)


def test_where_the_cost_is_no_number_lanes_stay():
    def cost(y):
        return jnp.where(y[0] > 0, y[0] - jnp.log(jnp.abs(y[0])), jnp.nan)

    start = jnp.array([[0.05, -1.0]])
    end = newton(on_lanes(cost), start, jnp.zeros(2))
    np.testing.assert_allclose(end, [[1.0, -1.0]], rtol=1e-9)
