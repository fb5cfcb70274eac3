"""Event cameras and lenses past their edges: bare formulas fail, jblast does not."""

import numpy as np
import pytest

from calibration.cases import analytic
from jblast.verification.stability import camera
from jblast.verification.stability.camera import behind_failure, fold_failure
from jblast.verification.stability.failure import measures_of


def test_events_are_entered_into_the_map():
    assert measures_of("events") == (camera.event_failures,)


def test_whole_counts_keep_their_digits_ten_times_as_long_as_a_sum():
    running, counted = camera.summed_errors()
    begin = np.argmax(running > camera.REFERENCE_ERROR)
    assert begin > 1000
    assert counted[: 10 * begin].max() < camera.REFERENCE_ERROR


def test_a_bare_floor_loses_events_of_exact_ramps_and_ours_none():
    bare, ours = camera.lost_to_rounding()
    assert bare > 0.05 * camera.RAMPS
    assert ours == 0


def test_blocks_on_their_own_lose_what_the_stream_keeps():
    whole, alone, together = camera.cut_counts()
    assert whole == together == len(analytic()[0])
    assert alone < 0.95 * whole


def test_a_pulse_between_two_frames_is_seen_without_frames_only():
    assert camera.pulse_counts(0.2) == (0, 10)
    # five thresholds' worth of it still reaches the frames beside
    assert camera.pulse_counts(0.5)[0] > 0


def test_a_still_pixel_sends_what_the_logistic_says():
    at = 0.15
    assert camera.still_count(at) == pytest.approx(2 * np.exp(-1 / at), rel=0.01)


def test_places_behind_the_camera_and_beyond_the_fold_are_marked():
    assert behind_failure().response == "marks"
    mode = fold_failure()
    assert mode.response == "marks"
    # 1 + 3 k1 r^2 = 0 for k1 alone
    assert np.tan(np.radians(mode.boundary)) == pytest.approx(1 / np.sqrt(0.9))
