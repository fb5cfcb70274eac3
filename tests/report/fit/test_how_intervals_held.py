"""What an answer says of its intervals is what the kept table says."""

from dataclasses import replace
from pathlib import Path

import pytest

import jblast
from jblast.inference.fitting.findings import AsAsked
from jblast.inference.importance import ImportanceCannotTell
from jblast.report import summary
from jblast.report.fit.terminal import HELD
from tests.report import example

TABLE = Path(jblast.__path__[0]).parent / "calibration/results/coverage_default.txt"


def test_the_share_that_an_answer_prints_is_that_of_the_kept_table():
    rows = {
        line.split()[0]: [float(x) for x in line.split()[1:]]
        for line in TABLE.read_text(encoding="utf-8").splitlines()
        if line.startswith(("weighted   ", "laplace"))
    }
    for weighted, (least, most) in HELD.items():
        shares = rows["weighted" if weighted else "laplace"]
        assert len(shares) == 4
        # in whole per cent, towards what is not flattering
        assert 0 <= 100 * min(shares) - least < 1
        assert 0 <= 100 * max(shares) - most < 1


def said_of(fit):
    return " ".join(summary(fit).partition("Estimates")[0].split())


def test_the_share_names_the_logs_it_was_counted_in():
    plain = example.three_parameters()
    said = said_of(replace(plain, weighted=True))
    assert "weighted by the posterior: in 400 simulated logs of seven mic" in said
    assert "four unknowns, they held the truth in 86 to 89 of 100" in said
    said = said_of(replace(plain, posterior_reason=AsAsked()))
    assert "alone: in 400 simulated logs" in said
    assert "85 to 88 of 100" in said


@pytest.mark.parametrize(
    "changes",
    [
        {"chi2": 90.0},  # poor
        {"law_valid": False, "law_valid_rows": 0},
        {"identifiable": False},
        {},  # fell back
    ],
)
def test_no_share_stands_beside_an_answer_that_those_logs_were_not_like(changes):
    plain = example.three_parameters()
    fit = replace(
        plain,
        summary=replace(plain.summary, **changes),
        weighted=bool(changes),
        posterior_reason=ImportanceCannotTell(0.90),
    )
    said = said_of(fit)
    assert "90 % intervals by a normal approximation" in said
    assert "of 100" not in said
