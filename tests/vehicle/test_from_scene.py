import jax.numpy as jnp
import numpy as np
import pytest

from jblast.constants import FLIGHT_GRAVITY
from jblast.scene import VehicleSpec
from jblast.vehicle import hold_of, named_gains, start_of, vehicle_of


@pytest.mark.parametrize("model", ["crazyflie", "hummingbird", "iris"])
def test_the_start_carries_its_weight(model):
    spec = VehicleSpec(model, jnp.array([1.0, 2.0, 3.0]), yaw=0.4)
    vehicle, start = vehicle_of(spec), start_of(spec)
    thrust = vehicle.thrust_coefficient * jnp.sum(start.rotor_speed_rad_s**2)
    weight = vehicle.mass_kg * FLIGHT_GRAVITY
    np.testing.assert_allclose(thrust, weight, rtol=1e-12)
    assert start.position_m.tolist() == [1, 2, 3]


TURNED = VehicleSpec("iris", jnp.array([0.0, 0.0, 2.0]), yaw=2.0)
# i, j, k, w of a turn about up
TURN = [0.0, 0.0, np.sin(1.0), np.cos(1.0)]


def test_the_start_is_turned_to_its_yaw_and_is_held_there():
    np.testing.assert_allclose(start_of(TURNED).quaternion, TURN, atol=1e-15)
    assert float(hold_of(TURNED, integral=True).yaw_rad) == 2.0


def test_gains_that_are_not_named_are_the_models():
    own = {"kp_att": jnp.array(7.0), "ki_pos": jnp.array([1.0, 2.0, 3.0])}
    spec = VehicleSpec("iris", jnp.zeros(3), gains=own)
    usual = named_gains("iris", integral=True)
    held = hold_of(spec, integral=True).gains
    assert float(held.attitude) == 7.0
    assert held.integral.tolist() == [1, 2, 3]
    assert held.position.tolist() == usual.position.tolist()
    assert hold_of(spec, integral=False).gains.integral.tolist() == [0, 0, 0]


def test_the_target_is_the_start_where_nothing_is_said():
    place = jnp.array([1.0, 2.0, 3.0])
    assert hold_of(VehicleSpec("iris", place), integral=True).target_m.tolist() == [
        1.0,
        2.0,
        3.0,
    ]
    other = VehicleSpec("iris", place, target=jnp.array([4.0, 5.0, 6.0]))
    assert hold_of(other, integral=True).target_m.tolist() == [4, 5, 6]
