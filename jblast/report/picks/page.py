"""What was picked as one HTML page that needs nothing beside it."""

from collections.abc import Sequence

from matplotlib.figure import Figure

import jblast
from jblast.inference.picks import NAMES
from jblast.inference.records import Gathered
from jblast.report.figure_files import picture_of
from jblast.report.pages import page
from jblast.report.picks.text import estimate_words
from jblast.report.picks.words import RECORDS_ALT, RECORDS_CAPTION, note_words
from jblast.report.provenance import Provenance, provenance_lines
from jblast.report.words import capitalised, quantity_words

TITLES = {"decay": "Decay", "rise_time_s": "Rise time"}
"""Of what stands in no table of quantities."""


def picks_page(
    found: Gathered,
    pictures: Sequence[Figure],
    lines: Sequence[str],
    made: Provenance,
    comments: Sequence[str],
) -> str:
    """Return the page.

    Args:
        found: Picks.
        pictures: Of their records.
        lines: What else is to be said, a sentence each.
        made: What they were made of.
        comments: Of the log.
    """
    rows = [
        {
            "name": name,
            "told": [estimate_words(one, quantity) for quantity in NAMES],
            "quality": one.quality,
            "notes": "; ".join(note_words(one)),
        }
        for name, one in zip(found.named(), found.picks, strict=True)
    ]
    count, channels = len(found.picks), found.channels
    return page(
        "picks/template.html",
        title=f"{count} {'pick' if count == 1 else 'picks'}",
        subtitle=f"{channels} {'record' if channels == 1 else 'records'} read",
        columns=[TITLES.get(q) or capitalised(quantity_words(q)) for q in NAMES],
        rows=rows,
        pictures=[_picture(figure) for figure in pictures],
        caption=RECORDS_CAPTION,
        lines=lines,
        provenance=provenance_lines(made, "File"),
        comments="\n".join(comments),
        version=jblast.__version__,
    )


def _picture(figure: Figure) -> dict[str, str | int]:
    picture = picture_of(figure)
    return {"source": picture.source, "alt": RECORDS_ALT, "width": picture.width}
