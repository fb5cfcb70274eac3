"""What a reader understood of a log that is not in our own words, to be told once."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Understood:
    """Something that was converted, skipped or supplied while a log was read.

    Findings are typed where they are found and worded in `report.understood`.
    """


@dataclass(frozen=True)
class Dialect(Understood):
    """How a file was written, where it is not as we write it.

    Attributes:
        format: "CSV", "Excel workbook", "OpenDocument spreadsheet" or "Parquet".
        separator: Between the fields of a line, if not the comma: "semicolon" or "tab".
        encoding: Of the text, if not UTF-8.
        sheet: The sheet of a workbook.
    """

    format: str = "CSV"
    separator: str = ""
    encoding: str = ""
    sheet: str = ""


@dataclass(frozen=True)
class DecimalComma(Understood):
    """Numbers are written with a decimal comma.

    Attributes:
        line: Of the number that shows it.
        text: That number as written.
    """

    line: int
    text: str


@dataclass(frozen=True)
class Renamed(Understood):
    """A column or quantity in our unit under another name.

    Attributes:
        theirs: As written.
        ours: What it was taken for.
    """

    theirs: str
    ours: str


@dataclass(frozen=True)
class Converted(Understood):
    """A column or quantity in another unit than ours.

    Attributes:
        theirs: As written.
        ours: Our column or quantity.
        unit: As our names would end in it: "psi_ms".
        factor: What values were multiplied by.
        rows: How many.
    """

    theirs: str
    ours: str
    unit: str
    factor: float
    rows: int


@dataclass(frozen=True)
class LevelConverted(Understood):
    """Peak levels in decibels re 20 uPa, or errors in decibels.

    Attributes:
        theirs: As written.
        rows: How many.
    """

    theirs: str
    rows: int


@dataclass(frozen=True)
class ClockTimesTaken(Understood):
    """Clock times that do not say their day or their zone, or that are not in UTC.

    Attributes:
        date: The day that was taken for those without one.
        undated: How many these are.
        zone: The zone that was taken for those without one.
        unzoned: How many these are.
        moved: How many have an offset of their own, and were turned into UTC.
    """

    date: str
    undated: int
    zone: str
    unzoned: int
    moved: int


@dataclass(frozen=True)
class EmptySkipped(Understood):
    """Rows without a value, left out.

    Attributes:
        lines: Where they stood.
    """

    lines: tuple[int, ...]


@dataclass(frozen=True)
class HeightTaken(Understood):
    """Sensors without a height, taken to stand at up = 0."""


@dataclass(frozen=True)
class ColumnsIgnored(Understood):
    """Columns of notes, or of nothing.

    Attributes:
        names: As written.
    """

    names: tuple[str, ...]


@dataclass(frozen=True)
class UnitsRow(Understood):
    """A row that holds the units of the columns.

    Attributes:
        line: Where it stood.
    """

    line: int


@dataclass(frozen=True)
class MadeLong(Understood):
    """A table with a column for each quantity.

    Attributes:
        quantities: Names of those columns, as written.
        without_sigma: Those beside which no error stands: the law's scatter alone.
        shares: Those whose errors are per cent of their values.
    """

    quantities: tuple[str, ...]
    without_sigma: tuple[str, ...]
    shares: tuple[str, ...] = ()
