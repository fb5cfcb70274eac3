"""The map as drawn: what it frames, what it names, what it says below."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.colors import to_hex

from jblast.inference.identifiability import OtherMode, ResolvingDatum
from jblast.report.figure_files import image_bytes
from jblast.report.fit.map import map_figure
from jblast.report.fit.place import (
    COLOURS,
    NO_RESIDUAL,
    absent_map_note,
    degrees,
    ground_map,
    map_notes,
    residual_colour,
    round_length,
    whole_view,
)
from tests.report import example
from tests.report.fit.place.located import BEIRUT, arc, around, located, normal_draws


def five(**other):
    draws = normal_draws((12.0, -30.0), [[60.0, 20.0], [20.0, 30.0]])
    return located(around(5, 220.0), draws, centre=(12.0, -30.0), **other)


def far():
    draws = normal_draws((120.0, -300.0), [[0.25, 0.1], [0.1, 0.2]])
    return located(
        around(7, 2e4), draws, centre=(120.0, -300.0), frame=BEIRUT, mass=5e5
    )


def words(figure):
    texts = [t for axes in figure.axes for t in axes.texts]
    said = [t.get_text() for t in [*texts, *figure.texts]]
    return said + [axes.get_title(loc="left") for axes in figure.axes]


CASES = {
    "one sensor": lambda: located([[30.0, 12.0]]),
    "one place": lambda: located([[0.0, 0.0]]),
    "five": five,
    "two hundred": lambda: located(
        around(200, 800.0), normal_draws((4.0, 8.0), np.eye(2) * 900), suspected=(3, 77)
    ),
    "ten metres": lambda: located(around(6, 10.0), normal_draws((1, 2), np.eye(2))),
    "far": far,
    "arc": lambda: located(around(3, 20.0), arc(), centre=(99.0, 67.0)),
    "one coordinate": lambda: located(
        around(3, 20.0), normal_draws((0, 0), [[4.0, 0.0], [0.0, 0.0]])
    ),
    "aloft": lambda: located(around(4, 30.0), up=400.0),
    "no residual": lambda: located(around(2, 30.0), residuals=[np.nan, np.nan]),
}


@pytest.mark.parametrize("case", CASES)
def test_every_map_can_be_drawn_with_north_up_and_both_axes_alike(case):
    figure = map_figure(CASES[case]())
    assert figure is not None
    assert image_bytes(figure, "png").startswith(b"\x89PNG")
    axes = figure.axes[0]
    assert axes.get_aspect() == 1.0
    (west, east), (south, north) = axes.get_xlim(), axes.get_ylim()
    assert west < east
    assert south < north
    box = axes.get_window_extent()
    # drawn to a pixel
    assert (east - west) / box.width == pytest.approx(
        (north - south) / box.height, rel=0.01
    )


def test_positions_of_a_sensor_that_differ_by_rounding_have_one_label():
    fit = five()
    table = fit.observations
    first = table.position[0]
    doubled = replace(
        table,
        sensor=(*table.sensor[:-1], table.sensor[0]),
        position=np.vstack([table.position[:-1], np.round(first + 0.04, 1)]),
    )
    shown = ground_map(replace(fit, observations=doubled))
    assert shown is not None
    names = [station.name for station in shown.stations]
    assert names.count(table.sensor[0]) == 1


@pytest.mark.parametrize("make", [five, far])
def test_all_sensors_the_charge_and_its_ellipse_are_in_view(make):
    shown = ground_map(make())
    assert shown is not None
    view = whole_view(shown)
    for station in shown.stations:
        assert view.holds(*station.position[:2])
    for place in shown.charges[0].ellipses[-1].outline():
        assert view.holds(*place)


def test_an_ellipse_of_a_metre_among_kilometres_is_drawn_once_more():
    figure = map_figure(far())
    assert figure is not None
    said = words(figure)
    assert "About the charge" in said
    assert figure.axes[0].get_xlabel() == "east (km)"
    assert figure.axes[1].get_xlabel() == "east (m)"
    assert "About the charge" not in words(map_figure(five()))


def test_a_sensor_has_the_colour_of_its_worst_residual():
    fit = five(residuals=[-2.5, 0.2, 3.5, 1.4, np.nan])
    figure = map_figure(fit)
    assert figure is not None
    dots = [
        line
        for line in figure.axes[0].lines
        if line.get_marker() == "o" and line.get_markerfacecolor() != "none"
    ]
    found = [to_hex(line.get_markerfacecolor()) for line in dots]
    assert found == [COLOURS[1], COLOURS[3], COLOURS[6], COLOURS[4], NO_RESIDUAL]


def test_colours_run_from_blue_through_white_to_red():
    found = [residual_colour(r) for r in (-9.0, -2.5, -1.5, 0.0, 1.5, 2.5, 9.0)]
    assert found == list(COLOURS)
    assert residual_colour(-1.0) == residual_colour(1.0) == COLOURS[3]


def test_the_wind_and_the_rings_and_the_corners_are_said():
    said = "\n".join(words(map_figure(five(wind=(3.0, 4.0), frame=BEIRUT))))
    assert "wind 5 m/s" in said
    assert "5\u00a0kPa to" in said
    assert "Kingery-Bulmash" in said
    assert "N, 35.5" in said
    calm = "\n".join(words(map_figure(five())))
    assert "wind" not in calm
    assert "WGS84" not in calm


def test_a_log_of_ranges_alone_has_no_map_and_says_so():
    fit = five()
    nowhere = np.full_like(fit.observations.position, np.nan)
    ranges = np.full(5, 30.0)
    table = replace(fit.observations, position=nowhere, slant_range=ranges)
    ranged = replace(fit, observations=table)
    assert map_figure(ranged) is None
    assert "has ranges" in absent_map_note(ranged)
    assert map_figure(example.shock_radius()) is None


def test_a_charge_whose_place_the_log_cannot_tell_is_not_drawn():
    fit = five()
    untold = replace(fit, draws={"charge_east_m": fit.draws["charge_east_m"]})
    shown = ground_map(untold)
    assert shown is not None
    assert shown.charges == ()
    assert "is not identified" in "\n".join(words(map_figure(untold)))


def test_other_optima_and_the_accepted_place_are_marked():
    fit = five()
    other = OtherMode(
        {"charge_east_m": 150.0, "charge_north_m": 60.0},
        ("charge_east_m",),
        0.2,
        ResolvingDatum("air_arrival_s", "aside"),
    )
    fit = replace(fit, summary=replace(fit.summary, ambiguities=(other,)))
    accepted = {"charge_east_m": (15.0, "it"), "charge_north_m": (-28.0, "it")}
    figure = map_figure(fit, accepted)
    assert figure is not None
    said = "\n".join(words(figure))
    assert "other optima" in said
    assert "accepted position" in said
    marks = {
        line.get_marker(): tuple(np.asarray(line.get_xydata(), float)[0])
        for axes in figure.axes
        for line in axes.lines
    }
    assert marks["X"] == (150.0, 60.0)
    assert marks["+"] == (15.0, -28.0)


@pytest.mark.parametrize(
    ("longest", "length"), [(1.0, 1.0), (4.9, 2.0), (73.0, 50.0), (0.03, 0.02)]
)
def test_scale_bars_are_of_a_round_length(longest, length):
    assert round_length(longest) == pytest.approx(length)


def test_degrees_name_their_hemisphere():
    assert degrees(-16.5, -179.0) == "16.50000° S, 179.00000° W"


def test_the_footnote_on_the_range_of_a_law_is_on_one_line():
    shown = ground_map(five())
    assert shown is not None
    (charge,) = shown.charges
    outside = tuple(replace(ring, valid=False) for ring in charge.rings)
    assert outside
    shown = replace(shown, charges=(replace(charge, rings=outside),))
    for width in range(60, 130, 7):
        lines = map_notes(shown, whole_view(shown), width)
        footnote = "* outside the law's range"
        assert any(footnote in line.replace("\u00a0", " ") for line in lines)
