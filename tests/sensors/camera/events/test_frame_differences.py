"""Events as differences of frames: one a pixel and frame, at its time, inverted."""

import numpy as np

from jblast.sensors.camera.events.ideal import (
    frame_differences,
    grey_bytes,
)


def test_a_pixel_that_changes_by_more_than_the_step_gives_one_event_inverted():
    frames = np.full((3, 2, 3), 100, np.uint8)
    frames[1:, 0, 1] = 116  # brighter by 16
    frames[1:, 1, 2] = 84  # darker by 16
    frames[1:, 0, 0] = 115  # by 15: not past the step
    frames[2, 0, 1] = 255  # by far more: one event still
    first, second = frame_differences(zip((0.0, 0.5, 1.0), frames, strict=True))
    assert (first.x.tolist(), first.y.tolist()) == ([1, 2], [0, 1])
    assert first.polarity.tolist() == [-1, 1]
    assert first.time.tolist() == [0.5, 0.5]
    assert (second.x.tolist(), int(second.count)) == ([1], 1)
    assert second.time.tolist() == [1.0]


def test_differences_do_not_wrap_round():
    frames = np.array([[[250]], [[3]]], np.uint8)
    (only,) = frame_differences(zip((0.0, 1.0), frames, strict=True))
    assert only.polarity.tolist() == [1]


def test_grey_of_light_is_that_of_eight_bits():
    light = np.array([[[0.0, 0.0, 0.0], [1.0, 1.0, 1.0], [7.0, 7.0, 7.0]]])
    assert grey_bytes(light).tolist() == [[0, 255, 255]]
