import jax
import numpy as np
import pytest

from jblast.scene import (
    Free,
    LogNormal,
    Normal,
    Scene,
    UncertainScene,
    default_scene,
    draw_scene,
)


def test_every_uncertain_number_is_drawn_on_its_own():
    beliefs = {
        "charge_mass_kg": LogNormal(15.0, 2.0),
        "air_sound_speed_m_s": Normal(340.0, 3.0),
    }
    uncertain = UncertainScene(Scene(), beliefs)
    keys = jax.random.split(jax.random.key(1), 2000)
    scenes = jax.vmap(lambda key: draw_scene(key, uncertain))(keys)
    z_mass = np.log(np.asarray(scenes.charge.mass_kg) / 15.0) / np.log(2.0)
    z_speed = (np.asarray(scenes.air.sound_speed) - 340.0) / 3.0
    # four standard errors of a mean, and of a correlation, of 2000
    assert abs(z_mass.mean()) < 4 / np.sqrt(2000)
    assert abs(z_speed.mean()) < 4 / np.sqrt(2000)
    assert abs(np.mean(z_mass * z_speed)) < 4 / np.sqrt(2000)


def test_a_scene_without_beliefs_draws_itself():
    scene = draw_scene(jax.random.key(0), UncertainScene(Scene()))
    assert scene.charge.mass_kg == 1


def test_a_free_number_cannot_be_drawn_and_says_so():
    with pytest.raises(ValueError, match="charge_mass_kg is free and cannot be drawn"):
        draw_scene(jax.random.key(0), default_scene())


def test_the_default_scene_leaves_the_mass_free():
    assert default_scene().beliefs == {"charge_mass_kg": Free(positive=True)}
