"""Generated blocks of hand-written pages, from parsers and tables.

A line `<!-- jblast: NAME -->` of a page is replaced by the block of that name, so that
no fact of a table is written twice. `answer_of_study.outcomes` is the table of keys of
a document, or of a part of it.
"""

import re
from collections.abc import Callable

from docs.generate import command_line, documents, scene_tables

MARKER = re.compile(r"^<!-- jblast: ([\w.]+) -->$", re.MULTILINE)
BLOCKS: dict[str, Callable[[], str]] = {
    "command_line": command_line.verbs,
    "quantities": scene_tables.quantities,
    "units": scene_tables.units,
    "columns": scene_tables.columns,
    "scene_numbers": scene_tables.numbers,
    "scene_keys": scene_tables.keys,
    "sensor_kinds": scene_tables.sensor_kinds,
    "explosives": scene_tables.explosives,
}
ANSWER = "answer_of_"
"""Start of the name of a table of the keys of a document."""


def filled(markdown: str) -> str:
    """Return a page with each marker replaced by its block."""
    return MARKER.sub(lambda match: block(match[1]).strip(), markdown)


def block(name: str) -> str:
    """Return a block by its name."""
    if name.startswith(ANSWER):
        return documents.table(name.removeprefix(ANSWER))
    return BLOCKS[name]()
