"""Parts of a scene name the argument that is wrong: its keyword, text or shape."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import pytest

from jblast.errors import InputError
from jblast.scene import Charge, Sensor


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


def test_a_batch_of_sensors_is_made_under_vmap():
    places = jnp.arange(12.0).reshape(4, 3)
    made = jax.vmap(lambda place: Sensor("gate", place))(places)
    assert made.position_m.shape == (4, 3)
