import math

import numpy as np
import pytest

from jblast.scene import Charge, Scene
from jblast.sensors.calculator import BEYOND, Calculated, Question, disagreements

QUANTITY = "peak_overpressure_pa"


def said(**values):
    """Two laws of one quantity at 2 rows, by name: values and where they hold."""
    return {
        QUANTITY: {
            name: Calculated(np.array(value), np.array(valid), "", True)
            for name, (value, valid) in values.items()
        }
    }


@pytest.fixture
def question():
    scene = Scene(charge=Charge(burst="surface"))
    return Question(scene, slant_range=(10.0, 30.0), charge_mass=(1.0,))


# each 10 % a shot and 10 % a record, declared: 0.2 for the difference
LIMIT = math.exp(BEYOND * 0.2)


def test_laws_within_their_scatter_agree(question):
    near = ([1e4, 1e3 * 0.99 * LIMIT], [True, True])
    answer = said(kingery_bulmash=([1e4, 1e3], [True, True]), swisdak=near)
    assert disagreements(question, answer) == []


def test_laws_beyond_their_scatter_are_told_with_the_one_to_take(question):
    far = ([1e4, 1e3 * 1.01 * LIMIT], [True, True])
    answer = said(kingery_bulmash=([1e4, 1e3], [True, True]), swisdak=far)
    (found,) = disagreements(question, answer)
    assert (found.low, found.high) == ("kingery_bulmash", "swisdak")
    assert found.ratio == pytest.approx(1.01 * LIMIT)
    assert found.expected == pytest.approx(LIMIT)
    assert (found.range_m, found.mass_kg, found.rows) == (30.0, 1.0, 1)
    assert found.choice is not None
    assert found.choice.method == "kingery_bulmash"
    (reference,) = (one for one in found.choice.candidates if one.is_reference)
    assert reference.method == found.choice.method


def test_a_law_outside_its_range_contradicts_nothing(question):
    far = ([1e4, 1e5], [True, False])
    answer = said(kingery_bulmash=([1e4, 1e3], [True, True]), swisdak=far)
    assert disagreements(question, answer) == []
