from pathlib import Path

from jblast.report.discovery import COVERAGE

TABLE = (
    Path(__file__).parents[3] / "calibration" / "results" / "discovery_intervals.txt"
)


def test_the_intervals_told_to_hold_the_truth_are_those_of_the_kept_table():
    rows = TABLE.read_text("utf-8").split("\n\n")[1].splitlines()[1:]
    shares = [float(row.split(" %")[1].split()[1]) for row in rows]
    assert (round(min(shares), 2), round(max(shares), 2)) == COVERAGE
