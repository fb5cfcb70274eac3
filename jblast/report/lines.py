"""Lines of a terminal: how wide they are, and text broken into them."""

import textwrap

WIDTH = 96


def hanging(text: str, column: int = 0, indent: int = 2) -> list[str]:
    """Break a text into lines, all but the first further in by `column`."""
    return textwrap.wrap(
        text,
        WIDTH,
        initial_indent=" " * indent,
        subsequent_indent=" " * (indent + column),
        break_on_hyphens=False,
    ) or [""]


def behind(start: str, text: str) -> list[str]:
    """Break a text behind a start into lines, later ones below its beginning."""
    # a number keeps its unit beside it
    for unit in (" m/kg", " ft/lb", " %", " kg", " m "):
        text = text.replace(unit, "\xa0" + unit[1:])
    lines = textwrap.wrap(
        text,
        WIDTH,
        initial_indent=start,
        subsequent_indent=" " * len(start),
        break_on_hyphens=False,
    )
    return [line.replace("\xa0", " ") for line in lines] or [start]
