"""Numbers that no scene has are refused by name, whichever way they are none."""

import numpy as np
import pytest

from jblast.waves import kingery_bulmash_pressure, swisdak_pressure
from jblast.waves.arguments import ARGUMENTS


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        (np.inf, "slant_range must be finite, got inf m"),
        (np.nan, "slant_range must be a number, got nan m"),
        (0.0, "slant_range must be positive, got 0 m"),
        (-1.0, "slant_range must be positive, got -1 m"),
    ],
)
@pytest.mark.parametrize("law", [kingery_bulmash_pressure, swisdak_pressure])
def test_a_range_that_is_none_is_refused_by_name(law, value, expected):
    with pytest.raises(ValueError, match=f"^{expected}$"):
        law(np.array([10.0, value]), 1.0)


@pytest.mark.parametrize("name", [n for n, one in ARGUMENTS.items() if not one.open])
@pytest.mark.parametrize("value", [np.inf, np.nan])
def test_what_has_to_be_finite_says_so(name, value):
    said = ARGUMENTS[name].fault(np.array([value]))
    assert said.startswith("must be ")
    assert f"got {value:g}" in said
