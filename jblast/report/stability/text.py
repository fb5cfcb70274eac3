"""The edges of methods as text, Markdown, CSV and JSON."""

import dataclasses
import json
from collections.abc import Mapping, Sequence

from jblast.report.fit.terminal import hanging
from jblast.report.json_values import plain
from jblast.report.numbers import printed_number
from jblast.report.tables import comma_separated, markdown
from jblast.report.words import capitalised
from jblast.verification.stability.failure import Edge

Edges = Mapping[str, Sequence[Edge]]
"""By area."""

COLUMNS = ("method", "what goes wrong", "at", "beyond it", "jblast")
COLUMN = 10
"""Width of the words before each entry."""
HEAD = (
    "# Where each method breaks",
    "",
    "Measured by `jblast stability`: each method was taken past its edge, and jblast",
    "was watched there. It *marks* (the answer says that it is outside), *refuses*",
    "(one message, no number), *falls back* (to another method), or *holds* (what",
    "breaks is not what it uses).",
    "",
    "![Where each method breaks](stability.png)",
)


def boundary_words(edge: Edge) -> str:
    """Return where an edge lies, with its unit."""
    number = (
        f"{edge.boundary:g}" if edge.cases else printed_number("", edge.boundary, 3)
    )
    return f"{number} {edge.unit}".rstrip()


def stability_text(edges: Edges) -> str:
    """Return every edge for the terminal, area by area."""
    lines = []
    for area, found in edges.items():
        lines += ["", capitalised(area)]
        for edge in found:
            lines += hanging(f"{edge.method}: {edge.edge}", 2)
            for word, text in (
                ("at", boundary_words(edge)),
                ("beyond", edge.beyond),
                ("jblast", f"{edge.deed}: {edge.said}"),
            ):
                lines += hanging(f"{word.ljust(COLUMN)}{text}", COLUMN, indent=4)
    return "\n".join(lines[1:]) + "\n"


def stability_markdown(edges: Edges) -> str:
    """Return a page with a table for each area."""
    lines = [*HEAD]
    for area, found in edges.items():
        rows = [
            (
                edge.method,
                edge.edge,
                boundary_words(edge),
                edge.beyond,
                f"**{edge.deed}**: {edge.said}",
            )
            for edge in found
        ]
        lines += ["", f"## {capitalised(area)}", "", markdown(COLUMNS, rows)]
    return "\n".join(lines) + "\n"


def stability_csv(edges: Edges) -> str:
    """Return one row an edge."""
    columns = [field.name for field in dataclasses.fields(Edge)]
    rows = (
        [getattr(edge, name) for name in columns]
        for found in edges.values()
        for edge in found
    )
    return comma_separated([columns, *rows])


def stability_json(edges: Edges) -> str:
    """Return what `--json` prints."""
    areas = {
        area: [dataclasses.asdict(edge) for edge in found]
        for area, found in edges.items()
    }
    document = plain({"schema": 1, "areas": areas})
    return json.dumps(document, indent=1, allow_nan=False) + "\n"
