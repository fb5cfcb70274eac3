"""What cannot be heard is refused by name."""

import numpy as np
import pytest

from jblast.errors import InputError
from jblast.scene import Charge, Scene
from jblast.sensors import heard, overpressure, record_laws
from jblast.sensors.wave_paths import DEFAULT_RECORD_LAWS

SCENE = Scene(Charge(mass_kg=15.0))
PLACE = [20.0, 0.0, 1.5]


def test_laws_are_those_told_else_the_scenes_else_one_picture():
    scene = Scene(law=(("air_arrival_s", "wu_hao"), ("positive_duration_s", "auto")))
    told = {"peak_overpressure_pa": "swisdak", "flash_time_s": "light"}
    assert record_laws(scene, told) == {
        **DEFAULT_RECORD_LAWS,
        "air_arrival_s": "wu_hao",
        "peak_overpressure_pa": "swisdak",
    }


def test_a_law_that_is_none_is_refused():
    with pytest.raises(InputError, match="peak_overpressure_pa: expected one of"):
        heard(SCENE, PLACE, {"peak_overpressure_pa": "sadovski"})


@pytest.mark.parametrize(
    "place", [[0.0, 0.0, 0.0], [np.nan, 0.0, 0.0], [np.inf, 0.0, 0.0]]
)
def test_a_place_at_the_charge_or_nowhere_is_refused(place):
    with pytest.raises(InputError, match="expected a position away from it"):
        heard(SCENE, place)


def test_laws_that_make_no_pulse_are_refused():
    """The impulse on the ground is 1.2 times the free-air peak times its duration."""
    near = Scene(Charge(mass_kg=1.0, burst="free-air"))
    laws = {"positive_impulse_pa_s": "ford_2021"}
    with pytest.raises(InputError, match="expected laws whose impulse"):
        heard(near, [0.3, 0.0, 0.0], laws)


@pytest.mark.parametrize("place", [[], [1.0, 2.0], [1.0, 2.0, 3.0, 4.0]])
def test_a_place_has_three_numbers(place):
    with pytest.raises(InputError, match="place: expected east, north and up"):
        overpressure(SCENE, place, np.arange(3.0))


@pytest.mark.parametrize(
    "edges", [[], [0.1], [0.2, 0.1], [0.1, 0.1], [0.0, np.nan, 1.0]]
)
def test_edges_rise(edges):
    with pytest.raises(InputError, match="edges: expected"):
        overpressure(SCENE, PLACE, np.asarray(edges))
