"""Why a method was chosen, in words."""

import pytest

from jblast.report.choice import percent


@pytest.mark.parametrize(
    ("error", "words"),
    [(0.0031, "0.31 %"), (0.24, "24 %"), (2.2, "a factor of 3.2")],
)
def test_errors_are_told_in_per_cent_or_as_factors(error, words):
    assert percent(error) == words
    assert percent(float("nan")) == "an unknown amount"
