"""Detectors past their edges: each failure is seen, and what jblast does there."""

import numpy as np
import pytest

from jblast.verification.stability import detectors
from jblast.verification.stability.failure import measures_of


def test_detectors_are_entered_into_the_map():
    assert measures_of("detectors") == (
        detectors.detector_failures,
        detectors.flash_failures,
    )


def test_a_rotor_deafens_the_plain_filter_only():
    plain, ours = detectors.rotor_misses()
    assert plain[0] > 0.9
    assert max(ours) < 0.1


def test_a_clipped_blast_is_heard_where_it_was():
    off, sigma, lost = detectors.clipping_errors()
    assert off.max() < 5e-5
    assert off[-1] > 10 * sigma[-1]
    assert (np.diff(lost) > 0).all()


@pytest.mark.slow
def test_every_failure_is_answered():
    modes = detectors.detector_failures()
    assert {mode.area for mode in modes} == {detectors.AREA}
    assert [mode.response for mode in modes].count("holds") == 4
    assert len(modes) == 7
