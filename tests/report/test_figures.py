"""Records, spectrograms, names and files of figures."""

import numpy as np
import pytest
from matplotlib.collections import PolyCollection

from jblast.report.figures import (
    envelope,
    extremes,
    figure_bytes,
    new_figure,
    place_names,
    power_density,
    spectrogram,
)


def test_no_sample_is_lost_between_the_columns_of_a_record():
    samples = np.random.default_rng(3).normal(size=10_007)
    starts, low, high = extremes(samples, 300)
    ends = [*starts[1:], samples.size]
    for first, last, least, most in zip(starts, ends, low, high, strict=True):
        assert (least, most) == (samples[first:last].min(), samples[first:last].max())
    assert len(extremes(samples[:4], 300)[0]) == 4


@pytest.mark.parametrize(("count", "band"), [(500, False), (50_000, True)])
def test_a_long_record_is_drawn_as_a_band(count, band):
    axes = new_figure(4, 2).subplots()
    envelope(axes, np.zeros(count), 100.0, start_s=2.0)
    assert (len(axes.findobj(PolyCollection)) == 1) is band
    assert axes.get_xlim() == (2.0, 2.0 + (count - 1) / 100.0)


@pytest.mark.parametrize("count", [40, 3000, 90_000])
def test_a_spectrogram_has_the_power_of_the_record(count):
    samples = np.random.default_rng(1).normal(size=count)
    time, frequency, density = power_density(samples, 2000.0)
    assert density.shape == (len(time) - 1, len(frequency))
    # white noise: the mean over windows scatters by its number of samples, and one of
    # its 32 or 64 equal rows, that of frequency 0, is left out
    power = density.mean(axis=0).sum() * frequency[0]
    scatter = 4 / np.sqrt(count) + frequency[0] / 2000.0
    assert power == pytest.approx(np.mean(samples**2), rel=scatter)


def test_a_sine_is_drawn_at_its_frequency_and_silence_is_named():
    time = np.arange(4000) / 2000.0
    _, frequency, density = power_density(np.sin(2 * np.pi * 250.0 * time), 2000.0)
    assert frequency[density.mean(axis=0).argmax()] == 250.0
    axes = new_figure(4, 2).subplots()
    spectrogram(axes, np.zeros(4000), 2000.0)
    assert [text.get_text() for text in axes.texts] == ["silent"]


def test_names_are_apart_and_the_file_is_always_the_same():
    points = np.array([[1.0, 1.0], [1.01, 1.0], [1.0, 1.01], [3.0, 2.0]])
    names = ["alpha", "$beta", "gamma", "a name of more than eighteen characters"]

    def drawn():
        figure = new_figure(5, 4)
        axes = figure.subplots()
        axes.set(xlim=(0, 4), ylim=(0, 3))
        figure.draw_without_rendering()
        place_names(axes, names, points)
        boxes = [text.get_window_extent() for text in axes.texts]
        return figure_bytes(figure), boxes, axes

    first, boxes, axes = drawn()
    assert not any(
        one.overlaps(other) for k, one in enumerate(boxes) for other in boxes[:k]
    )
    assert axes.texts[3].get_text() == "a name of more than eig…"
    assert first == drawn()[0]
    assert first.startswith(b"\x89PNG")
