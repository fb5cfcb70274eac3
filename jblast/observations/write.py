"""The writer of observation files: what `read` reads, to the last digit."""

import math
import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from jaxtyping import Float

from jblast.files import write_text
from jblast.observations.records.csv_fields import plain_text, quoted
from jblast.observations.records.side_file import write_covariances
from jblast.observations.rows import AT_LEAST
from jblast.observations.table import (
    CLOCK_TIMES,
    COLUMNS,
    DEGREES,
    NEEDED,
    POSITION,
    SAMPLES,
    Observations,
)
from jblast.observations.times.instant import written


def write(
    path: str | os.PathLike[str],
    observations: Observations,
    *,
    comments: Sequence[str] = (),
) -> None:
    """Write observations as tidy CSV; columns nobody fills are left out.

    Covariances go into the side file, `LOG.covariance.csv` beside `LOG.csv`; an old one
    is taken away, so that what is read back is what was written. Files of samples are
    named by their path from there.

    Args:
        path: The file, replaced if it exists.
        observations: What to write.
        comments: Provenance, written before what `observations.comments` holds.

    Raises:
        ValueError: There are no rows, or a name or comment would not read back: it has
            line breaks, control characters or outer spaces.
    """
    observations = _with_samples_from(Path(path).parent, observations)
    write_text(path, log_text(observations, comments))
    write_covariances(path, observations)


def log_text(observations: Observations, comments: Sequence[str] = ()) -> str:
    """Return what `write` writes into the file, and raise as it does."""
    if not len(observations):
        raise ValueError("observations has no rows; an empty file would not read back")
    lines = [
        f"# {plain_text(line)}".rstrip() for line in (*comments, *observations.comments)
    ]
    columns = _columns(observations)
    lines.append(",".join(columns))
    lines.extend(",".join(row) for row in zip(*columns.values(), strict=True))
    return "\n".join(lines) + "\n"


def _with_samples_from(folder: Path, observations: Observations) -> Observations:
    """Return a log whose files of samples are found from another folder."""
    beside = Path(observations.source).parent
    if SAMPLES not in observations.quantity or beside.resolve() == folder.resolve():
        return observations
    records = tuple(
        Path(os.path.relpath(beside / name, folder)).as_posix()
        if quantity == SAMPLES and not Path(name).is_absolute()
        else name
        for quantity, name in zip(
            observations.quantity, observations.records(), strict=True
        )
    )
    return replace(observations, record=records)


def _columns(observations: Observations) -> dict[str, list[str]]:
    """Return the text of every column that holds something."""
    texts = {
        name: [_digits(x) for x in column]
        if isinstance(column, np.ndarray)
        else [quoted(x) for x in column]
        for name, column in typed_columns(observations).items()
    }
    bounds = observations.bounds()
    texts["value"] = [
        (AT_LEAST if is_bound else "") + text
        for is_bound, text in zip(bounds, texts["value"], strict=True)
    ]
    return texts


def typed_columns(
    observations: Observations,
) -> dict[str, Float[np.ndarray, " row"] | tuple[str, ...]]:
    """Return every column that is needed or holds something, in the order of a file.

    Positions and clock times are degrees and UTC where the log says where on the Earth
    it counts from, and from when; a value is NaN beside a `value_utc`.
    """
    place, names = observations.position, POSITION
    if observations.frame is not None:
        place, names = observations.frame.to_geodetic(place), DEGREES
    columns = {
        "sensor": observations.sensor,
        "quantity": observations.quantity,
        "value": observations.value,
        "sigma": observations.sigma,
        **dict(zip(names, place.T, strict=True)),
        "range_m": observations.slant_range,
        "time_s": observations.time,
        "path": observations.path,
        "shot": observations.shot,
        "clock": observations.clock,
        "record": observations.records(),
    }
    if observations.epoch is not None:
        timed_rows = np.isin(observations.quantity, CLOCK_TIMES)
        columns["value_utc"] = tuple(
            written(observations.epoch, value) if timed else ""
            for timed, value in zip(
                timed_rows, observations.value.tolist(), strict=True
            )
        )
        columns["value"] = np.where(timed_rows, np.nan, observations.value)
    return {c: columns[c] for c in COLUMNS if c in NEEDED or _holds(columns.get(c, ()))}


def _holds(column: Float[np.ndarray, " row"] | tuple[str, ...]) -> bool:
    """Return whether a column holds anything."""
    if isinstance(column, np.ndarray):
        return not np.isnan(column).all()
    return any(column)


def _digits(number: float) -> str:
    return "" if math.isnan(number) else repr(float(number))
