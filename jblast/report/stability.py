"""Failure modes of methods as text, Markdown, CSV and JSON."""

from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass, fields

from jblast.report.words import (
    capitalised,
    comma_separated,
    hanging,
    markdown,
    printed_number,
)
from jblast.results import Document
from jblast.verification.stability.failure import FailureMode

FailureModes = Mapping[str, Sequence[FailureMode]]
"""Failure modes by area."""
COLUMNS = ("method", "failure", "at", "beyond it", "jblast")
COLUMN = 10
"""Width of the labels of an entry [characters]: "beyond" and a gap."""
HEAD = (
    "# Where each method breaks",
    "",
    "Measured by `jblast stability`: each method was used past its limit. There jblast",
    "*marks* the answer as extrapolated, *refuses* with a message, *falls back* to",
    "another method, or *holds*, as it does not use the method that fails.",
    "",
    "![Where each method breaks](stability.png)",
)


@dataclass(frozen=True)
class StabilityAnswer(Document):
    """The answer of `jblast stability`.

    Attributes:
        areas: Failure modes by area.
    """

    areas: FailureModes


def boundary_words(mode: FailureMode) -> str:
    """Return the limit at which a failure begins, with its unit."""
    number = (
        f"{mode.boundary:g}" if mode.cases else printed_number("", mode.boundary, 3)
    )
    return f"{number} {mode.unit}".rstrip()


def stability_text(modes: FailureModes) -> str:
    """Return every failure mode for the terminal, area by area."""
    lines = []
    for area, found in modes.items():
        lines += ["", capitalised(area)]
        for mode in found:
            lines += hanging(f"{mode.method}: {mode.failure}", 2)
            for word, text in (
                ("at", boundary_words(mode)),
                ("beyond", mode.beyond),
                ("jblast", f"{mode.response}: {mode.message}"),
            ):
                lines += hanging(f"{word.ljust(COLUMN)}{text}", COLUMN, indent=4)
    # each area begins with an empty line, also the first one
    return "\n".join(lines[1:]) + "\n"


def stability_markdown(modes: FailureModes) -> str:
    """Return a page with a table for each area."""
    lines = [*HEAD]
    for area, found in modes.items():
        rows = [
            (
                mode.method,
                mode.failure,
                boundary_words(mode),
                mode.beyond,
                f"**{mode.response}**: {mode.message}",
            )
            for mode in found
        ]
        lines += ["", f"## {capitalised(area)}", "", markdown(COLUMNS, rows)]
    return "\n".join(lines) + "\n"


def stability_csv(modes: FailureModes) -> str:
    """Return one row a failure mode."""
    names = [one.metadata.get("key", one.name) for one in fields(FailureMode)]
    every = (astuple(mode) for found in modes.values() for mode in found)
    return comma_separated([names, *every])
