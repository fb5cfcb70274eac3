"""Pressure records past what a pick can tell: what fails is seen, and told."""

import numpy as np
import pytest

from jblast.observations.records.recording import PressureRecord
from jblast.signals.picks.pick import NAMES
from jblast.verification.stability import detectors
from jblast.verification.stability.detectors import Shares, is_far_off
from jblast.verification.stability.failure import measures_of
from tests.signals.records.made import record_pick


def test_records_are_entered_into_the_map():
    assert measures_of("records") == (detectors.record_failures,)


def test_levels_go_from_harmless_to_hopeless():
    for levels in (
        detectors.PICK_SNRS,
        detectors.PER_PHASE,
        detectors.PERIODS,
        detectors.LEFT,
    ):
        assert list(levels) == sorted(levels, reverse=True)


def test_far_off_is_by_the_own_errors_of_a_pick():
    one = record_pick(PressureRecord("a", np.zeros(100), 1e4))
    near = np.array([float(getattr(one.pick, name)) for name in NAMES[:4]])
    sd = float(one.pick.spread[1])
    assert not is_far_off(one, near)
    assert not is_far_off(one, near * [1, np.exp(3.9 * sd), 1, 1])
    assert is_far_off(one, near * [1, np.exp(4.1 * sd), 1, 1])


def test_a_row_begins_where_more_than_a_twentieth_fail():
    shares = Shares(
        failed=np.array([0.0, 0.04, 0.3, 0.2]),
        unmarked=np.array([0.0, 0.02, 0.01, 0.0]),
        marked=np.array([0.0, 0.1, 0.9, 1.0]),
    )
    row = detectors._row("a", (4.0, 3.0, 2.0, 1.0), shares, "m", words="{:g}".format)
    assert (row.boundary, row.response) == (2.0, "marks")
    assert row.beyond == "30% at 2"
    assert row.message.endswith("2% at most, at 3")


def test_what_is_far_off_and_called_good_is_not_claimed_to_be_marked():
    shares = Shares(np.array([0.3]), np.array([0.2]), np.array([0.1]))
    with pytest.raises(RuntimeError, match='expected the response "marks"'):
        detectors._row("a", (4.0,), shares, "m", words="{:g}".format)


@pytest.mark.slow
def test_noise_makes_picks_fail_and_they_say_so():
    found = detectors.noise_shares(detectors.COLOUR)
    assert found.failed[0] <= detectors.FAILED_SHARE < found.failed[-1]
    assert found.unmarked.max() <= detectors.FAILED_SHARE
