"""Blocks: what hand-written pages take from parsers and tables, by a marker.

A line `<!-- jblast: NAME -->` of a page is replaced by what the function of that name
writes, so that no fact of a table is written twice.
"""

import re
from collections.abc import Callable
from functools import partial

from docs.generate import command_line, documents, scene_tables

MARKER = re.compile(r"^<!-- jblast: (\w+) -->$", re.MULTILINE)
BLOCKS: dict[str, Callable[[], str]] = {
    "command_line": command_line.verbs,
    "quantities": scene_tables.quantities,
    "units": scene_tables.units,
    "columns": scene_tables.columns,
    "scene_numbers": scene_tables.numbers,
    "scene_world_numbers": scene_tables.world_numbers,
    "scene_keys": scene_tables.keys_of_tables,
    "scene_lists": scene_tables.lists,
    "scene_words": scene_tables.words,
    "sensor_kinds": scene_tables.sensor_kinds,
    "explosives": scene_tables.explosives,
    **{
        f"answer_of_{name}": partial(documents.table, name)
        for name in (*documents.DOCUMENTS, *documents.PARTS)
    },
}


def filled(markdown: str) -> str:
    """Return a page with each marker replaced by its block."""
    return MARKER.sub(lambda match: BLOCKS[match[1]]().strip(), markdown)
