"""What frames and events tell: the truth that comes back, from afar as well."""

import numpy as np
import pytest

from jblast.inference.tuning.tune_sight import (
    camera_of,
    look_of,
    paired,
    tune_events,
    tune_frames,
)
from jblast.report.tune_figures import tune_figure
from jblast.scene.reader import scene_from_document
from jblast.sensors.camera.files.images import srgb_bytes
from jblast.sensors.camera.film import Film
from jblast.sensors.camera.image import linear_to_srgb, luminance, srgb_to_linear
from jblast.sensors.camera.rendering import render
from jblast.sensors.camera.scene_events import film_events
from jblast.sensors.camera.stream import joined

TRUE = {
    "charge": {"mass_kg": 15.0, "position_m": [0.0, 0.0, 1.0]},
    "law": {"fireball_growth_s": 0.004},
    "camera": {
        "position_m": [0.0, -40.0, 2.0],
        "look_at_m": [0.0, 0.0, 3.0],
        "width": 24,
        "height": 18,
        "focal_px": 38.0,
        "threshold": [0.25, 0.3],
        "daylight_lux": 5e4,
    },
}
WRONG = TRUE | {
    "law": {"fireball_growth_s": 0.0022},
    "camera": TRUE["camera"] | {"threshold": [0.2, 0.2], "daylight_lux": 9e4},
}


def within(tuned, name, truth):
    one = tuned.numbers[name]
    assert one.identified
    return abs(one.value - truth) < 5.0 * one.sd


def true_events():
    truth = scene_from_document(TRUE, "t").scene
    camera = camera_of(truth)
    film = Film(truth, camera, np.array([0.0, 0.06]), appearance=look_of(camera))
    events = joined(film_events(film))
    return paired(events.x, events.y, np.round(events.time, 6), events.polarity, 0.0)


@pytest.mark.slow
def test_frames_tell_growth_and_exposure():
    truth = scene_from_document(TRUE, "t").scene
    camera, times = camera_of(truth), np.arange(30) * 2e-3
    frames = np.asarray(render(truth, camera, times, appearance=look_of(camera)))
    stored = np.stack([srgb_bytes(frame) for frame in frames]) / 255.0
    light = luminance(srgb_to_linear(stored))
    values = 255.0 * linear_to_srgb(np.asarray(light))
    names = ["fireball_growth_s", "camera_daylight_lux"]
    tuned = tune_frames(scene_from_document(WRONG, "w"), values, times, names)
    assert tuned.converged
    assert not tuned.explained.is_poor
    assert within(tuned, "fireball_growth_s", 0.004)
    assert within(tuned, "camera_daylight_lux", 5e4)
    assert tuned.numbers["fireball_growth_s"].sd < 1e-5
    assert len(tune_figure(tuned).axes) == 3


@pytest.mark.slow
def test_events_tell_thresholds_and_growth():
    pairs = true_events()
    names = ["fireball_growth_s", "camera_threshold_brighter"]
    names += ["camera_threshold_darker"]
    camera_as_exposed = WRONG["camera"] | {"daylight_lux": 5e4}
    wrong = scene_from_document(WRONG | {"camera": camera_as_exposed}, "w")
    tuned = tune_events(wrong, pairs, names)
    assert not tuned.explained.is_poor
    assert within(tuned, "camera_threshold_brighter", 0.25)
    assert within(tuned, "camera_threshold_darker", 0.3)
    assert within(tuned, "fireball_growth_s", 0.004)
    assert len(tune_figure(tuned).axes) == 3


@pytest.mark.slow
def test_events_of_another_exposure_than_is_supposed_are_poorly_explained():
    pairs = true_events()
    names = ["camera_threshold_brighter", "camera_threshold_darker"]
    tuned = tune_events(scene_from_document(WRONG, "w"), pairs, names)
    assert tuned.explained.is_poor
