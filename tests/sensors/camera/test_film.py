"""Films, block by block; and the thesis's clip."""

from typing import Any

import numpy as np
import pytest

from jblast.scene import Camera, Charge, Scene, look_at
from jblast.sensors.camera import film as film_module
from jblast.sensors.camera.film import Film
from jblast.sensors.camera.film_writer import (
    sheet_frames,
)
from jblast.sensors.camera.fireball import Appearance
from jblast.sensors.camera.image import luminance
from jblast.sensors.camera.rendering import in_view, render

SCENE = Scene(Charge(mass_kg=15.0, position_m=(0.0, 0.0, 1.0)))


def camera(position=(0.0, -40.0, 2.0), target=(0.0, 0.0, 4.0), **changed) -> Camera:
    position, target = np.array(position), np.array(target)
    entries: dict[str, Any] = {
        "position": position,
        "quaternion": look_at(position, target),
        "focal": np.full(2, 30.0),
        "center": np.array([15.5, 11.5]),
        "width": 32,
        "height": 24,
    }
    return Camera(**(entries | changed))


@pytest.fixture(autouse=True)
def blocks_of_three(monkeypatch):
    monkeypatch.setattr(film_module, "PIXELS", 3 * 32 * 24)


@pytest.mark.slow
def test_blocks_are_the_whole_with_an_exposure_and_instants_without():
    times, exposed = np.linspace(-1e-3, 20e-3, 8), camera(exposure_s=np.array(1e-3))
    film = Film(SCENE, exposed, times, gain=0.5)
    blocks = list(film.frames())
    assert [(w.start, w.stop, len(f)) for w, f in blocks] == [
        (0, 3, 3),
        (3, 6, 3),
        (6, 8, 2),
    ]
    found = np.concatenate([frames for _, frames in blocks])
    assert found.dtype == np.float32
    blurred, sharp = (render(SCENE, eye, times) for eye in (exposed, camera()))
    np.testing.assert_allclose(found, 0.5 * blurred, rtol=1e-4)
    # events: instants, in the precision of the scene, without the gain of pictures
    np.testing.assert_allclose(film.instants(times), sharp, rtol=1e-9)
    np.testing.assert_allclose(film.light(times), luminance(sharp), rtol=1e-9)
    assert np.abs(np.asarray(blurred) / sharp - 1.0).max() > 0.1


@pytest.mark.slow
def test_in_view_says_what_rendering_shows():
    times = np.geomspace(1e-4, 0.6, 8)
    answers = []
    for east in np.linspace(15.0, 40.0, 11):
        eye = camera(target=(east, 0.0, 2.0))
        look = Appearance(flash=False)  # light on the ground is no fireball in view
        changed = np.ptp(np.asarray(render(SCENE, eye, times, appearance=look))) > 0
        answers.append((bool(in_view(SCENE, eye)), bool(changed)))
    assert (False, True) not in answers
    # within a pixel of the edge, and there alone, it counts though no ray meets it
    assert answers.count((True, False)) <= 1
    assert min(map(answers.count, [(True, True), (False, False)])) >= 3


@pytest.mark.parametrize("frames", [1, 2, 5, 11, 12, 13, 30, 1000, 100_000])
def test_frames_are_shown_once_from_first_to_last_ever_farther_apart(frames):
    shown = sheet_frames(np.arange(frames) / 1000, [0.0])
    assert (shown[0], shown[-1]) == (0, frames - 1)
    assert len(shown) == min(frames, 12)
    steps = np.diff(shown)
    assert (steps > 0).all()
    # each as much longer than the last as rounding to whole frames allows
    assert (np.diff(steps) >= -1).all()
