from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.core import Tracer

from jblast.errors import InputError
from jblast.scene import Charge, Clock, Scene, Sensor, with_values


@pytest.mark.parametrize(
    ("kind", "wrong", "right"),
    [
        (Charge, "mass", "mass_kg"),
        (Charge, "time", "time_s"),
        (Charge, "range", "range_m"),
        (Charge, "east", "position_m"),
        (Sensor, "position", "position_m"),
        (Sensor, "times", "times_s"),
        (Clock, "offset", "offset_s"),
    ],
)
def test_a_keyword_that_is_none_is_refused_by_naming_those_that_are(kind, wrong, right):
    with pytest.raises(TypeError, match=rf"no keyword.*expected one of.*\b{right}\b"):
        kind(**{wrong: 1.0})


@pytest.mark.parametrize(
    "place", [3.0, (1.0, 2.0), (), np.zeros((3, 3)), jnp.zeros((2, 3))]
)
def test_a_position_that_is_not_three_numbers_is_refused(place):
    with pytest.raises(InputError, match="charge position_m: expected three numbers"):
        Charge(position_m=place)


def test_one_number_of_a_position_may_be_traced_and_the_others_known():
    known = Scene()  # made outside jit

    def east_of(east):
        charge = with_values(known, {"charge_east_m": east}).charge
        charge = replace(charge, burst="surface")
        assert isinstance(charge.east, Tracer)
        assert not isinstance(charge.up, Tracer)
        return charge.east

    assert jax.jit(east_of)(4.0) == 4.0


def test_gradients_are_found_by_the_names_of_the_fields():
    def told(charge):
        return charge.mass_kg * charge.up + jnp.sum(jnp.stack(charge.position_m))

    slope = eqx.filter_grad(told)(Charge(2.0, position_m=(5.0, 6.0, 7.0)))
    assert (slope.mass_kg, slope.position_m) == (7.0, (1.0, 1.0, 3.0))


@pytest.mark.parametrize(
    ("kind", "values", "said"),
    [
        (Charge, {"mass_kg": "15"}, "Charge mass_kg: expected a number.*'15'"),
        (Sensor, {"name": "a", "position_m": "here"}, "Sensor position_m.*'here'"),
    ],
)
def test_text_in_place_of_a_number_is_refused_by_name(kind, values, said):
    with pytest.raises(TypeError, match=said):
        kind(**values)
    with pytest.raises(TypeError, match=said):
        kind(*values.values())


@pytest.mark.parametrize(
    ("named", "said"),
    [
        ({"position_m": (1.0, 2.0)}, "position_m: expected 3 numbers: east, north, up"),
        ({"position_m": 5.0}, r"position_m: expected 3 numbers.*got shape \(\)"),
        ({"offset_m": (1.0,) * 4}, "offset_m: expected 3 numbers: forward, left, up"),
        ({"quaternion": (1.0,) * 3}, "quaternion: expected 4 numbers: x, y, z, w"),
    ],
)
def test_a_vector_of_a_sensor_with_other_numbers_is_refused(named, said):
    with pytest.raises(InputError, match=f"sensor gate {said}"):
        replace(Sensor("gate", (1.0, 2.0, 3.0)), **named)
