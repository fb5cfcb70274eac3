"""What was heard as files: JSON, the filter's output, a picture, a log."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from jblast.detect.array.log import Log
from jblast.detect.search import Searched
from jblast.files import write_text
from jblast.observations import write
from jblast.observations.records.sound_file import write_sound
from jblast.report.detect.figure import detection_figure
from jblast.report.figure_files import write_figure

JSON, PICTURE, LOG, FILTERED = (
    *("detect.json", "detection.png", "observations.csv", "filtered.wav"),
)


def write_detection(
    directory: Path, searched: Sequence[Searched], text: str, log: Log | None
) -> list[str]:
    """Write all there is; return the names of the files.

    Args:
        directory: Where to; made if it is not there.
        searched: Channels.
        text: The document.
        log: Rows of the arrivals, if positions are known; where there are none, no
            file is written, and an older one is removed.

    Raises:
        OSError: It cannot be written.
    """
    directory.mkdir(parents=True, exist_ok=True)
    write_text(directory / JSON, text)
    names = [JSON, *_write_outputs(directory, searched)]
    write_figure(detection_figure(searched), directory / PICTURE)
    names.append(PICTURE)
    (directory / LOG).unlink(missing_ok=True)
    if log is not None and len(log.observations):
        write(directory / LOG, log.observations)
        names.append(LOG)
    return names


def _write_outputs(directory: Path, searched: Sequence[Searched]) -> list[str]:
    """Write the filter's output, a file for each recording, its live channels in it."""
    records: dict[str, list[Searched]] = {}
    for one in searched:
        records.setdefault(one.channel.record, []).append(one)
    names = []
    for record, members in records.items():
        name = FILTERED if len(records) == 1 else f"{Path(record).stem}.{FILTERED}"
        length = min(member.statistic.size for member in members)
        outputs = np.array([member.statistic[:length] for member in members])
        write_sound(directory / name, outputs, members[0].channel.rate_hz)
        names.append(name)
    return names
