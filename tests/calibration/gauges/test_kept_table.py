"""The kept table of gauges is what its script prints."""

from pathlib import Path

KEPT = Path(__file__).parents[3] / "calibration" / "results" / "gauges.txt"


def test_the_kept_table_is_what_the_script_prints(text):
    assert KEPT.read_text(encoding="utf-8") == text + "\n"
