import numpy as np
import pytest
from matplotlib.collections import LineCollection, PolyCollection

from jblast.report.fit.figures import (
    corner_figure,
    recordings_figure,
    reduction,
    residuals_figure,
)
from jblast.report.fit.rows import outlier_rows
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


def test_shock_radii_stand_against_time_after_detonation():
    (axes,) = recordings_figure(example.shock_radius()).axes
    assert axes.get_xlabel() == "time after detonation (ms)"
    (axes,) = residuals_figure(example.shock_radius()).axes
    assert axes.get_xlabel() == "time after detonation (ms)"


def test_a_suspected_outlier_is_ringed_and_named():
    fit = example.with_outliers()
    assert outlier_rows(fit) == (9,)
    axes = recordings_figure(fit).axes[1]
    (name,) = [t.get_text() for t in axes.texts]
    assert name.startswith("<script>alert")


def test_accepted_values_are_lines_in_the_unit_of_the_axis():
    accepted = {"charge_mass_kg": (2.48e7, "Selby")}
    figure = corner_figure(example.shock_radius(), accepted)
    assert figure is not None
    assert figure.axes[2].get_xlabel() == "charge mass (kt)"
    verticals = [
        np.asarray(line.get_xdata(), float)[0] for line in figure.axes[0].lines
    ]
    assert any(x == pytest.approx(24.8) for x in verticals)
