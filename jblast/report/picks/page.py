"""What was picked as one HTML page that needs nothing beside it."""

import base64
from collections.abc import Sequence
from importlib.resources import files

from jinja2 import Environment, StrictUndefined
from matplotlib.figure import Figure

import jblast
from jblast.inference.picks import NAMES
from jblast.inference.records import Gathered
from jblast.report.figure_files import image_bytes
from jblast.report.picks.text import estimate_words
from jblast.report.picks.words import RECORDS_ALT, RECORDS_CAPTION, note_words
from jblast.report.words import capitalised, quantity_words

TITLES = {"decay": "Decay", "rise_time_s": "Rise time"}
"""Of what stands in no table of quantities."""


def picks_page(
    found: Gathered,
    pictures: Sequence[Figure],
    lines: Sequence[str],
    comments: Sequence[str],
) -> str:
    """Return the page.

    Args:
        found: Picks.
        pictures: Of their records.
        lines: What else is to be said, a sentence each.
        comments: Provenance.
    """
    environment = Environment(autoescape=True, undefined=StrictUndefined)
    template = environment.from_string(
        files("jblast.report.picks").joinpath("template.html").read_text("utf-8")
    )
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
    return template.render(
        title=f"{count} {'pick' if count == 1 else 'picks'}",
        subtitle=f"{channels} {'record' if channels == 1 else 'records'} read",
        columns=[TITLES.get(q) or capitalised(quantity_words(q)) for q in NAMES],
        rows=rows,
        pictures=[_picture(figure) for figure in pictures],
        caption=RECORDS_CAPTION,
        lines=lines,
        comments="\n".join(comments),
        version=jblast.__version__,
    )


def _picture(figure: Figure) -> dict[str, str | int]:
    data = base64.b64encode(image_bytes(figure, "png")).decode("ascii")
    return {
        "source": f"data:image/png;base64,{data}",
        "alt": RECORDS_ALT,
        "width": round(96 * figure.get_figwidth()),
    }
