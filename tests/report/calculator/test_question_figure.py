import numpy as np
import pytest

from jblast.report.calculator.figures import question_figure
from jblast.scene import Charge, Scene
from jblast.sensors.calculator import Question, calculate, recommended_values

PRESSURE = "peak_overpressure_pa"


@pytest.fixture(scope="module")
def figure():
    scene = Scene(Charge(burst="surface"))
    question = Question(scene, (20.0,), (15.0,))
    by_law = calculate(scene, 20.0, 15.0)[PRESSURE]
    told = recommended_values(question, {PRESSURE: by_law})[PRESSURE]
    return question_figure(question, PRESSURE, told)


def test_the_answer_is_marked_where_it_is(figure):
    (axes,) = figure.axes
    (dot,) = [line for line in axes.lines if line.get_marker() == "o"]
    scene = Scene(Charge(burst="surface"))
    pressure = calculate(scene, 20.0, 15.0)[PRESSURE]["kingery_bulmash"].value[0]
    np.testing.assert_allclose(dot.get_xydata(), [[20.0, pressure / 1e3]])


def test_groups_have_colours_of_their_own_and_are_named(figure):
    (axes,) = figure.axes
    key = axes.get_legend()
    words = [text.get_text() for text in key.get_texts()]
    assert words[0].startswith("kingery_bulmash")
    assert "= swisdak (within\xa02\xa0%)" in words[0]
    colours = [line.get_color() for line in key.get_lines()]
    assert len(set(colours)) == len(colours) == len(words)
    assert words[-1].startswith("outside their range: brode, ")
