from dataclasses import replace

import numpy as np
import pytest
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import to_rgba

from jblast.report.fit.figures import (
    corner_figure,
    drawn_parameters,
    recordings_figure,
    reduction,
    residuals_figure,
    runs,
)
from jblast.report.fit.rows import MAX_ROWS, outlier_rows, residual_rows
from jblast.scene import with_values
from tests.report import example
from tests.report.made_up import PLAIN, fit_of, log


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


def test_one_panel_a_quantity_with_units_on_its_axes():
    left, right = recordings_figure(example.three_parameters()).axes
    assert left.get_ylabel() == "travel time − range / 340.8 m/s (ms)"
    assert right.get_ylabel() == "peak overpressure (kPa)"
    assert right.get_xlabel() == "slant range (m)"
    assert (right.get_xscale(), right.get_yscale()) == ("log", "log")


def test_an_arrival_at_the_speed_of_sound_reduces_to_zero():
    fit = example.three_parameters()
    less = reduction(fit, "air_arrival_s", 0)
    assert less is not None
    r = np.array([10.0, 1000.0])
    origin = float(fit.scene.charge.time_s)
    assert less(r * less.slowness + origin, r) == pytest.approx([0, 0], abs=1e-12)
    assert reduction(fit, "peak_overpressure_pa", 0) is None


def test_an_unidentified_sound_speed_reduces_no_arrival():
    fit = example.not_identifiable()
    anywhere = with_values(fit.scene, {"air_sound_speed_m_s": 261.0})
    less = reduction(replace(fit, scene=anywhere), "air_arrival_s", 0)
    assert less is not None
    assert "340.8 m/s" in less.label


def test_where_the_law_does_not_hold_the_line_is_dashed():
    (axes,) = recordings_figure(example.one_parameter()).axes
    styles = [
        line.get_linestyle()
        for line in axes.lines
        if len(np.asarray(line.get_xdata())) > 5
    ]
    assert "--" in styles
    assert "-" in styles


def test_stretches_share_their_end_points():
    flags = np.array([True, True, False, False, True])
    assert runs(flags) == [(0, 3, True), (2, 5, False), (4, 5, True)]
    assert runs(np.ones(3, bool)) == [(0, 3, True)]


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


def test_unidentified_parameters_are_absent_from_the_corner_plot_with_a_note():
    fit = example.not_identifiable()
    assert drawn_parameters(fit) == ["origin_time_s"]
    figure = corner_figure(fit)
    assert figure is not None
    note = figure.get_supxlabel().replace("\n", " ")
    assert "Not shown" in note
    assert "charge mass and air sound speed" in note
    assert corner_figure(example.no_draws()) is None


def test_numbers_along_a_corner_plot_are_written_in_full():
    fit = example.shock_radius()
    far = 149.9 + 0.1 * fit.draws["sedov_gamma"]
    figure = corner_figure(replace(fit, draws={**fit.draws, "sedov_gamma": far}))
    assert figure is not None
    figure.draw_without_rendering()
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            assert axis.get_offset_text().get_text() == ""


def test_accepted_values_are_lines_in_the_unit_of_the_axis():
    accepted = {"charge_mass_kg": (2.48e7, "Selby")}
    figure = corner_figure(example.shock_radius(), accepted)
    assert figure is not None
    assert figure.axes[2].get_xlabel() == "charge mass (kt)"
    verticals = [
        np.asarray(line.get_xdata(), float)[0] for line in figure.axes[0].lines
    ]
    assert any(x == pytest.approx(24.8) for x in verticals)


def test_the_residual_table_marks_outliers_and_keeps_to_its_length():
    rows = residual_rows(example.with_outliers())
    assert [row.suspected for row in rows].index(True) == 9
    assert rows[0].line == "3"
    assert rows[6].measured.endswith("kPa")
    r = np.geomspace(5.0, 500.0, 300)
    long = fit_of(log(["peak_overpressure_pa"], r), summary=PLAIN)
    rows = residual_rows(long)
    assert len(rows) == MAX_ROWS
    kept = min(abs(float(row.residual)) for row in rows)
    assert kept == pytest.approx(np.sort(abs(long.residual))[-MAX_ROWS], abs=0.006)


def test_marks_of_residuals_show_the_ones_below_them():
    lines = residuals_figure(example.three_parameters()).axes[0].lines
    marks = [line for line in lines if not str(line.get_label()).startswith("_")]
    assert len(marks) == 2
    assert all(to_rgba(mark.get_markerfacecolor())[3] < 1 for mark in marks)
    first, second = (mark.get_markersize() for mark in marks)
    assert first > second
