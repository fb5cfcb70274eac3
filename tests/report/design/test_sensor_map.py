import dataclasses

import numpy as np
import pytest

from jblast.inference import BoundMap
from jblast.report.design_figure import bound_figure

pytestmark = pytest.mark.slow  # each layout compiles its own search

EAST = np.linspace(-100.0, 100.0, 21)
NORTH = np.linspace(-50.0, 150.0, 21)


def made(**changes) -> BoundMap:
    """A map that is darkest at the charge, its upper rows outside a law's range."""
    away = np.hypot(EAST[None, :] - 10.0, NORTH[:, None] - 20.0)
    drawn = BoundMap(
        east=EAST,
        north=NORTH,
        up=1.5,
        log_sd_mass=0.05 + 0.3 * away / 100.0,
        place_sd=0.2 + away / 20.0,
        mass="charge_mass_kg",
        place=("charge_east_m", "charge_north_m"),
        now={"mass": 0.4, "place": 8.0},
        valid=np.broadcast_to(NORTH[:, None] < 120.0, (21, 21)),
        like="a",
        records=("air_arrival_s", "peak_overpressure_pa"),
        sensors={"a": (60.0, 0.0), "b <x>": (-70.0, 30.0)},
        charges=np.array([[10.0, 20.0]]),
    )
    return dataclasses.replace(drawn, **changes)


def words(figure):
    return [text.get_text() for axes in figure.axes for text in axes.texts]


def test_mass_and_place_have_a_panel_each_with_contours_in_their_units():
    figure = bound_figure(made())
    mass, place = figure.axes
    assert mass.get_title("left") == "Sd of charge mass"
    assert mass.get_title("right") == "now 40 %"
    assert place.get_title("left") == "Sd of position"
    assert place.get_title("right") == "now 8 m"
    figure.draw_without_rendering()
    labels = words(figure)
    assert any(label.endswith(" %") for label in labels)
    assert any(label.endswith(" m") for label in labels)
    assert {"a", "b <x>"} <= set(labels)
    assert mass.get_xlim() == (-100.0, 100.0)
    assert mass.get_ylim() == (-50.0, 150.0)
