"""What `jblast listen` says on a terminal: a line a sensor."""

from collections.abc import Sequence

import numpy as np

from jblast.report.listen.document import warnings_of
from jblast.report.listen.track import Track
from jblast.report.numbers import printed_number
from jblast.report.tables import aligned
from jblast.sensors.listening.plan import Listening

MOST_LINES = 20
"""Sensors that are told one by one; all of them stand in truth.csv."""
TOLD = ("ground_arrival_s", "air_arrival_s", "peak_overpressure_pa")


def listening_text(
    listening: Listening, tracks: Sequence[Track], notes: Sequence[str] = ()
) -> str:
    """Return the records as a table, and what to know of them.

    Args:
        listening: What was to be recorded.
        tracks: What was.
        notes: What else there is to know.
    """
    rows = [["sensor", "kind", "file", "ground", "air", "peak"]]
    for number, track in enumerate(tracks[:MOST_LINES]):
        values = {name: row[number] for name, row in listening.truth.values.items()}
        shot = int(np.nan_to_num(values["air_arrival_s"], nan=np.inf).argmin())
        told = [_number(name, values[name][shot]) for name in TOLD]
        rows.append([track.sensor.name, track.sensor.kind, track.file, *told])
    lines = aligned(rows, right=(3, 4, 5))
    if len(tracks) > MOST_LINES:
        lines.append(f"and {len(tracks) - MOST_LINES} more, in truth.csv")
    lines.append(f"{listening.seconds:g} s each, from 0 on the sensor's own clock")
    if len(listening.truth.shots) > 1:
        lines.append("arrivals and peak of the first blast that comes")
    told = (*notes, *listening.notes, *warnings_of(listening, tracks))
    lines += [f"Note: {note.removeprefix('note: ')}" for note in told]
    return "\n".join(lines) + "\n"


def _number(name: str, value: float) -> str:
    return printed_number(name, value) if np.isfinite(value) else "never"
