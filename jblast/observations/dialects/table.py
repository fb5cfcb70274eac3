"""A table as it was found, all of it text: what every dialect is taken apart into."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from jblast.observations.formats import row_word
from jblast.observations.understood import Understood


@dataclass
class Table:
    """A header, and columns of fields.

    Attributes:
        source: The file, or what else it came from.
        header: Names of columns as written, outer blanks off.
        columns: Fields by column and row as written, outer blanks off.
        lines: Where each row stood.
        header_line: Where the header stood.
        comments: What stood behind the # of comments.
        understood: How it was written.
        blank_before: Lines of rows that come after an empty one.
    """

    source: str
    header: list[str]
    columns: list[list[str]]
    lines: Sequence[int]
    header_line: int
    comments: tuple[str, ...] = ()
    understood: tuple[Understood, ...] = ()
    blank_before: frozenset[int] = field(default_factory=frozenset)

    def at(self, line: int) -> str:
        """Name the source and a line of it."""
        return f"{self.source}: {row_word(self.source)} {line}"

    def drop_rows(self, dropped: set[int]) -> None:
        """Take rows out, by number from zero."""
        if dropped:
            kept = [row for row in range(len(self.lines)) if row not in dropped]
            self.columns = [[column[row] for row in kept] for column in self.columns]
            self.lines = [self.lines[row] for row in kept]

    def drop_columns(self, dropped: set[int]) -> None:
        """Take columns out, by number from zero."""
        kept = [index for index in range(len(self.header)) if index not in dropped]
        self.header = [self.header[index] for index in kept]
        self.columns = [self.columns[index] for index in kept]
