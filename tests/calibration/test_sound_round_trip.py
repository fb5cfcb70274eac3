"""From sound back to the blast, on few scenes."""

import numpy as np
import pytest

from calibration.sound_round_trip import Q95, ambient_pa, round_trip


@pytest.mark.slow
def test_intervals_of_what_was_heard_hold_the_truth():
    trip = round_trip(10, ambient_pa())
    errors = np.concatenate(list(trip.z["student"].values()))
    assert trip.missed <= 3
    assert errors.size == 4 * (10 - trip.missed)
    # 90 of 100, of some 32 that depend on each other within a scene: 3 sd are 0.3
    assert np.mean(np.abs(errors) < Q95) > 0.6
    # of arrivals the errors are about those that are told; one in a hundred is a
    # neighbouring crest
    assert 0.5 < np.median(np.abs(trip.arrival_z)) / 0.6745 < 1.7
