"""The package and its pages avoid the words that the vocabulary lists."""

import pytest

from tests.tools.vocabulary import DEFAULT, found_in, summaries_in, words_in


def test_the_package_and_its_pages_have_no_avoided_word():
    assert [str(place) for place in found_in(list(DEFAULT))] == []


@pytest.mark.parametrize(
    "text",
    [
        "the data told nothing",
        "a draw asked for",
        "970 draws' worth",
        "searched anew",
        "seldomer than once",
        "expected a number, got others",
    ],
)
def test_an_avoided_word_is_found(text):
    assert len(list(words_in(f"first\n{text}\n", "a.py"))) == 1


def test_a_summary_that_is_a_clause_is_found_and_a_noun_phrase_is_not():
    module = '"""{}"""\n\n\ndef f():\n    """{}"""\n'
    clause, noun = "What was requested.", "Requested outputs."
    assert list(summaries_in(module.format(noun, noun), "a.py")) == []
    assert [place.line for place in summaries_in(module.format(noun, clause), "")] == [
        4
    ]


def test_plain_words_are_not_found():
    assert list(words_in("a task, reported: 4 of 5 intervals contain it", "")) == []
