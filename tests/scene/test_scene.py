import equinox as eqx
import jax
import jax.numpy as jnp
import pytest

from jblast.scene import PARAMETERS, Scene, with_values
from jblast.scene.uncertain import value_of

DERIVED = ("charge_range_m", "air_altitude_m", "air_sound_speed_m_s")


@pytest.mark.parametrize("name", PARAMETERS)
def test_a_value_put_in_is_found_again_and_nothing_else_changes(name):
    scene = with_values(Scene(), {name: 3.0})
    for other in PARAMETERS:
        expected = 3.0 if other == name else value_of(Scene(), other)
        assert value_of(scene, other) == expected


@pytest.mark.parametrize("name", DERIVED)
def test_what_is_derived_is_none_until_it_is_given(name):
    assert value_of(Scene(), name) is None
    assert value_of(with_values(Scene(), {name: 2.0}), name) == 2.0


def test_several_values_go_in_together_and_the_old_scene_stays():
    scene = Scene()
    changed = with_values(scene, {"air_sound_speed_m_s": 345.0, "charge_mass_kg": 7.0})
    assert (changed.air.sound_speed, changed.charge.mass_kg) == (345, 7)
    assert (scene.air.sound_speed, scene.charge.mass_kg) == (None, 1)


def test_no_values_change_nothing():
    assert eqx.tree_equal(with_values(Scene(), {}), Scene())


def test_values_carry_gradients_into_the_scene():
    def twice(speed):
        scene = with_values(Scene(), {"air_sound_speed_m_s": speed})
        assert scene.air.sound_speed is not None
        return 2.0 * scene.air.sound_speed

    assert jax.grad(twice)(jnp.asarray(340.0)) == 2.0
