"""The calculator's figure: laws within their ranges, and the answers."""

import numpy as np
from matplotlib.colors import to_hex

from jblast.report.calc import Calc, level
from jblast.report.colours import INK
from jblast.scene import Air, Charge, Scene
from jblast.sensors.calculator import Question

PEAK = "peak_overpressure_pa"
SURFACE = Scene(Charge(burst="surface"), air=Air(relative_humidity=0.0))


def curves(axes):
    """Return label and drawn part of each curve of a panel."""
    found = {}
    for line in axes.get_lines():
        x, y = np.asarray(line.get_xydata(), float).T
        if len(x) > 2:
            found[line.get_label()] = x[np.isfinite(y)], to_hex(line.get_color())
    return found


def marked(axes):
    """Return the abscissas of the marked answers of a panel."""
    points = [np.asarray(line.get_xydata(), float) for line in axes.get_lines()]
    return [float(point[0, 0]) for point in points if len(point) == 1]


def test_laws_end_at_their_ranges_and_the_recommended_one_is_named():
    question = Question(SURFACE, (20.0, 40.0), (1.0,))
    figure = Calc(question, PEAK).figure()
    (axes,) = figure.axes
    drawn = curves(axes)
    x, colour = drawn["kingery_bulmash (recommended)"]
    assert x.max() <= 40.0 < axes.get_xlim()[1]
    assert colour == INK
    # a law for free air holds nowhere on the ground
    assert "kinney_graham" not in drawn
    assert marked(axes) == [20.0, 40.0]


def test_every_solution_of_a_mass_is_marked():
    question = Question(SURFACE, (5.0,), quantity="positive_duration_s", target=0.003)
    (axes,) = Calc(question).figure().axes
    np.testing.assert_allclose(marked(axes), [0.34, 686.0, 2248.0], rtol=0.01)
    assert axes.get_xlim()[1] > 2248.0


def test_a_level_is_that_of_a_pressure_in_air():
    assert level(PEAK, 20e-6) == "0.0"
    assert level("reflected_pressure_pa", 2.0) == "100.0"
    assert level("dynamic_pressure_pa", 2.0) == level("air_arrival_s", 2.0) == ""
