import numpy as np
import pytest

from jblast.report.calculator.figures import calculator_figure
from jblast.scene import Scene
from jblast.sensors.calculator import Question, calculated_laws


@pytest.fixture(scope="module")
def figure():
    return calculator_figure(Question(Scene(), (20.0,), (15.0,)))


def panel(figure, title):
    (found,) = [axes for axes in figure.axes if axes.get_title("left") == title]
    return found


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
