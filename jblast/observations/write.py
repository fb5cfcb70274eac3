"""The writer of observation files: what `read` reads, to the last digit."""

import math
import os
from collections.abc import Sequence

import numpy as np

from jblast.files import write_text
from jblast.observations.records.covariances import write_covariances
from jblast.observations.rows import AT_LEAST
from jblast.observations.table import (
    CLOCK_TIMES,
    COLUMNS,
    DEGREES,
    NEEDED,
    POSITION,
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
    is taken away, so that what is read back is what was written.

    Args:
        path: The file, replaced if it exists.
        observations: What to write.
        comments: Provenance, written before what `observations.comments` holds.

    Raises:
        ValueError: There are no rows, or a name or comment would not read back: it has
            line breaks, control characters or outer spaces.
    """
    if not len(observations):
        raise ValueError("observations has no rows; an empty file would not read back")
    lines = [
        f"# {_plain(line)}".rstrip() for line in (*comments, *observations.comments)
    ]
    columns = _columns(observations)
    lines.append(",".join(columns))
    lines.extend(",".join(row) for row in zip(*columns.values(), strict=True))
    write_text(path, "\n".join(lines) + "\n")
    write_covariances(path, observations)


def _columns(observations: Observations) -> dict[str, list[str]]:
    """Return the text of every column that holds something."""
    place, columns = observations.position, POSITION
    if observations.frame is not None:
        place, columns = observations.frame.to_geodetic(place), DEGREES
    numbers = {
        "value": observations.value,
        "sigma": observations.sigma,
        **dict(zip(columns, place.T, strict=True)),
        "range_m": observations.slant_range,
        "time_s": observations.time,
    }
    names = {
        "sensor": observations.sensor,
        "quantity": observations.quantity,
        "path": observations.path,
        "shot": observations.shot,
        "clock": observations.clock,
        "record": observations.records(),
    }
    texts = {column: [_digits(x) for x in numbers[column]] for column in numbers}
    texts["value"] = [
        (AT_LEAST if is_bound else "") + text
        for is_bound, text in zip(observations.bounds(), texts["value"], strict=True)
    ]
    texts |= {column: [_quoted(x) for x in names[column]] for column in names}
    if observations.epoch is not None:
        told = np.isin(observations.quantity, CLOCK_TIMES)
        utc = [
            written(observations.epoch, value) if timed else ""
            for timed, value in zip(told, observations.value.tolist(), strict=True)
        ]
        texts["value_utc"] = utc
        texts["value"] = [
            "" if when else text for when, text in zip(utc, texts["value"], strict=True)
        ]
    return {c: texts[c] for c in COLUMNS if c in NEEDED or any(texts.get(c, ()))}


def _digits(number: float) -> str:
    return "" if math.isnan(number) else repr(float(number))


def _plain(text: str) -> str:
    unreadable = any(c != "\t" and (ord(c) < 32 or ord(c) == 127) for c in text)
    if unreadable or text != text.strip():
        raise ValueError(
            "a name or comment must be one line without control characters or outer "
            f"spaces, got {text!r}"
        )
    return text


def _quoted(name: str) -> str:
    """Return a name as CSV; a leading # would otherwise make its row a comment."""
    name = _plain(name)
    if any(c in name for c in ',"') or name.startswith("#"):
        return '"' + name.replace('"', '""') + '"'
    return name
