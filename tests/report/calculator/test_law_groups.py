"""Laws that say the same are one line, named together; what holds nowhere is grey."""

from typing import Any

import numpy as np

from jblast.report.calculator.figures import (
    group_words,
    groups,
    holding,
    leader_colours,
    outside_entry,
)
from jblast.sensors.calculator import Calculated


def said(value, valid: Any = True):
    value = np.asarray(value, float)
    return Calculated(value, np.broadcast_to(valid, value.shape), "", two_sets=False)


def test_laws_within_two_percent_wherever_both_hold_are_one_group():
    laws = {
        "first": said([100.0, 50.0]),
        "same": said([101.0, 49.5]),
        "elsewhere": said([100.0, 500.0], np.array([True, False])),
        "apart": said([100.0, 52.0]),
        "alone": said([1.0, 1.0], valid=False),
    }
    assert groups(laws, list(laws)) == [
        ["first", "same", "elsewhere"],
        ["apart"],
        ["alone"],
    ]


def test_what_holds_most_comes_behind_the_first():
    laws = {
        "some": said([1.0, 1.0], np.array([True, False])),
        "all": said([1.0, 1.0]),
        "none": said([1.0, 1.0], valid=False),
    }
    assert holding(laws) == ["all", "some"]
    assert holding(laws, "some") == ["some", "all"]


def test_a_leader_has_one_colour_in_all_panels_and_leaders_differ():
    panels = [[["a", "b"], ["c"]], [["c", "a"], ["d"]]]
    colours = leader_colours(panels)
    assert list(colours) == ["a", "c", "d"]
    assert len(set(colours.values())) == 3
    many = leader_colours([[[f"law_{i}"] for i in range(20)]])
    assert len(set(many.values())) == 20


def test_a_key_names_who_coincides_and_who_holds_nowhere():
    assert group_words(["a"]) == "a"
    words = group_words(["a", "b", "c"])
    assert words.replace("\xa0", " ") == "a\n  = b, c (within 2 %)"
    none = {"x": said([1.0], valid=False)}
    entry = outside_entry(none)
    assert entry is not None
    assert entry.get_label() == "outside its range: x"
    assert outside_entry({"y": said([1.0])}) is None
