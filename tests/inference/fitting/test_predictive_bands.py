"""Points, line and band of a figure are of one place: numbers as they are drawn."""

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.collections import PolyCollection

from jblast.inference import fit
from jblast.report.fit.figures import recordings_figure
from tests.inference.fitting.clocks_off import ASKED, heard
from tests.report.example import three_parameters


@pytest.fixture(scope="module")
def found():
    return fit(heard("arrivals", np.random.default_rng(4)), ASKED)


@pytest.mark.slow
def test_the_line_of_a_figure_goes_by_what_the_answer_predicts(found):
    (axes,) = recordings_figure(found).axes
    drawn = [np.asarray(x.get_xydata(), float) for x in axes.lines]
    line = np.concatenate([xy for xy in drawn if len(xy) > 6])
    points = next(xy for xy in drawn if len(xy) == 6)
    line = line[np.argsort(line[:, 0])]
    above = points[:, 1] - np.interp(points[:, 0], line[:, 0], line[:, 1])
    missed = 1e3 * (found.observations.value - found.predicted)
    # a chord between places 3 % of the range apart, of a curve with one bend
    np.testing.assert_allclose(above, missed, atol=0.01 * np.ptp(line[:, 1]))
    # points lie on both sides of what fits them
    assert above.min() < 0 < above.max()
    plt.close("all")


@pytest.mark.slow
def test_the_band_at_a_sensor_is_what_draws_say_of_it(found):
    (band,) = found.bands
    names = list(found.summary.free)
    numbers = np.stack([found.draws[n] for n in names], axis=1)[::40]
    positive = [b.positive for b in found.density.parameters.beliefs]
    z = np.where(positive, np.log(np.where(positive, numbers, 1.0)), numbers)
    read = np.array([found.density.misfit(one).predicted for one in z])
    low, high = np.quantile(read, [0.05, 0.95], axis=0)
    at = np.log(found.distance)
    for ours, theirs in ((band.q05, low), (band.q95, high)):
        # the same draws; what is left is the chord between places of the band
        near = np.interp(at, np.log(band.x), ours)
        np.testing.assert_allclose(near, theirs, atol=0.05 * np.max(high - low))


def test_axes_hold_the_whole_of_the_band():
    """Far wider than the readings, as of a log that tells little."""
    told = three_parameters()
    wide = tuple(replace(b, q05=0.5 * b.q05, q95=2.0 * b.q95) for b in told.bands)
    for axes in recordings_figure(replace(told, bands=wide)).axes:
        assert any(isinstance(drawn, PolyCollection) for drawn in axes.collections)
        low, high = axes.get_ylim()
        for drawn in axes.collections:
            if isinstance(drawn, PolyCollection):
                for path in drawn.get_paths():
                    assert low <= np.asarray(path.vertices)[:, 1].min()
                    assert np.asarray(path.vertices)[:, 1].max() <= high
    plt.close("all")
