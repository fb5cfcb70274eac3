"""Why a method was chosen, in words."""

from dataclasses import replace

import pytest

from jblast.fidelity import Candidate, TakenLaw
from jblast.report.choice import choice_reason, law_reason, percent, reason_for
from tests.report.made_up import chosen

CHOICE = chosen("air_arrival_s", "kingery_bulmash")
LAW = TakenLaw("kingery_bulmash", CHOICE)
BOTH = ("surface", "free-air")


def test_the_reason_of_a_law_is_that_at_the_answer():
    assert law_reason(LAW) == choice_reason(CHOICE)
    assert law_reason(LAW).startswith("Z = 2.1 to 38 m/kg^(1/3) inside")
    before = law_reason(replace(LAW, name="wu_hao"))
    assert "at the answer it would be kingery_bulmash: Z = 2.1 to 38" in before
    assert law_reason(TakenLaw("wu_hao")) == "requested"


def test_a_cheaper_method_that_is_off_is_named_with_its_error():
    cheap = Candidate("acoustic", 0.24, 0.24, 1e-10, valid=True, is_reference=False)
    both = replace(CHOICE, candidates=(cheap, *CHOICE.candidates))
    assert "error of acoustic up to 24 %" in reason_for(both)


def test_what_heights_leave_is_told_last():
    high = replace(CHOICE, by_height=("free-air",), notes=("it stood on the ground",))
    *_, left, note = reason_for(high).split("; ")
    assert left == "free-air curves, by the height of burst"
    assert note == "it stood on the ground"
    assert "for both sets" in reason_for(replace(CHOICE, by_height=BOTH))


@pytest.mark.parametrize(
    ("error", "words"),
    [(0.0031, "0.31 %"), (0.24, "24 %"), (2.2, "a factor of 3.2")],
)
def test_errors_are_told_in_per_cent_or_as_factors(error, words):
    assert percent(error) == words
    assert percent(float("nan")) == "an unknown amount"
