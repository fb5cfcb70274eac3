import jax.numpy as jnp
import numpy as np
import pytest

from jblast.waves.euler import IdealGas, Primitives, riemann_profile, star_state


def side(density, velocity, pressure):
    return Primitives(*map(jnp.asarray, (density, velocity, pressure)))


@pytest.mark.parametrize(
    ("left", "right", "pressure", "velocity", "digit"),
    [
        ((1.0, 0.0, 1.0), (0.125, 0.0, 0.1), 0.30313, 0.92745, 5e-6),
        ((1.0, -2.0, 0.4), (1.0, 2.0, 0.4), 0.00189, 0.0, 5e-6),
        ((1.0, 0.0, 1000.0), (1.0, 0.0, 0.01), 460.894, 19.5975, 5e-4),
        ((1.0, 0.0, 0.01), (1.0, 0.0, 100.0), 46.0950, -6.19633, 5e-5),
    ],
)
def test_the_star_states_are_those_of_toros_table(
    left, right, pressure, velocity, digit
):
    # Toro (2009), table 4.2: tests 1 to 4, to the digits printed
    p, u = star_state(side(*left), side(*right), IdealGas())
    assert float(p) == pytest.approx(pressure, abs=1.01 * digit)
    assert float(u) == pytest.approx(velocity, abs=1.01 * digit)


def test_the_fan_keeps_entropy_and_joins_both_its_ends():
    left, right = side(1.0, 0.0, 1.0), side(0.125, 0.0, 0.1)
    speeds = jnp.linspace(-1.5, 0.9, 2001)
    flow = riemann_profile(left, right, IdealGas(), speeds)
    np.testing.assert_allclose(flow.pressure, flow.density**1.4, rtol=1e-12)
    # no jump larger than the fan's own slope over the spacing, 1.2e-3
    assert float(jnp.max(jnp.abs(jnp.diff(flow.velocity)))) < 1.1e-3


def test_a_mirrored_problem_has_the_mirrored_solution():
    left, right = side(1.0, 0.3, 1.0), side(0.5, -0.2, 0.1)
    mirrored = (side(0.5, 0.2, 0.1), side(1.0, -0.3, 1.0))
    speeds = jnp.linspace(-3.0, 3.0, 100)
    one = riemann_profile(left, right, IdealGas(), speeds)
    other = riemann_profile(*mirrored, IdealGas(), -speeds)
    np.testing.assert_allclose(one.density, other.density, rtol=1e-12)
    np.testing.assert_allclose(one.velocity, -other.velocity, atol=1e-12)
