"""What a hold asks of its vehicle: Lee's law near hover, limits far from it."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from jblast.vehicle import PositionHold, named, named_gains, rotor_speeds
from jblast.vehicle.control.position_hold import pull_within
from jblast.vehicle.state import three
from tests.vehicle.flights import at_hover

IRIS = named("iris")
GAINS = named_gains("iris", integral=True)
PERIOD = 0.01


@jax.jit
def asked(away, velocity, memory):
    return pull_within(
        IRIS, GAINS, three(away), three(velocity), memory, jnp.asarray(PERIOD)
    )


def pull_of(away=(0, 0, 0), velocity=(0, 0, 0), memory=(0, 0, 0)) -> np.ndarray:
    """Return the pull, and the integral afterwards."""
    parts = (jnp.array(x, float) for x in (away, velocity, memory))
    return np.array(asked(*parts))


def by_lee(state, memory) -> np.ndarray:
    """Rotor speeds by the equations of Lee and others, without any limit."""
    away = np.asarray(state.position_m)
    total = np.asarray(memory) - np.asarray(GAINS.integral) * PERIOD * away
    pull = total - np.asarray(GAINS.position) * away
    pull += -np.asarray(GAINS.velocity) * np.asarray(state.velocity_m_s)
    pull += [0, 0, 9.81]
    attitude = Rotation.from_quat(state.quaternion).as_matrix()
    b_3 = pull / np.linalg.norm(pull)
    b_2 = np.cross(b_3, [1.0, 0.0, 0.0])
    b_2 /= np.linalg.norm(b_2)
    wanted = np.stack([np.cross(b_2, b_3), b_2, b_3], axis=1)
    skew = (wanted.T @ attitude - attitude.T @ wanted) / 2
    error = np.array([skew[2, 1], skew[0, 2], skew[1, 0]])
    w, inertia = np.asarray(state.body_rate_rad_s), np.asarray(IRIS.inertia_kg_m2)
    moment = inertia @ (-float(GAINS.attitude) * error - float(GAINS.body_rate) * w)
    moment += np.cross(w, inertia @ w)
    thrust = float(IRIS.mass_kg) * pull @ attitude[:, 2]
    return np.asarray(rotor_speeds(IRIS, tuple(jnp.array([thrust, *moment]))))


def test_near_hover_the_hold_is_the_law_as_printed():
    state = at_hover(
        IRIS,
        (0.05, -0.03, 0.04),
        velocity_m_s=np.array([0.1, 0.05, -0.1]),
        quaternion=np.array([0.01, -0.02, 0.01, 1.0]),
        body_rate_rad_s=np.array([0.02, 0.05, -0.03]),
    )
    memory = jnp.array([0.1, -0.2, 0.3])
    hold = PositionHold(np.zeros(3), GAINS)
    speeds, _ = hold(jnp.zeros(()), state, IRIS, memory, jnp.asarray(PERIOD))
    np.testing.assert_allclose(speeds, by_lee(state, memory), rtol=1e-10)


def test_the_pull_never_points_down_however_fast_it_climbs():
    for climb in (0.5, 1.0, 5.0, 10.0):
        up = pull_of(velocity=(0, 0, climb))[0, 2]
        assert up == pytest.approx(max(9.81 - 9 * climb, 0.24 * 9.81))


def test_a_place_far_above_the_target_asks_for_a_descent_of_a_metre_and_a_half():
    # where the pull is the weight it neither brakes nor falls faster
    for height in (1.0, 5.0, 50.0):
        pull, gained = pull_of(away=(0, 0, height), velocity=(0, 0, -1.5))
        assert pull[2] - 9.81 == pytest.approx(-3.75 * PERIOD * height, abs=1e-9)
        assert gained[2] == 0


@pytest.mark.parametrize("speed", [1.0, 3.0, 10.0])
def test_the_tilt_is_at_most_45_degrees_and_keeps_its_direction(speed):
    east, north, up = pull_of(velocity=(0.6 * speed, -0.8 * speed, 0))[0]
    assert np.hypot(east, north) == pytest.approx(min(4 * speed, 9.81))
    assert up == pytest.approx(9.81)
    assert north == pytest.approx(-0.8 / 0.6 * east)


def test_an_axis_that_is_cut_gathers_no_more_of_the_same():
    near = pull_of(away=(0.1, 0, 0.1))[1]
    np.testing.assert_allclose(near, [-0.0016, 0, -0.00375])
    far = pull_of(away=(20, 0, 20), memory=(1.0, 0.0, 1.0))[1]
    np.testing.assert_array_equal(far, [1.0, 0.0, 1.0])
    # cut eastwards by its speed, it still gathers towards the west
    braking = pull_of(away=(0.5, 0, 0), velocity=(-10, 0, 0))[1]
    assert braking[0] == pytest.approx(-1.6 * PERIOD * 0.5)
