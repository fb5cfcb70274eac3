"""What a question was answered with, in the reader's units."""

import pytest

from jblast.report import words
from jblast.report.calculator.answer import header
from jblast.scene import Scene
from jblast.sensors.calculator import Question


def test_in_our_units_no_factor_of_others_is_asked_for(monkeypatch):
    # the library of units takes as long to load as the answer to be made

    def asked(suffix):
        raise AssertionError(suffix)

    monkeypatch.setattr(words, "si_factor", asked)
    told = dict(header(Question(Scene(), (20.0,), (15.0,))))
    assert told["scaled distance"] == "8.11 m/kg^(1/3)"
    with pytest.raises(AssertionError):
        header(Question(Scene(), (20.0,), (15.0,), units="us"))


def test_in_american_units_distances_and_temperatures_are_american():
    told = dict(header(Question(Scene(), (20.0,), (15.0,), units="us")))
    # (20 m / 0.3048 m) / (15 kg / 0.45359237 kg)^(1/3) = 20.443
    assert told["scaled distance"] == "20.44 ft/lb^(1/3)"
    assert told["air"].startswith("59.00 °F, 14.7 psi, ")  # 15 °C
