"""Scaled distances in words are told in feet and pounds to who asks for them."""

import re

import pytest

import jblast.waves  # noqa: F401  laws enter the registry as they are imported
from jblast.registry import LAWS
from jblast.report.calculator.terminal import scaled_in


@pytest.mark.parametrize(
    ("ours", "theirs"),
    [
        # 1 m/kg^(1/3) = 0.45359237^(1/3) / 0.3048 = 2.52083 ft/lb^(1/3)
        (
            "Z = 0.0674 (free-air 0.0531) to 40 m/kg^(1/3); ideal gas",
            "Z = 0.1699 (free-air 0.1339) to 100.8 ft/lb^(1/3); ideal gas",
        ),
        (
            "h = -0.2 to 1 m/kg^(1/3)",
            "h = -0.5042 to 2.521 ft/lb^(1/3)",
        ),
        (
            "r = 16 to 4000 m/kt^(1/3), Y",
            "r = 52.49 to 13120 ft/kt^(1/3), Y",
        ),
        # sqrt(0.45359237) / 0.3048 = 2.20963
        ("R <= 14.8 sqrt(Q) m (faster)", "R <= 32.7 sqrt(Q in lb) ft (faster)"),
        ("where both of its arrivals hold", "where both of its arrivals hold"),
    ],
)
def test_numbers_before_a_scaled_distance_are_converted_alone(ours, theirs):
    assert scaled_in(ours, "us") == theirs
    assert scaled_in(ours, "si") == ours


def test_no_range_of_a_law_keeps_a_scaled_distance_of_ours():
    for law in LAWS.values():
        told = scaled_in(law.range, "us")
        assert not re.search(r"m/k[gt]|[Q)] m\b", told), told
