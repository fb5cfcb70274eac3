"""What was seen as files: JSON, a picture, a log."""

from pathlib import Path

from jblast.detect.flash.search import FlashDetections
from jblast.files import write_text
from jblast.observations import Observations, write
from jblast.report.detect.files import JSON, LOG, PICTURE
from jblast.report.detect.flash.figure import flash_figure
from jblast.report.figure_files import write_figure


def write_flashes(
    directory: Path,
    watched: FlashDetections,
    shape: tuple[int, int],
    text: str,
    log: Observations | None,
) -> list[str]:
    """Write all there is; return the names of the files.

    Args:
        directory: Where to; made if it is not there.
        watched: What was seen.
        shape: Height and width of the image [px].
        text: The document.
        log: Rows; where there are none no file is written, and an older one is removed.

    Raises:
        OSError: It cannot be written.
    """
    directory.mkdir(parents=True, exist_ok=True)
    write_text(directory / JSON, text)
    write_figure(flash_figure(watched, shape), directory / PICTURE)
    names = [JSON, PICTURE]
    (directory / LOG).unlink(missing_ok=True)
    if log is not None and len(log):
        write(directory / LOG, log)
        names.append(LOG)
    return names
