"""Every note has a sentence, which names the numbers that the note has."""

import ast
from functools import cache
from pathlib import Path
from string import Formatter

import pytest

import jblast
from jblast.inference.fitting.wrong import ExchangedSensors, WrongClock, WrongSensor
from jblast.report.messages import MAX_NAMED, MESSAGES, alarm, sentence_of
from jblast.results import problem, warning

MAKERS = ("problem", "warning", "assumption")


@cache
def made():
    """Return the kinds that the package makes, each with the names of its numbers."""
    found = {}
    for path in sorted(Path(jblast.__file__).parent.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if not isinstance(node, ast.Call) or not node.args:
                continue
            kind = node.args[0]
            name = getattr(node.func, "id", "")
            if name in MAKERS and isinstance(kind, ast.Constant):
                names = {word.arg for word in node.keywords}
                found.setdefault(kind.value, set()).update(names)
    return found


@pytest.mark.parametrize("kind", MESSAGES)
def test_a_sentence_names_numbers_only_that_its_note_has(kind):
    named = {name for _, name, _, _ in Formatter().parse(MESSAGES[kind]) if name}
    names = made().get(kind, {None})
    # numbers in a mapping are not known without running it
    assert named <= names or None in names
    assert not MESSAGES[kind].endswith(".")


def test_every_note_has_a_sentence():
    assert made().keys() <= MESSAGES.keys()


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


def test_the_name_of_a_problem_is_in_capitals():
    found = problem("poor_fit", chi2=41.0, dof=4, p_value=2.7e-8)
    assert alarm(found).startswith(
        "POOR FIT (p < 0.001): the recordings disagree with the law"
    )
