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


NEAR = Scene(Charge(mass_kg=1.0, burst="free-air"))
# the impulse on the ground is 1.2 times the free-air peak times its duration
FORD = {"positive_impulse_pa_s": "ford_2021"}
UNHEARD = {
    "no law": (SCENE, PLACE, {"peak_overpressure_pa": "sadovski"}, "expected one of"),
    "at the charge": (SCENE, [0.0] * 3, None, "expected a position away from it"),
    "nowhere": (SCENE, [np.nan, 0.0, 0.0], None, "expected a position away from it"),
    "no pulse": (NEAR, [0.3, 0.0, 0.0], FORD, "expected laws whose impulse"),
    "two numbers": (SCENE, [1.0, 2.0], None, "place: expected east, north and up"),
}


@pytest.mark.parametrize(
    ("scene", "place", "laws", "said"), UNHEARD.values(), ids=UNHEARD
)
def test_what_cannot_be_heard_is_refused(scene, place, laws, said):
    with pytest.raises(InputError, match=said):
        heard(scene, place, laws)


@pytest.mark.parametrize("edges", [[0.1], [0.1, 0.1], [0.0, np.nan, 1.0]])
def test_edges_rise(edges):
    with pytest.raises(InputError, match="edges: expected"):
        overpressure(SCENE, PLACE, np.asarray(edges))
