"""Kept pages are what their scripts write; figures of pages are those of kept files."""

import re

import numpy as np
import pytest

from calibration import figures
from calibration.laws import RESULTS, SCALED_DISTANCE, laws_text, panels

KEPT = """cpu
  fits/s    1,265,793   (407 times)
gpu
  fits/s   81,804,150
  shot  +0.170
"""


def test_the_page_of_laws_is_what_the_registry_gives():
    """Write it again with `python -m calibration.laws`."""
    assert (RESULTS / "laws.md").read_text("utf-8") == laws_text()


def test_the_manual_states_how_far_the_laws_lie_apart():
    between = (SCALED_DISTANCE >= 2.0) & (SCALED_DISTANCE <= 40.0)
    found = []
    for quantity in ("peak_overpressure_pa", "air_arrival_s"):
        laws = panels(quantity)["free-air"]
        against = laws["shock_kinematics"].value
        ratio = np.concatenate(
            [(law.value / against)[law.valid & between] for law in laws.values()]
        )
        found += [abs(round(100 * (r - 1))) for r in (ratio.min(), ratio.max())]
    page = (RESULTS.parents[1] / "docs/explanation/laws.md").read_text("utf-8")
    (stated,) = re.findall(
        r"peak pressures lie from (\d+) % below to (\d+) % above those of "
        r"`shock_kinematics`, the arrivals from (\d+) % below to (\d+) % above",
        " ".join(page.split()),
    )
    assert [int(n) for n in stated] == found


@pytest.fixture
def fault(tmp_path, monkeypatch):
    """Return the check of words of a page against a kept file of its own."""
    monkeypatch.setattr(figures, "ROOT", tmp_path)
    (tmp_path / "kept.txt").write_text(KEPT)

    def of(page, words, row="fits/s", **changed):
        (tmp_path / "page.md").write_text(page)
        entry = {"page": "page.md", "words": words, "file": "kept.txt", "under": ""}
        entry |= {"row": row, "column": "1", "times": "", "form": ""}
        return figures.fault_of(entry | changed)

    return of


@pytest.mark.parametrize("number", ["1.3e6", "1.27e6", "1,265,793", "1,300,000"])
def test_a_number_rounded_as_printed_is_right(fault, number):
    assert fault(f"it makes {number} a\nsecond", f"makes {{{number}}} a second") == ""


@pytest.mark.parametrize("number", ["1.2e6", "1.26e6", "1,265,794", "1,200,000", "2e6"])
def test_another_number_is_reported_with_the_kept_one(fault, number):
    found = fault(f"it makes {number} a second", f"makes {{{number}}} a second")
    assert number in found
    assert "kept.txt has 1.26579e+06" in found


def test_rows_are_found_below_their_heading_and_logarithms_are_undone(fault):
    assert fault("8.2e7 there", "{8.2e7} there", under="gpu") == ""
    how = {"row": "shot", "times": "209.02", "form": "exp"}
    assert fault("248 kg", "{248} kg", **how) == ""  # 209.02 e^0.170 = 247.75
    assert "has 247.752" in fault("247 kg", "{247} kg", **how)


def test_missing_words_rows_and_columns_are_reported(fault):
    assert "does not say '1.3e6 a day'" in fault("1.3e6 a second", "{1.3e6} a day")
    assert "no line with 'tpu'" in fault("8.2e7", "{8.2e7}", under="tpu")
    assert "no line with 'walks/s'" in fault("1.3e6", "{1.3e6}", row="walks/s")
    assert "has 2 numbers, not 3" in fault("1.3e6", "{1.3e6}", column="3")
