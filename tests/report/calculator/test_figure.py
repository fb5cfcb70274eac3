import numpy as np
import pytest

from jblast.report.calculator.figures import calculator_figure
from jblast.scene import Scene
from jblast.sensors.calculator import Question, calculate, calculated_laws


@pytest.fixture(scope="module")
def figure():
    return calculator_figure(Question(Scene(), (20.0,), (15.0,)))


def panel(figure, title):
    (found,) = [axes for axes in figure.axes if axes.get_title("left") == title]
    return found


def test_one_panel_a_quantity_but_light(figure):
    drawn = [axes for axes in figure.axes if axes.axison]
    assert len(drawn) == len(calculate(Scene(), np.ones(1), np.ones(1))) - 1
    assert panel(figure, "Peak overpressure").get_ylabel() == "kPa"
    assert panel(figure, "Peak overpressure").get_xscale() == "log"


def key(axes):
    return [text.get_text() for text in axes.get_legend().get_texts()]


def test_every_law_is_named_once_and_every_line_finite(figure):
    axes = panel(figure, "Peak overpressure")
    names = sorted(law.name for law in calculated_laws("peak_overpressure_pa"))
    words = " ".join(key(axes)).replace("outside their range:", "")
    words = words.replace("(within\xa02\xa0%)", "").replace(",", " ").replace("=", " ")
    assert sorted(words.split()) == names
    for axes in figure.axes:
        assert np.isfinite([*axes.get_xlim(), *axes.get_ylim()]).all()
        for line in axes.lines:
            assert np.isfinite(np.asarray(line.get_xydata(), float)).all()


def test_laws_that_coincide_are_one_entry_and_colours_of_a_panel_differ(figure):
    axes = panel(figure, "Reflected pressure")
    assert key(axes) == ["kingery_bulmash\n  = swisdak (within\xa02\xa0%)"]
    black = axes.get_legend().get_lines()[0].get_color()
    for axes in figure.axes:
        if axes.axison:
            lines = axes.get_legend().get_lines()
            colours = [line.get_color() for line in lines]
            assert len(set(colours)) == len(colours)
            for name, line in zip(key(axes), lines, strict=True):
                assert (line.get_color() == black) == name.startswith("kingery_b")


def test_lines_are_solid_where_the_law_holds_only():
    # Kingery and Bulmash's table ends at 40 m for 1 kg
    figure = calculator_figure(Question(Scene(), (10.0, 200.0), (1.0,)))
    axes = panel(figure, "Reflected impulse")
    first, second = (line for line in axes.lines[:2])
    solid, dashed = (first, second)
    assert solid.get_color() == dashed.get_color()
    assert (solid.get_linestyle(), dashed.get_linestyle()) == ("-", "--")
    assert np.max(solid.get_xdata()) == pytest.approx(40.0, rel=0.02)  # a point more
    assert np.max(dashed.get_xdata()) == pytest.approx(200.0)


def test_a_lone_range_is_marked_with_a_decade_to_each_side(figure):
    axes = panel(figure, "Positive impulse")
    assert axes.get_xlim() == pytest.approx((2.0, 200.0))
    assert any(list(line.get_xdata()) == [20.0, 20.0] for line in axes.lines)
