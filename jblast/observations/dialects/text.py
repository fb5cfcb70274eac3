"""Tables as text: which sign stands between fields, and the fields of each line."""

import csv
import re
from collections.abc import Sequence

from jblast.errors import InputError, shown
from jblast.observations.dialects.table import Table
from jblast.observations.faults import Faults
from jblast.observations.table import COLUMNS, NEEDED
from jblast.observations.understood import Dialect
from jblast.progress import counted
from jblast.units import our_name
from jblast.units.spelling import spelt

SEPARATORS = {",": "", ";": "semicolon", "\t": "tab"}
"""Between fields, and what they are called; the comma is ours."""
MANY = 50_000
"""Lines between two reports of how far it is."""
WITHIN = f"a header {','.join(NEEDED)} and one measurement a row"
"""What a log holds."""
TOLD = re.compile(r"sep=(.)$", re.IGNORECASE)
"""First line by which Excel tells itself the separator."""


def text_table(
    text: str,
    source: str,
    faults: Faults,
    *,
    strict: bool,
    encoding: str = "",
    within: str = WITHIN,
) -> Table:
    r"""Take text apart.

    Args:
        text: Lines that end in `\n`.
        source: Where it comes from.
        faults: Takes lines that are too short or too long.
        strict: Whether the comma is the only separator.
        encoding: Of the text, if not UTF-8.
        within: What is expected in it.

    Raises:
        InputError: There is no header or no row below, or a quote is not closed.
    """
    comments, lines, numbers, named = [], [], [], ""
    for number, line in enumerate(text.split("\n"), start=1):
        stripped = line.strip()
        if stripped.startswith("#"):
            comments.append(stripped[1:].strip())
        elif stripped:
            lines.append(line)
            numbers.append(number)
    if lines and not strict and (match := TOLD.match(lines[0].strip(" "))):
        named = match[1]
        del lines[0], numbers[0]
    if not lines:
        raise InputError(f"{source}: line 1: the file is empty; expected {within}")
    separator = named or ("," if strict else separator_of(lines[0]))
    if separator not in lines[0]:
        _refuse_other_separator(f"{source}: line {numbers[0]}", lines[0])
    records = _records(source, lines, numbers, separator, faults)
    header = [name.strip() for name in records[0]]
    if len(header) == 1 and not strict:
        raise InputError(
            f"{source}: line {numbers[0]}: expected columns separated by commas, "
            f"semicolons or tabs, got one column {shown(header[0])}"
        )
    columns = [[field.strip() for field in column] for column in zip(*records[1:])]  # noqa: B905 (checked widths)
    found = Dialect(separator=SEPARATORS.get(separator, separator), encoding=encoding)
    return Table(
        source=source,
        header=header,
        columns=columns or [[] for _ in header],
        lines=numbers[1:],
        header_line=numbers[0],
        comments=tuple(comments),
        understood=() if found == Dialect() else (found,),
    )


def separator_of(header: str) -> str:
    """Return what stands between the names of a header: as most of them are known.

    Of names that nobody knows what makes most of them; the comma where none does more.
    """

    def known(separator: str) -> int:
        try:
            (names,) = csv.reader([header], delimiter=separator, skipinitialspace=True)
        except (csv.Error, ValueError):
            return 0
        return sum(
            spelt(name) in COLUMNS or our_name(name) is not None
            for name in names
            if len(names) > 1
        )

    return max(SEPARATORS, key=lambda mark: (known(mark), header.count(mark)))


def _records(
    source: str,
    lines: Sequence[str],
    numbers: list[int],
    separator: str,
    faults: Faults,
) -> list[list[str]]:
    """Split lines into fields; each line is one record, as wide as the header."""
    reader = csv.reader(lines, delimiter=separator, skipinitialspace=True, strict=True)
    records: list[list[str]] = []
    through = counted(len(lines), "lines")
    try:
        for record in reader:
            records.append(record)
            if reader.line_num != len(records):
                break
            if not len(records) % MANY:
                through(len(records))
    except csv.Error as error:
        between = SEPARATORS.get(separator) or "comma"
        raise InputError(
            f"{source}: line {numbers[len(records)]}: expected {between}-separated "
            f"fields, got a stray or unclosed quote ({error})"
        ) from None
    if reader.line_num != len(records):
        raise InputError(
            f"{source}: line {numbers[len(records) - 1]}: expected one measurement a "
            "line, got a quote that is not closed on it"
        )
    width = len(records[0])
    uneven = [row for row, record in enumerate(records) if len(record) != width]
    for row in uneven:
        got = len(records[row])
        faults.tell(
            InputError(
                f"{source}: line {numbers[row]}: expected {width} fields as in the "
                f"header, got {got}"
                + ("; is a decimal comma among them?" if got > width else "")
            )
        )
    for row in reversed(uneven):
        del records[row], numbers[row]
    return records


def _refuse_other_separator(where: str, header: str) -> None:
    """Refuse a header of one name that holds another separator."""
    for separator, name in ((";", "semicolons"), ("\t", "tabs")):
        if separator in header:
            raise InputError(
                f"{where}: expected columns separated by commas, got {name}; save the "
                "file with commas (and decimal points)"
            )
