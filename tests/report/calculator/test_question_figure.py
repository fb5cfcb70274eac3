from typing import Any

import numpy as np
import pytest

from jblast.report.calculator.question_figure import groups, question_figure
from jblast.scene import Charge, Scene
from jblast.sensors.calculator.forward import Calculated, calculate
from jblast.sensors.calculator.question import Question
from jblast.sensors.calculator.recommended import recommended_value

PRESSURE = "peak_overpressure_pa"


def said(value, valid: Any = True):
    value = np.asarray(value, float)
    return Calculated(value, np.broadcast_to(valid, value.shape), "", two_sets=False)


def test_laws_within_two_percent_wherever_both_hold_are_one_group():
    laws = {
        "first": said([100.0, 50.0]),
        "same": said([101.0, 49.5]),
        "elsewhere": said([100.0, 500.0], np.array([True, False])),
        "apart": said([100.0, 52.0]),
        "alone": said([1.0, 1.0], valid=False),
    }
    assert groups(laws, list(laws)) == [
        ["first", "same", "elsewhere"],
        ["apart"],
        ["alone"],
    ]


@pytest.fixture(scope="module")
def figure():
    scene = Scene(Charge(burst="surface"))
    question = Question(scene, (20.0,), (15.0,))
    by_law = calculate(scene, 20.0, 15.0)[PRESSURE]
    told = recommended_value(question, PRESSURE, by_law)
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
    assert "= swisdak (within 2 %)" in words[0]
    colours = [line.get_color() for line in key.get_lines()]
    assert len(set(colours)) == len(colours) == len(words)
