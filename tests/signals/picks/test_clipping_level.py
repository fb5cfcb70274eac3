"""Clipping below the full scale of a converter, by the samples alone."""

import numpy as np

from jblast.observations.records.recording import PressureRecord
from jblast.signals.picks.record_picks import clipping_level


def record(samples, full_scale: float | None = 1.0):
    return PressureRecord("a", np.asarray(samples), 1000.0, full_scale=full_scale)


def test_a_flat_top_is_clipped_and_the_top_of_few_codes_is_not():
    time = np.arange(4000)
    pulse = np.where(time < 1000, 0.0, 0.9 * np.exp(-(time - 1000.0) / 800.0))
    pulse += 1e-3 * np.random.default_rng(1).standard_normal(time.size)
    # an amplifier that clips at 0.8, in 16 bits, as `clip_soft80.wav` of issue 41
    clipped = np.round(np.minimum(pulse, 0.8) * 2**15) / 2**15
    assert clipping_level(record(clipped)) == clipped.max()
    assert clipping_level(record(pulse)) == 1.0
    # 20 codes in all, each of tens of samples
    assert clipping_level(record(np.round(pulse * 20) / 20)) == 1.0
    assert np.isnan(clipping_level(record(clipped, None)))
    assert clipping_level(record(np.full(100, 0.5))) == 1.0
