"""A log as a table of measurements, one a row, in SI units.

Positions are east, north and up [m] in a local frame, clock times are seconds from an
epoch. A missing number is NaN and a missing name is "". Errors of different rows are
independent, except those of one pressure record, whose covariance is stored per record
(`RecordCovariance`, positive definite, relative for quantities whose errors are
relative). `Understood` and its subclasses describe what a reader converted, skipped or
supplied. `Faults` either raises the first fault of a file or gathers all of them.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import PurePath
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from jblast.errors import InputError, shown
from jblast.observations.places import Frame
from jblast.quantities import (
    ADDITIVE,
    CLOCK_TIMES as CLOCK_TIMES,
    QUANTITIES as QUANTITIES,
    TIMES as TIMES,
)

NEEDED = ("sensor", "quantity", "value", "sigma")
POSITION = ("east_m", "north_m", "up_m")
DEGREES = ("lat_deg", "lon_deg", "alt_m")
NAMED = ("path", "shot", "clock", "record")
"""Columns of names that a file may leave out."""
COLUMNS = (
    *(*NEEDED[:3], "value_utc", "sigma"),
    *(*POSITION, *DEGREES, "range_m", "time_s", *NAMED),
)
"""Every column a file may have, in the order `write` puts them."""
NUMBERS = ("value", "sigma", *POSITION, *DEGREES, "range_m", "time_s")
"""Columns that hold numbers."""
SAMPLES = "overpressure_record"
"""In column quantity: the row is a record of samples, a file that `record` names."""
OF_SAMPLES = (
    *("air_arrival_s", "peak_overpressure_pa"),
    *("positive_duration_s", "positive_impulse_pa_s"),
)
"""What is read off one."""
SYMMETRIC = 1e-9
"""Entries on both sides of the diagonal agree to this share of the variances."""
TEXTS = ("", ".csv", ".tsv", ".tab", ".txt", ".dat", ".log")
"""Endings of files that are read as text."""
WORKBOOKS = {".xlsx": "openpyxl", ".xlsm": "openpyxl", ".ods": "odf"}
"""Endings of spreadsheets, and what pandas reads them by."""
PARQUET = (".parquet", ".pq")
FRAME = "data frame"
"""Source of a log that came as one."""


@dataclass(frozen=True)
class RecordCovariance:
    """The covariance of the errors of one record's quantities.

    A record's noise moves its peak, duration and impulse together. Rows of a log whose
    `record` is this one's and whose quantity is here share these errors.

    Attributes:
        record: Name of the record, as in the log.
        quantities: What was read off it, keys of `QUANTITIES`.
        matrix: Covariance in error units: seconds (or radians) for `ADDITIVE`, else of
            ln, so relative.
    """

    record: str
    quantities: tuple[str, ...]
    matrix: Float[np.ndarray, "quantity quantity"]

    def __post_init__(self):
        count = len(self.quantities)
        where = f"the covariance of record {shown(self.record)}"
        if len(set(self.quantities)) < count:
            raise ValueError(f"{where}: expected each quantity once")
        if self.matrix.shape != (count, count):
            raise ValueError(
                f"{where}: expected shape ({count}, {count}), got {self.matrix.shape}"
            )
        if not np.isfinite(self.matrix).all() or (np.diag(self.matrix) <= 0).any():
            raise ValueError(
                f"{where}: expected finite numbers and positive variances, got "
                f"variances {np.diag(self.matrix)}"
            )
        skew = np.abs(self.correlation - self.correlation.T)
        if (skew > SYMMETRIC).any():
            raise ValueError(f"{where}: expected a symmetric matrix")
        if (least := self.own_share) <= 0:
            raise ValueError(
                f"{where}: expected it positive definite, got a correlation matrix "
                f"whose smallest eigenvalue is {least:.3g}"
            )

    @property
    def sd(self) -> Float[np.ndarray, " quantity"]:
        """Return the standard deviation of each error."""
        return np.sqrt(np.diag(self.matrix))

    @property
    def correlation(self) -> Float[np.ndarray, "quantity quantity"]:
        """Return the covariance of errors in standard deviations."""
        return self.matrix / self.sd[:, None] / self.sd[None, :]

    @property
    def own_share(self) -> float:
        """Return the share of each variance that no other quantity need share."""
        return float(np.linalg.eigvalsh(self.correlation)[0])

    def only(self, quantities: tuple[str, ...]) -> "RecordCovariance":
        """Return the covariance of some of the quantities, in the order given."""
        at = [self.quantities.index(quantity) for quantity in quantities]
        return RecordCovariance(self.record, quantities, self.matrix[np.ix_(at, at)])


@dataclass(frozen=True)
class Understood:
    """Something that was converted, skipped or supplied while a log was read.

    Findings are typed where they are found and worded in `report.understood`.
    """


@dataclass(frozen=True)
class Observations:
    """A tidy table: row i of every field belongs to measurement i.

    Attributes:
        sensor: Who measured.
        quantity: What, a key of `QUANTITIES`.
        value: How much, in the unit the quantity's name ends in.
        sigma: Its standard deviation, same unit; NaN leaves the law's scatter alone.
        position: East, north, up of the sensor [m]; NaN where unknown.
        slant_range: Distance from the charge [m]; NaN where a position gives it.
        time: Clock time of the measurement [s]; NaN but for `quantities.TIMED`.
        path: Name of the way the wave took; "" where unsaid (then the sensor is it).
        shot: Name of the event; "" where the log has only one.
        clock: Name of the recorder; "" for the common clock.
        line: Line of the file each row stood on.
        source: The file, or "" if it was made here.
        comments: What stood behind the # of comment lines, kept as provenance.
        lower_bound: Whether each value is a lower bound of what was measured, as the
            peak of a record that is clipped; None if none is. Its sigma is that of a
            reading of the value.
        frame: Where on the Earth positions are counted from, if anybody said.
        epoch: UTC of clock time zero, if anybody said.
        record: The file of samples, or the record, that each row came from; "" where
            unsaid, empty where no row says.
        understood: What the reader converted, skipped or supplied.
        covariances: How the errors of each record's quantities go together; errors of
            all else are independent.
    """

    sensor: tuple[str, ...]
    quantity: tuple[str, ...]
    value: Float[np.ndarray, " row"]
    sigma: Float[np.ndarray, " row"]
    position: Float[np.ndarray, "row 3"]
    slant_range: Float[np.ndarray, " row"]
    time: Float[np.ndarray, " row"]
    path: tuple[str, ...]
    shot: tuple[str, ...]
    clock: tuple[str, ...]
    line: tuple[int, ...] = ()
    source: str = ""
    comments: tuple[str, ...] = ()
    lower_bound: Bool[np.ndarray, " row"] | None = None
    frame: Frame | None = None
    epoch: datetime | None = None
    record: tuple[str, ...] = ()
    understood: tuple[Understood, ...] = ()
    covariances: tuple[RecordCovariance, ...] = ()

    def __len__(self) -> int:
        return len(self.value)

    def where(self, row: int) -> str:
        """Name the file and line of a row, or the row of a table made here."""
        source = self.source or "observations"
        if self.line:
            return f"{source}: {row_word(source)} {self.line[row]}"
        return f"{source}: row {row + 1}"

    def error_scale(self) -> Float[np.ndarray, " row"]:
        """Return each sigma as errors are: in its unit if `ADDITIVE`, or relative."""
        additive = np.isin(self.quantity, ADDITIVE)
        value = np.where(additive, 1.0, np.abs(self.value))  # an angle may be zero
        return self.sigma / value

    def bounds(self) -> Bool[np.ndarray, " row"]:
        """Return whether each value is a lower bound."""
        if self.lower_bound is None:
            return np.zeros(len(self), bool)
        return self.lower_bound

    def records(self) -> tuple[str, ...]:
        """Return the record that each row came from, "" where unsaid."""
        return self.record or ("",) * len(self)

    def clocks(self) -> tuple[str, ...]:
        """Return the name of each row's clock: its recorder, else its sensor."""
        return tuple(c or s for c, s in zip(self.clock, self.sensor, strict=True))

    def groups(self) -> tuple[str, ...]:
        """Return what the records of a row share: its path, else its sensor."""
        return tuple(p or s for p, s in zip(self.path, self.sensor, strict=True))


def observed(
    sensor: Sequence[str],
    quantity: Sequence[str],
    value: Sequence[float] | Float[np.ndarray, " row"],
    sigma: Sequence[float] | Float[np.ndarray, " row"],
    **others: Any,
) -> Observations:
    """Return a log that is made here: what is not told of its rows is unknown.

    Args:
        sensor: As in `Observations`, and so all others.
        quantity: What was measured.
        value: How much.
        sigma: Its standard deviation.
        **others: Other fields.
    """
    rows = len(sensor)
    unknown, unsaid = np.full(rows, np.nan), ("",) * rows
    untold = {
        "position": np.full((rows, 3), np.nan),
        "slant_range": unknown,
        "time": unknown,
        "path": unsaid,
        "shot": unsaid,
        "clock": unsaid,
    }
    return Observations(
        sensor=tuple(sensor),
        quantity=tuple(quantity),
        value=np.asarray(value, float),
        sigma=np.asarray(sigma, float),
        **(untold | others),
    )


def no_rows(source: str) -> Observations:
    """Return the log of a file in which nothing could be read."""
    return observed((), (), (), (), source=source)


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


class Faults:
    """Where a reader takes what it cannot use.

    Args:
        gathered: Faults are appended here, and reading goes on; None: the first is
            raised.
    """

    def __init__(self, gathered: list[InputError] | None = None):
        self.gathered = gathered

    def tell(self, fault: InputError) -> None:
        """Take a fault that the rest of the log can be read without.

        Raises:
            InputError: The fault, where nobody gathers them.
        """
        if self.gathered is None:
            raise fault
        self.gathered.append(fault)


def row_word(source: str) -> str:
    """Return what a row of a source is called: text has lines."""
    suffix = PurePath(source).suffix.lower()
    sheets = suffix in WORKBOOKS or suffix in PARQUET or source == FRAME
    return "row" if sheets else "line"
