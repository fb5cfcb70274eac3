"""Samples as CSV, written packet by packet: a row a sample, provenance above."""

import os
from collections.abc import Iterable, Sequence

import numpy as np
from jaxtyping import Float

from jblast.files import replacing
from jblast.report.tables import comma_separated, commented


def write_samples(
    path: str | os.PathLike[str],
    packets: Iterable[Float[np.ndarray, "sample component"]],
    rate_hz: float,
    columns: Sequence[str],
    comments: Sequence[str],
) -> int:
    """Write samples against time, in constant memory.

    If the packets break off by an error, or are interrupted, those that came are kept
    as a whole file and the error goes on.

    Args:
        path: What is there is replaced.
        packets: Samples in a row.
        rate_hz: Samples a second; the first is at 0.
        columns: What each component is, with the unit.
        comments: Lines that say where the samples come from.

    Returns:
        How many samples there are.
    """
    written = 0
    broken: BaseException | None = None
    with (
        replacing(path) as temporary,
        temporary.open("w", encoding="utf-8", newline="") as file,
    ):
        file.write(commented(comments))
        file.write(comma_separated([["time_s", *columns]]))
        try:
            for packet in packets:
                times = (written + np.arange(len(packet))) / rate_hz
                rows = np.column_stack([times, packet]).tolist()
                file.write(comma_separated(map(_cells, rows)))
                written += len(packet)
        except BaseException as error:
            if not written:
                raise  # nothing to keep: what was there before stays
            broken = error
    if broken is not None:
        raise broken
    return written


def _cells(row: Sequence[float]) -> list[str]:
    """Return a time to the nanosecond, and samples with the digits of 32 bits."""
    time, *samples = row
    return [f"{time:.9f}", *(f"{sample:.9g}" for sample in samples)]
