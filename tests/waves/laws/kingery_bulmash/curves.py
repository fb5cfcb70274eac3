"""Curves of Kingery and Bulmash, and tables as they are printed."""

import csv
from pathlib import Path

from jblast.waves.laws import kingery_bulmash as kb

LAWS = {
    "incident_pressure": kb.kingery_bulmash_pressure,
    "reflected_pressure": kb.kingery_bulmash_reflected_pressure,
    "incident_impulse": kb.kingery_bulmash_impulse,
    "reflected_impulse": kb.kingery_bulmash_reflected_impulse,
    "positive_phase_duration": kb.kingery_bulmash_duration,
    "arrival_time": kb.kingery_bulmash_arrival_time,
    "shock_front_velocity": kb.kingery_bulmash_shock_speed,
}
TRANSCRIBED_AGAIN = Path(__file__).parents[3] / "data"


def rows(path):
    """Return the rows of a table without the comments above it."""
    lines = (x for x in path.read_text().splitlines() if not x.startswith("#"))
    return list(csv.DictReader(lines))
