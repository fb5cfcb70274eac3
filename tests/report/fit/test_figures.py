import numpy as np
import pytest
from matplotlib.collections import LineCollection, PolyCollection

from jblast.report.fit.figures import (
    corner_figure,
    recordings_figure,
    reduction,
    residuals_figure,
)
from tests.report import example


def _finite(figure):
    for axes in figure.axes:
        assert np.isfinite([*axes.get_xlim(), *axes.get_ylim()]).all()
        for line in axes.lines:
            assert np.isfinite(np.asarray(line.get_xydata(), float)).all()
        for many in axes.collections:
            if isinstance(many, (LineCollection, PolyCollection)):
                for path in many.get_paths():
                    assert np.isfinite(path.vertices).all()


@pytest.mark.parametrize("make", example.EVERY)
def test_every_artist_is_finite(make):
    fit = make()
    for figure in (recordings_figure(fit), residuals_figure(fit), corner_figure(fit)):
        if figure is not None:
            _finite(figure)


def test_an_arrival_at_the_speed_of_sound_reduces_to_zero():
    fit = example.three_parameters()
    less = reduction(fit, "air_arrival_s", 0)
    assert less is not None
    r = np.array([10.0, 1000.0])
    origin = float(fit.scene.charge.time_s)
    assert less(r * less.slowness + origin, r) == pytest.approx([0, 0], abs=1e-12)
    assert reduction(fit, "peak_overpressure_pa", 0) is None
