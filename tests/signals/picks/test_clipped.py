"""Quality by what is left of a record, and clipping by the recorder's scale."""

import numpy as np

from jblast.observations.records.recording import PressureRecord
from jblast.signals.picks import NOTES, pick, pick_records
from tests.signals.picks.simulated import RATE, TIME, Truth, noisy
from tests.signals.records import made

TRUTH = Truth()


def test_a_note_makes_a_pick_as_bad_as_its_row():
    for kind, row in NOTES.items():
        assert made.pick(notes=(kind,)).quality == row.quality
    assert made.pick().quality == "good"
    assert made.pick(notes=("sharp_front", "clipped")).quality == "doubtful"


def test_a_full_scale_is_used_if_stated():
    samples = noisy(TRUTH, 0.02 * TRUTH.peak, 2, seed=5)
    cut = np.minimum(samples[1], 0.5 * TRUTH.peak)
    stated = PressureRecord(
        "stated", samples[0], rate_hz=RATE, full_scale=0.6 * TRUTH.peak
    )
    unstated = PressureRecord("unstated", samples[0], rate_hz=RATE)
    equal = PressureRecord("equal", cut, rate_hz=RATE)
    found = [one.pick for one in pick_records([stated, unstated, equal])]
    assert [np.isfinite(one.clipped_at_pa) for one in found] == [True, False, True]
    alone = pick(TIME, samples[0], full_scale_pa=0.6 * TRUTH.peak)
    assert found[0].peak_overpressure_pa == alone.peak_overpressure_pa
