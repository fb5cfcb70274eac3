"""The picture of what was heard."""

import numpy as np
import pytest

from jblast.report.detect_files import COLUMNS, MAX_LABELS, detection_figure
from jblast.signals.search import Channel, search

RATE = 8000.0


@pytest.fixture(scope="module")
def searched():
    rng, template = np.random.default_rng(0), np.hanning(40)
    samples = 0.1 * rng.standard_normal(16_000)
    for nth in range(7):
        samples[2000 * (nth + 1) : 2000 * (nth + 1) + 40] += (1 + 0.1 * nth) * template
    return search(Channel("gate", "gate.wav", 1, samples, RATE), template)


def test_recording_output_threshold_and_arrivals_are_drawn(searched):
    above, below = detection_figure([searched]).axes
    times = [np.asarray(line.get_xdata())[0] for line in above.lines]
    np.testing.assert_allclose(times, np.arange(1, 8) * 0.25, atol=1e-3)
    marks = [line for line in below.lines if line.get_marker() == "v"]
    assert len(marks) == 7
    level = [
        np.asarray(line.get_ydata())[0]
        for line in below.lines
        if line.get_linestyle() == "--"
    ]
    assert level == [searched.threshold]
    labels = [text.get_text() for text in below.texts]
    assert len(labels) == MAX_LABELS
    assert labels[0].startswith("1.75")  # the loudest
    assert searched.channel.samples.size > 2 * COLUMNS  # an envelope is drawn
