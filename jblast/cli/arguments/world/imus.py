"""What a world's inertial measurement units write: a table for each."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from jblast.cli.arguments.paths import save_text
from jblast.report.words import comma_separated, commented
from jblast.world import ImuRecord

COLUMNS = (
    "time_s",
    *(f"a{axis}_m_s2" for axis in "xyz"),
    *(f"g{axis}_rad_s" for axis in "xyz"),
)
STRAIGHT = (
    "between the rows of the flight, {row:g} s apart, its samples are straight lines"
)


def write_imus(
    records: Sequence[ImuRecord], directory: Path, head: Sequence[str]
) -> tuple[dict[str, Any] | None, list[str]]:
    """Write the samples of every unit, and return what JSON tells, and warnings.

    Args:
        records: What they wrote.
        directory: Of the world.
        head: Comments above each table.
    """
    entries: dict[str, Any] = {}
    notes = []
    for record in records:
        name, rate = record.sensor.name, record.imu.rate
        file = "imu.csv" if len(records) == 1 else f"imu_{name}.csv"
        rows = np.column_stack(
            [record.stamps_s, record.samples.force, record.samples.rate]
        )
        comments = [
            *head,
            f"{name}: {rate:g} Hz, each row the mean from its stamp on, by its own "
            "clock; specific force and body rates along its own axes",
        ]
        text = [COLUMNS, *([f"{x:.9g}" for x in row] for row in rows.tolist())]
        save_text(commented(comments) + comma_separated(text), directory / file)
        entries[name] = {
            "file": file,
            "rate_hz": rate,
            "samples": len(rows),
            "clipped": record.clipped,
        }
        if record.row_s > 1.5 / rate:
            notes.append(f"{name}: {STRAIGHT.format(row=record.row_s)}")
    return entries or None, notes


def clear_imus(directory: Path) -> None:
    """Remove what an earlier run wrote, which would mislead."""
    for file in directory.glob("imu*.csv"):
        file.unlink()
