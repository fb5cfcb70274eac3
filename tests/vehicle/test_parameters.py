import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.constants import FLIGHT_GRAVITY
from jblast.errors import InputError
from jblast.scene import VehicleSpec
from jblast.vehicle import (
    from_parameters,
    gains_from_parameters,
    hold_of,
    named,
    named_gains,
    start_of,
    vehicle_of,
)
from jblast.vehicle.quadrotor import PARAMETERS
from tests.vehicle.flights import at_hover

CRAZYFLIE = PARAMETERS["crazyflie"]


def test_names_of_rotorpy_are_taken_and_those_without_a_part_ignored():
    rotors = {f"r{n + 1}": row for n, row in enumerate(CRAZYFLIE["rotor_pos"])}
    idle = {"num_rotors": 4, "rI": [0, 0, 0], "k_flap": 0.0, "kp_att": 310, "k_w": 200}
    vehicle = from_parameters({**CRAZYFLIE, **idle, "rotor_pos": rotors})
    for ours, theirs in zip(
        jax.tree.leaves(vehicle), jax.tree.leaves(named("crazyflie")), strict=True
    ):
        np.testing.assert_array_equal(ours, theirs)


def test_the_iris_has_the_numbers_of_its_model():
    iris = named("iris")
    assert float(iris.mass_kg) == 1.5
    np.testing.assert_allclose(
        np.diag(iris.inertia_kg_m2), [0.029125, 0.029125, 0.055225]
    )
    assert float(iris.moment_coefficient) == pytest.approx(3.504e-7)
    np.testing.assert_allclose(iris.rotor_position_m.sum(axis=0), [0, 0, 0.092])
    assert float(iris.rotor_direction.sum()) == 0


REFUSED = {
    "mass: expected a number of at least 1e-12, got 0": {"mass": 0},
    "mass: expected a number .* got heavy": {"mass": "heavy"},
    "positive definite inertia, got 1.43e-05, .* 1.0": {"Ixy": 1.0},
    "more than rotor_speed_min, got 10": {
        "rotor_speed_min": 20,
        "rotor_speed_max": 10,
    },
    "num_rotors: expected 4, got 6": {"num_rotors": 6},
    "r1 to r4, got r1, r2": {"rotor_pos": {"r1": [0, 0, 0], "r2": [0, 0, 0]}},
    "rotor_pos: expected 4 x 3 numbers": {"rotor_pos": [[0, 0, 0]] * 3},
    "rotor_directions: expected 1 or -1, got .1": {"rotor_directions": [1, -1, 2, -1]},
    "'tau_mm': no such name; did you mean tau_m": {"tau_mm": 0.0},
    "body_area: expected 3 numbers of at least 0": {"body_area": [1, -1, 1]},
    "body_volume: missing": {"body_volume": None},
}


@pytest.mark.parametrize("message", REFUSED)
def test_a_parameter_that_cannot_be_is_named(message):
    with pytest.raises(InputError, match=message):
        from_parameters({**CRAZYFLIE, **REFUSED[message]})


def test_a_parameter_that_is_missing_is_named():
    for key in ("mass", "Ixx", "k_eta", "rotor_speed_max", "body_volume"):
        left = {k: v for k, v in CRAZYFLIE.items() if k != key}
        with pytest.raises(InputError, match=f"{key}: missing"):
            from_parameters(left)


def test_a_name_that_is_not_there_is_refused():
    with pytest.raises(InputError, match="did you mean iris"):
        named("irish")
    with pytest.raises(InputError, match="vehicle 'x8'"):
        named_gains("x8")
    with pytest.raises(InputError, match="kd_att: missing"):
        gains_from_parameters({"kp_pos": [1] * 3, "kd_pos": [1] * 3, "kp_att": 1})


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ({"quaternion": np.zeros(4)}, "quaternion: expected one of length 1.*0.0"),
        ({"quaternion": np.full(4, 1e-170)}, "got .*1e-170.* in float64"),
        ({"quaternion": np.full(4, np.float32(1e30))}, "got .*e[+]30.* in float32"),
        (
            {"velocity_m_s": np.zeros((2, 3))},
            "velocity_m_s: expected the shape",
        ),
        ({"body_rate_rad_s": np.full(3, np.inf)}, "body_rate_rad_s: expected finite"),
    ],
)
def test_a_state_that_cannot_be_is_refused(parts, message):
    with pytest.raises(InputError, match=message):
        at_hover(named("crazyflie"), **parts)


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
