"""Views: blocks of an answer, and their text for terminals and in Markdown.

A result becomes a `View` once. `terminal` prints it, `jblast.report.page` makes a page
of the same blocks, and `jblast.report.output` writes their figures. A block without
content is not shown, so that a view lists all blocks of its kind of answer.
"""

import textwrap
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from jblast.report.provenance import Provenance

WIDTH = 96
"""Width of printed text [characters]: the range of validity of most laws fits."""
GAP = "  "
"""Between two columns on a terminal."""
Where = Literal["everywhere", "page", "terminal", "detail"]
"""Output of a block; "detail" is the page, and a terminal with `--verbose`."""


@dataclass(frozen=True)
class Column:
    """A column of a table.

    Attributes:
        head: Its title.
        cell: Function that returns the printed cell of a row.
        right: Whether it is aligned right, as numbers are.
    """

    head: str
    cell: Callable[[Any], str]
    right: bool = False


@dataclass(frozen=True)
class Table:
    """A table; columns whose cells are all empty are dropped.

    Attributes:
        columns: Its columns.
        rows: A value a row.
        title: Heading.
        where: Outputs that show it.
        most: Largest number of shown rows; the number of the others is printed.
        marked: Whether a row is emphasised on a page.
        note: Sentence under a row.
        caption: Sentence under the table, also of one without rows.
    """

    columns: Sequence[Column]
    rows: Sequence[Any]
    title: str = ""
    where: Where = "everywhere"
    most: int | None = None
    marked: Callable[[Any], bool] = lambda row: False
    note: Callable[[Any], str] = lambda row: ""
    caption: str = ""

    @property
    def shown(self) -> Sequence[Any]:
        """The rows that are shown."""
        return self.rows[: self.most]

    @property
    def left_out(self) -> str:
        """Sentence on the rows that are not shown."""
        return _more(len(self.rows) - len(self.shown))

    def kept(self) -> list[tuple[Column, list[str]]]:
        """Return the columns that are not empty, each with its cells."""
        cells = [(one, [one.cell(row) for row in self.shown]) for one in self.columns]
        return [(one, column) for one, column in cells if any(column)]


@dataclass(frozen=True)
class Facts:
    """Names with values.

    Attributes:
        facts: Pairs of name and value; those without a value are dropped.
        title: Heading.
        where: Outputs that show it.
    """

    facts: Sequence[tuple[str, str]]
    title: str = ""
    where: Where = "everywhere"

    @property
    def shown(self) -> list[tuple[str, str]]:
        """The facts with a value."""
        return [(name, value) for name, value in self.facts if value]


@dataclass(frozen=True)
class Lines:
    """Sentences.

    Attributes:
        title: Heading.
        lines: The sentences; empty ones are dropped.
        where: Outputs that show them.
        most: Largest number on a terminal; a page has all.
    """

    title: str
    lines: Iterable[str]
    where: Where = "everywhere"
    most: int | None = None

    @property
    def shown(self) -> list[str]:
        """The sentences, each once."""
        return [line for line in dict.fromkeys(self.lines) if line]


@dataclass(frozen=True)
class Text:
    """A text with its own lines, such as a file; folded on a page."""

    title: str
    text: str
    where: Where = "page"


@dataclass(frozen=True)
class Picture:
    """A figure, drawn when files are written.

    Attributes:
        name: Name of its file, with suffix.
        draw: Function that returns the figure.
        title: Heading.
        caption: Sentence under the figure.
        alt: Description in place of the figure.
    """

    name: str
    draw: "Callable[[], Figure]"
    title: str = ""
    caption: str = ""
    alt: str = ""


def drawn_by(figure: str, *arguments: Any) -> "Callable[[], Figure]":
    """Return a function that imports and calls a function of a figure.

    Matplotlib takes a second to import, without use in an answer without files.

    Args:
        figure: Module of `jblast.report` and function, as "module.function".
        arguments: Arguments of the function.
    """

    def draw() -> "Figure":
        module, _, function = figure.partition(".")
        return getattr(import_module(f"jblast.report.{module}"), function)(*arguments)

    return draw


Block = Table | Facts | Lines | Text | Picture


@dataclass(frozen=True)
class View:
    """Title and blocks of an answer.

    Attributes:
        title: Its first line.
        blocks: Its blocks, in order.
        subtitle: Conditions of the answer.
        problems: Reasons not to use the answer as it is, before all blocks.
        made: Provenance, at the end of a page.
        footer: Sentence at the end of a page.
    """

    title: str
    blocks: Sequence[Block] = ()
    subtitle: str = ""
    problems: Sequence[str] = ()
    made: "Provenance | None" = None
    footer: str = ""

    def of(self, *where: Where) -> list[Block]:
        """Return the blocks of some outputs that have content."""
        return [
            block
            for block in self.blocks
            if isinstance(block, Picture)
            or (block.where in where and bool(_content(block)))
        ]


def _content(block: Block) -> Any:
    if isinstance(block, Table):
        return block.rows or block.caption
    if isinstance(block, Text):
        return block.text
    return block.shown if isinstance(block, Facts | Lines) else True


def _more(number: int) -> str:
    return f"and {number:,} more" if number > 0 else ""


def terminal(view: View, *, verbose: bool = False) -> str:
    """Return a view as text for a terminal.

    Args:
        view: The view.
        verbose: Whether blocks of details are included.
    """
    lines = hanging(view.title, indent=0)
    lines += hanging(view.subtitle, indent=0) if view.subtitle else []
    for sentence in view.problems:
        lines += hanging(sentence, indent=0)
    outputs: tuple[Where, ...] = ("everywhere", "terminal")
    for block in view.of(*outputs, *(("detail",) if verbose else ())):
        if isinstance(block, Picture):
            continue
        lines += ["", block.title] if block.title else [""]
        lines += _terminal_block(block, 2 if block.title else 0, verbose)
    return "\n".join(line.rstrip() for line in lines) + "\n"


def _terminal_block(block: Block, indent: int, verbose: bool) -> list[str]:
    margin = " " * indent
    if isinstance(block, Table):
        return _terminal_table(block, margin)
    if isinstance(block, Facts):
        width = max(len(name) for name, _ in block.shown)
        return [
            line
            for name, value in block.shown
            for line in behind(f"{margin}{name.ljust(width)}{GAP}", value)
        ]
    if isinstance(block, Lines):
        shown = block.shown
        most = None if verbose else block.most
        rest = _more(len(shown[most:]) if most is not None else 0)
        return [
            line
            for sentence in [*shown[:most], *([rest] if rest else [])]
            # later lines of a sentence are indented, so that each start is visible
            for line in hanging(sentence, 2 if len(shown) > 1 else 0, indent)
        ]
    assert isinstance(block, Text)
    return [margin + line for line in block.text.splitlines()]


def _terminal_table(table: Table, margin: str) -> list[str]:
    columns, cells = zip(*table.kept(), strict=True) if table.rows else ((), ())
    rows = [[one.head for one in columns], *map(list, zip(*cells, strict=True))]
    right = {n for n, one in enumerate(columns) if one.right}
    # sentences in the last column are broken behind the others
    last = len(columns) - 1
    texts = [row.pop() if row and last not in right else "" for row in rows]
    lines = []
    for n, (start, text) in enumerate(zip(_padded(rows, right), texts, strict=True)):
        if n or any(one.head for one in columns):
            lines += behind(margin + start + (GAP if text else ""), text)
        if n and (note := table.note(table.shown[n - 1])):
            lines += hanging(note, indent=len(margin) + 2)
    for sentence in (table.left_out, table.caption):
        lines += hanging(sentence, indent=len(margin)) if sentence else []
    return lines


def aligned(rows: Sequence[Sequence[str]], *, right: Collection[int] = ()) -> list[str]:
    """Return the lines of a table whose columns are as wide as their widest cell.

    Args:
        rows: Cells; every row has the same number.
        right: Columns, counted from 0, that are aligned right.
    """
    return [line.rstrip() for line in _padded(rows, right)]


def _padded(rows: Sequence[Sequence[str]], right: Collection[int]) -> list[str]:
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        GAP.join(
            cell.rjust(width) if n in right else cell.ljust(width)
            for n, (cell, width) in enumerate(zip(row, widths, strict=True))
        )
        for row in rows
    ]


def hanging(text: str, column: int = 0, indent: int = 2) -> list[str]:
    """Break a text into lines; all but the first are indented by `column` more."""
    return textwrap.wrap(
        text,
        WIDTH,
        initial_indent=" " * indent,
        subsequent_indent=" " * (indent + column),
        break_on_hyphens=False,
    ) or [""]


def behind(start: str, text: str) -> list[str]:
    """Break a text after a start into lines; later lines are aligned with the first."""
    # a no-break space keeps a number and its unit on one line
    for unit in (" m/kg", " ft/lb", " %", " kg", " m "):
        text = text.replace(unit, "\xa0" + unit[1:])
    lines = textwrap.wrap(
        text,
        WIDTH,
        initial_indent=start,
        subsequent_indent=" " * len(start),
        break_on_hyphens=False,
        break_long_words=False,
    )
    return [line.replace("\xa0", " ") for line in lines] or [start]


def markdown(table: Table) -> str:
    """Return a Markdown table, without the line end of its last row."""
    kept = table.kept()
    heads = "|".join(f" {one.head} " if one.head else " " for one, _ in kept)
    rules = "|".join("---:" if one.right else "---" for one, _ in kept)
    rows = zip(*(cells for _, cells in kept), strict=True)
    lines = [" | ".join(cell.replace("|", r"\|") for cell in row) for row in rows]
    return "\n".join([f"|{heads}|", f"|{rules}|", *(f"| {line} |" for line in lines)])
