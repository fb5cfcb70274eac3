"""What was picked as files: JSON, log, pictures, page."""

import json
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jblast.files import write_text
from jblast.inference.records import Gathered, PickLog
from jblast.observations import write
from jblast.report.provenance import Provenance

if TYPE_CHECKING:
    from matplotlib.figure import Figure

JSON, LOG, PAGE = "picks.json", "picks.csv", "report.html"
PICTURE = "records_{}.png"
MOST_PICTURES = 10
"""Pictures, of some records each: more is no page to look at."""


def write_picks(
    directory: Path,
    found: Gathered,
    log: PickLog,
    document: dict[str, Any],
    lines: Sequence[str],
    made: Provenance,
) -> list[str]:
    """Write all there is, the answer first; return the names of the files.

    A picture that cannot be drawn costs nothing but itself: a warning names it.

    Args:
        directory: Where to; made if it is not there.
        found: Picks that keep their samples.
        log: Their rows.
        document: What `picks_document` made of them.
        lines: What else is to be said.
        made: What they were made of.

    Raises:
        OSError: It cannot be written.
    """
    directory.mkdir(parents=True, exist_ok=True)
    stale = [directory / name for name in (JSON, LOG, PAGE)]
    for path in (*stale, *directory.glob(PICTURE.format("*"))):
        path.unlink(missing_ok=True)
    text = json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False)
    write_text(directory / JSON, text + "\n")
    written = [JSON]
    if len(log.observations):
        write(directory / LOG, log.observations)
        written.append(LOG)
    pictures = _pictures(directory, found, written)
    from jblast.report.picks.page import picks_page

    page = picks_page(found, pictures, lines, made, log.observations.comments)
    write_text(directory / PAGE, page)
    return [*written, PAGE]


def _pictures(directory: Path, found: Gathered, written: list[str]) -> "list[Figure]":
    """Draw records, so many a picture, and write them."""
    from jblast.report.figure_files import write_drawn
    from jblast.report.picks.figure import MOST, records_figure

    names, pictures = found.named(), []
    firsts = range(0, len(found.picks), MOST)[:MOST_PICTURES]
    for number, first in enumerate(firsts, start=1):
        part = slice(first, first + MOST)
        name = PICTURE.format(number)
        draw = partial(records_figure, names[part], found.picks[part])
        figure = write_drawn(draw, directory / name)
        if figure is not None:
            pictures.append(figure)
            written.append(name)
    return pictures
