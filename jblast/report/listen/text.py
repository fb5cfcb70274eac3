"""What `jblast listen` says on a terminal: a line a sensor."""

from collections.abc import Sequence

import numpy as np

from jblast.report.listen.document import warnings_of
from jblast.report.listen.sensor_record import SensorRecord
from jblast.report.numbers import printed_number
from jblast.report.tables import aligned
from jblast.sensors.listening.plan import Listening

MOST_LINES = 20
"""Sensors that are told one by one; all of them stand in truth.csv."""
TOLD = ("ground_arrival_s", "air_arrival_s", "peak_overpressure_pa")


def listening_text(
    listening: Listening, records: Sequence[SensorRecord], notes: Sequence[str] = ()
) -> str:
    """Return the records as a table, and what to know of them.

    Args:
        listening: What was to be recorded.
        records: What was.
        notes: What else there is to know.
    """
    rows = [["sensor", "kind", "file", "ground", "air", "peak"]]
    for number, record in enumerate(records[:MOST_LINES]):
        values = {name: row[number] for name, row in listening.truth.values.items()}
        shot = int(np.nan_to_num(values["air_arrival_s"], nan=np.inf).argmin())
        numbers = [_number(name, values[name][shot]) for name in TOLD]
        rows.append([record.sensor.name, record.sensor.kind, record.file, *numbers])
    lines = aligned(rows, right=(3, 4, 5))
    if len(records) > MOST_LINES:
        lines.append(f"and {len(records) - MOST_LINES} more, in truth.csv")
    lines.append(f"{listening.seconds:g} s each, from 0 on the sensor's own clock")
    if len(listening.truth.shots) > 1:
        lines.append("arrivals and peak of the first blast that comes")
    notes = (*notes, *listening.notes, *warnings_of(listening, records))
    lines += [f"Note: {note.removeprefix('note: ')}" for note in notes]
    return "\n".join(lines) + "\n"


def _number(name: str, value: float) -> str:
    return printed_number(name, value) if np.isfinite(value) else "never"
