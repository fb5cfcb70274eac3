import re
from pathlib import Path

from jblast.report.discovery import COVERAGE

TABLE = Path(__file__).parents[3] / "calibration" / "results" / "discovery.txt"


def test_the_intervals_told_to_hold_the_truth_are_those_of_the_kept_table():
    first = TABLE.read_text("utf-8").split("\n\n")[0].splitlines()
    head, *rows = (re.split(r"\s{2,}", line) for line in first)
    noise, held = head.index("noise"), head.index("in 90 %")
    shares = [
        float(row[held]) for row in rows if row[noise] != "0 %" and row[held] != "-"
    ]
    assert (min(shares), max(shares)) == COVERAGE
