"""Every note has a sentence, which names the numbers that the note has."""

import ast
from functools import cache
from pathlib import Path
from string import Formatter
from typing import get_args

import numpy as np
import pytest

import jblast
from jblast.inference.fitting.wrong import ExchangedSensors, WrongClock, WrongSensor
from jblast.observations.check import doubt
from jblast.report.check import row_sentence
from jblast.report.messages import MAX_NAMED, MESSAGES, alarm, sentence, sentence_of
from jblast.results import problem, warning
from jblast.signals.picks.pick import NOTES, NoteKind

MAKERS = ("problem", "warning", "assumption", "conversion", "doubt")
PACKAGE = Path(jblast.__file__).parent
LOG = jblast.read(PACKAGE.parent / "calibration" / "data" / "five_microphones.csv")
OF_ROWS = {"n_rows", "sensor", "other_sensor", "sensors", "quantity", "value"}
OF_ROWS |= {"other_value", "reading", "place", "largest"}
"""Facts of a doubted row, which its log has."""


@cache
def made():
    """Return the kinds that the package makes, each with the names of its numbers."""
    found = {}
    for path in sorted(PACKAGE.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if not isinstance(node, ast.Call) or not node.args:
                continue
            kind = node.args[0]
            name = getattr(node.func, "id", "")
            if name in (*MAKERS, "sentence") and isinstance(kind, ast.Constant):
                names = {word.arg for word in node.keywords}
                # fields of an object are not known without running it
                names |= {None} if node.args[1:] else set()
                names |= OF_ROWS if name == "doubt" or path.stem == "sanity" else set()
                found.setdefault(kind.value, set()).update(names)
    return found


def named(kind):
    """Return the fields of a sentence, each with its format."""
    parts = Formatter().parse(MESSAGES[kind])
    return {name: form for _, name, form, _ in parts if name}


@pytest.mark.parametrize("kind", MESSAGES)
def test_a_sentence_names_numbers_only_that_its_note_has(kind):
    names = made().get(kind, {None})
    # numbers in a mapping are not known without running it
    assert named(kind).keys() <= names or None in names
    assert not MESSAGES[kind].endswith(".")


def test_every_note_has_a_sentence():
    kinds = {*made(), *get_args(NoteKind)}
    reasons = {k for k, row in NOTES.items() if row.withheld and row.quality != "poor"}
    reasons |= {"poor", "uncalibrated", "weaker"}
    kinds |= {f"no_row.{reason}" for reason in reasons}
    assert len(kinds) > 90
    assert {kind for kind in kinds if "{" not in kind} <= MESSAGES.keys()


@pytest.mark.parametrize("size", [1e-300, 1.0, 1e300])
def test_doubts_of_numbers_of_any_size_are_printed(size):
    for kind in MESSAGES:
        numbers = {name: size for name in named(kind) if name not in OF_ROWS}
        # names of places, times and units are text
        texts = {"unit", "when", "shot", "clock", "one", "other"}
        numbers |= {name: "a thousandth of" for name in texts & numbers.keys()}
        if kind in {
            "sensor_copied",
            "unit_slip",
            "off_in_time",
            "too_slow",
            "too_fast",
        }:
            assert row_sentence(doubt(kind, (5, 6), **numbers), LOG)


def test_numbers_are_printed_with_units_and_lists_are_short():
    far = {"range_m": 20e3, "error_m": 0.031, "sigmas": 2.345}
    note = warning("flat_ground", sensor="hut", quantity="air_arrival_s", **far)
    assert "hut, 20 km away" in sentence_of(note)
    assert "31 mm, 2.3 sigma" in sentence_of(note)
    names = tuple("abcdefgh")
    speeds = {"speed_m_s": 320.4, "sound_m_s": 340.2}
    assert "arrivals at a, b, c, d, e and 3 more imply" in sentence_of(
        warning("slower_than_sound", sensors=names, **speeds)
    )
    assert MAX_NAMED == 5
    rest = (2.5, 3, 0.4, 4, {})
    wrong = (
        WrongClock("gate", *rest, -0.8, 0.01, None),
        WrongSensor("gate", *rest),
        ExchangedSensors("e", *rest, "f"),
    )
    assert sentence_of(problem("wrong_sensor", wrong=wrong)).startswith(
        "wrong sensor or clock (the clock gate or the sensor gate or the order of e "
        "and f): do not"
    )


@pytest.mark.parametrize(
    ("template", "numbers", "text"),
    [
        ("{n:row} of {of}", {"n": 1, "of": 3}, "1 row of 3"),
        ("{n:row}", {"n": 12_345}, "12,345 rows"),
        ("{apart_m:3}", {"apart_m": 1234.5}, "1230 m"),
        ("{late_s:late}", {"late_s": -7200.0}, "2 h too early"),
        ("{ratio:ratio}", {"ratio": 0.25}, "1/4.0 of"),
        ("reads{distance_m:at}", {"distance_m": None}, "reads"),
        ("reads{distance_m:at}", {"distance_m": 20.0}, "reads at 20 m"),
        ("a blast{share:of_flights}", {"share": 1.0}, "a blast"),
        (
            "a blast{share:of_flights}",
            {"share": 0.25},
            "a blast of 25 % of the flights",
        ),
    ],
)
def test_forms_of_a_template(template, numbers, text):
    assert sentence(template, numbers) == text


def test_fields_are_those_of_an_object_and_given_ones_come_first():
    assert sentence("{value:3} {sigma}", LOG, value=0.5, sigma=np.nan) == "0.5 nan"
    assert sentence("{names:names}", warning("x"), names=["a", "b"]) == "a and b"


def test_the_name_of_a_problem_is_in_capitals():
    found = problem("poor_fit", chi2=41.0, dof=4, p_value=2.7e-8)
    assert alarm(found).startswith(
        "POOR FIT (p < 0.001): the recordings disagree with the law"
    )
