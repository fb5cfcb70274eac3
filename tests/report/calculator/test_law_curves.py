import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Annotation

import jblast.waves  # noqa: F401  laws enter the registry as they are imported
from jblast.registry import LAWS
from jblast.report.calculator.figures import (
    LABEL_GAP,
    LAW_COLOURS,
    draw_curve,
    law_colours,
    name_curves,
    spread,
)


def test_labels_keep_apart_in_order_and_beside_the_panel():
    heights = np.array([0.0, 0.5, 0.51, 0.49, 1.0, 1.0, 0.02])
    places = spread(heights)
    order = np.argsort(heights, kind="stable")
    assert (np.diff(places[order]) >= LABEL_GAP - 1e-12).all()
    assert places.min() >= 0.0
    assert places.max() <= 1.0
    assert places[[3, 1, 2]].mean() == pytest.approx(0.5)
    np.testing.assert_allclose(spread(np.array([0.3, 0.7])), [0.3, 0.7], rtol=1e-12)


def test_there_is_a_colour_for_each_law():
    assert len(set(LAW_COLOURS)) == len(LAW_COLOURS)
    colours = law_colours()
    undrawn = {"light", "line_of_sight", "fireball", "blast_load"}
    assert set(colours) == {law.name for law in LAWS.values()} - undrawn
    assert len(set(colours.values())) == len(colours)


def test_a_curve_is_solid_where_the_law_holds_and_dashed_elsewhere():
    axes = Figure().subplots()
    x = np.arange(1.0, 6.0)
    draw_curve(axes, x, x**2, x < 3.0, "#123456")
    solid, dashed = axes.lines
    assert solid.get_linestyle() == "-"
    assert dashed.get_linestyle() != "-"
    np.testing.assert_array_equal(solid.get_xdata(), [1.0, 2.0, 3.0])  # they meet
    np.testing.assert_array_equal(dashed.get_ydata(), [9.0, 16.0, 25.0])


def test_a_name_points_at_the_end_of_its_curve_or_of_the_panel():
    axes = Figure().subplots()
    axes.set(xscale="log", yscale="log", xlim=(1.0, 100.0), ylim=(1.0, 100.0))
    ends = {"inside": (10.0, 10.0), "above": (100.0, 1e9)}
    name_curves(axes, ends, {"inside": "#123456", "above": "#654321"}, ["above"])
    inside, above = (text for text in axes.texts if isinstance(text, Annotation))
    assert inside.xy == pytest.approx((0.5, 0.5))
    assert above.xy == pytest.approx((1.0, 1.0))
    assert (inside.get_alpha(), above.get_alpha()) == (1.0, 0.7)
