import math
from dataclasses import replace

import jax
import numpy as np
import pytest

from jblast.errors import InputError
from jblast.scene import (
    PARAMETERS,
    Camera,
    Instrument,
    LogNormal,
    Normal,
    Scene,
    UncertainScene,
    default_scene,
    draw_scene,
    with_values,
)
from jblast.scene.uncertain import value_of

CAMERA = Camera(np.zeros(3), np.eye(4)[3], [90.0, 90.0], [32.0, 24.0], 64, 48)
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


def test_a_free_number_cannot_be_drawn_and_says_so():
    with pytest.raises(ValueError, match="free and cannot be drawn"):
        draw_scene(jax.random.key(0), default_scene())


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda: replace(CAMERA, width=0),
            "camera width: expected a finite number that is po",
        ),
        (lambda: replace(CAMERA, focal=[100.0, -1.0]), r"focal: .*got \[100.0, -1.0\]"),
        (lambda: replace(CAMERA, exposure_s=-1e-3), "exposure_s: .* that is not nega"),
        (
            lambda: replace(CAMERA, frames_hz=math.nan),
            "frames_hz: .* positive, got nan",
        ),
        (lambda: replace(CAMERA, position=[0.0, math.nan, 0.0]), "position: .*finite"),
        (lambda: replace(CAMERA, quaternion=np.zeros(4)), "quaternion: .* not zero"),
        (lambda: Instrument(rate=0.0), "instrument rate: .*number that is positive"),
        (lambda: Instrument(rate=math.inf), "instrument rate: .*finite .* got inf"),
        (lambda: Instrument(bits=16), "full_scale: expected the range of 16 bits"),
        (lambda: Instrument(bits=0), "instrument bits: .* positive, got 0"),
    ],
)
def test_numbers_of_cameras_and_instruments_are_within_their_bounds(make, message):
    with pytest.raises(InputError, match=message):
        make()
