"""The map as drawn: what it frames, what it names, what it says below."""

import numpy as np
import pytest

from jblast.report.figures import figure_bytes
from jblast.report.fit.map import map_figure
from jblast.report.fit.place import (
    ground_map,
    whole_view,
)
from tests.report.fit.place.located import BEIRUT, arc, around, located, normal_draws


def five(**other):
    draws = normal_draws((12.0, -30.0), [[60.0, 20.0], [20.0, 30.0]])
    return located(around(5, 220.0), draws, centre=(12.0, -30.0), **other)


def far():
    draws = normal_draws((120.0, -300.0), [[0.25, 0.1], [0.1, 0.2]])
    return located(
        around(7, 2e4), draws, centre=(120.0, -300.0), frame=BEIRUT, mass=5e5
    )


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
    assert figure_bytes(figure, "png").startswith(b"\x89PNG")
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


@pytest.mark.parametrize("make", [five, far])
def test_all_sensors_the_charge_and_its_ellipse_are_in_view(make):
    shown = ground_map(make())
    assert shown is not None
    view = whole_view(shown)
    for station in shown.stations:
        assert view.holds(*station.position[:2])
    for place in shown.charges[0].ellipses[-1].outline():
        assert view.holds(*place)
