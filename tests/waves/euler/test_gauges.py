import jax.numpy as jnp
import numpy as np
import pytest

from jblast.waves.euler import (
    Ambient,
    IdealGas,
    cell_centres,
    gauge_readings,
    march,
    start_sedov,
    start_sphere,
)

AIR = Ambient(jnp.ones(()), jnp.ones(()), IdealGas())


@pytest.mark.slow
def test_a_gauge_is_at_rest_until_the_shock_comes_and_then_jumps_to_its_pressure():
    flow, state = start_sedov(1.0, AIR, 0.02, cells=60)
    run = march(state, flow, 1.2, stride=2, gauges=[0.8])
    shown, wind = run.history.pressure[:, 0], run.history.velocity[:, 0]
    come = run.history.clock >= 0.8
    np.testing.assert_array_equal(shown[~come], 1.0)
    np.testing.assert_array_equal(wind[~come], 0.0)
    first = int(np.argmax(come))
    front = run.history.front_pressure[first] - 1.0
    # within two steps of the arrival, a fiftieth of the wave
    assert shown[first] - 1.0 == pytest.approx(front, rel=0.05)
    assert wind[first] == pytest.approx(run.history.front_velocity[first], rel=0.05)
    assert shown[-1] < shown[first]


def test_a_straight_pressure_is_read_exactly_at_the_centres_of_the_cells():
    radius = jnp.array([0.0, 0.5, 0.7, 1.5])
    centres = cell_centres(radius, "spherical")
    # mean of r over shells, by (r^4/4)/(r^3/3)
    mean = 0.75 * jnp.diff(radius**4) / jnp.diff(radius**3)
    np.testing.assert_allclose(centres, mean, rtol=1e-14)


def test_no_gauges_give_no_readings():
    flow, state = start_sphere(1.0, 50.0, 8.0, AIR, core_cells=10, air_cells=10)
    pressure, velocity = gauge_readings(state, flow, jnp.zeros(0))
    assert pressure.shape == velocity.shape == (0,)
