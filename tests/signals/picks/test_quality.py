"""How far a pick is trusted: what its model leaves, beside noise and beside peak."""

import pytest

from jblast.signals.picks.record_picks import notes_of, quality_of
from tests.signals.records.made import pick

PEAK_PA = 1000.0
"""Of the made pick."""


@pytest.mark.parametrize(
    ("misfit", "noise_pa", "quality"),
    [
        (1.0, 2.0, "good"),
        (10.0, 2.0, "doubtful"),
        (100.0, 2.0, "poor"),  # 2 % of the peak are left
        (100.0, 0.2, "poor"),  # 0.2 %
        (4000.0, 0.01, "doubtful"),  # 63 sigma, and no more than 0.06 % of the peak
    ],
)
def test_what_is_left_counts_by_noise_and_by_peak(misfit, noise_pa, quality):
    made = pick(misfit=misfit, noise_pa=noise_pa, peak_overpressure_pa=PEAK_PA)
    assert quality_of(made) == quality
    assert ("misfit" in notes_of(made)) == (quality != "good")
