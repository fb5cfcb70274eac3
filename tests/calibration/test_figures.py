"""The script that holds figures of pages against kept files: what it notices."""

import pytest

from calibration import figures

KEPT = """cpu
  fits/s    1,265,793   (407 times)
gpu
  fits/s   81,804,150
  shot  +0.170
"""


@pytest.fixture
def told(tmp_path, monkeypatch):
    """Give what is said of words of a page, with a file of its own."""
    monkeypatch.setattr(figures, "ROOT", tmp_path)
    (tmp_path / "kept.txt").write_text(KEPT)

    def fault(page, words, row="fits/s", column="1", **changed):
        (tmp_path / "page.md").write_text(page)
        entry = {"page": "page.md", "words": words, "file": "kept.txt", "under": ""}
        entry |= {"row": row, "column": column, "times": "", "form": ""}
        return figures.fault_of(entry | changed)

    return fault


@pytest.mark.parametrize("number", ["1.3e6", "1.27e6", "1,265,793", "1,300,000"])
def test_a_number_rounded_as_printed_is_right(told, number):
    assert told(f"it makes {number} a\nsecond", f"makes {{{number}}} a second") == ""


@pytest.mark.parametrize("number", ["1.2e6", "1.26e6", "1,265,794", "1,200,000", "2e6"])
def test_a_number_that_is_not_the_kept_one_is_told_with_both(told, number):
    said = told(f"it makes {number} a second", f"makes {{{number}}} a second")
    assert number in said
    assert "kept.txt has 1.26579e+06" in said


def test_the_row_is_looked_for_below_its_heading(told):
    assert told("8.2e7 there", "{8.2e7} there", under="gpu") == ""
    assert "no line with 'tpu'" in told("8.2e7 there", "{8.2e7} there", under="tpu")


def test_a_number_may_be_kept_as_its_logarithm(told):
    how = {"row": "shot", "times": "209.02", "form": "exp"}
    assert told("248 kg", "{248} kg", **how) == ""  # 209.02 e^0.170 = 247.75
    assert "has 247.752" in told("247 kg", "{247} kg", **how)


def test_words_that_no_longer_stand_on_the_page_and_rows_that_are_gone_are_told(told):
    assert "does not say '1.3e6 a day'" in told("1.3e6 a second", "{1.3e6} a day")
    assert "no line with 'walks/s'" in told("1.3e6", "{1.3e6}", row="walks/s")
    assert "has 2 numbers, not 3" in told("1.3e6", "{1.3e6}", column="3")
