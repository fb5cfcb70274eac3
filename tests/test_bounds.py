import math

import numpy as np
import pytest

from jblast.errors import InputError
from jblast.parameters import UNBOUNDED, Bounds


@pytest.mark.parametrize(
    ("bounds", "words", "within", "beyond"),
    [
        (Bounds(above=0.0), "positive", [1e-300, math.inf], [0.0, -1.0, math.nan]),
        (Bounds(above=1.0), "above 1", [1.1], [1.0]),
        (Bounds(at_least=0.0), "not negative", [0.0], [-1e-9]),
        (Bounds(at_least=1.0), "at least 1", [1.0], [0.9]),
        (Bounds(at_least=-5.0, at_most=5.0), "between -5 and 5", [-5.0, 5.0], [5.1]),
    ],
)
def test_bounds_allow_what_their_words_say(bounds, words, within, beyond):
    assert bounds.words() == words
    assert all(bounds.allows(value) for value in within)
    assert not any(bounds.allows(value) for value in beyond)


def test_of_an_array_bounds_say_where():
    allowed = Bounds(above=0.0).allows(np.array([1.0, 0.0, math.nan]))
    np.testing.assert_array_equal(allowed, [True, False, False])


def test_a_value_that_fits_in_another_unit_is_named_with_its_size():
    others = ("pressure", "hPa", "bar")
    bounds = Bounds(at_least=2e4, at_most=1.2e5, other_units=others)
    assert bounds.hint(1013.0) == "; 1013 hPa is 101300"
    assert bounds.hint(0.9) == "; 0.9 bar is 90000"
    assert bounds.hint(19.0) == bounds.hint(math.nan) == ""
    assert UNBOUNDED.hint(1013.0) == ""
    assert Bounds(at_most=1.0, advice="swapped?").hint(2.0) == "; swapped?"


def test_a_checked_value_is_returned_or_refused_as_it_is_written():
    bounds = Bounds(above=0.0, at_most=1.0)
    assert bounds.checked(0.5, "here") == 0.5
    said = "here: expected a share that is above 0 and at most 1, got '2'"
    with pytest.raises(InputError, match=said):
        bounds.checked(2.0, "here", "a share", "2")
