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
from jblast.quantities import ADDITIVE

NEEDED = ("sensor", "quantity", "value", "sigma")
POSITION = ("east_m", "north_m", "up_m")
DEGREES = ("lat_deg", "lon_deg", "alt_m")
NAME_COLUMNS = ("path", "shot", "clock", "record")
"""Optional columns of names."""
COLUMNS = (
    *(*NEEDED[:3], "value_utc", "sigma"),
    *(*POSITION, *DEGREES, "range_m", "time_s", *NAME_COLUMNS),
)
"""Every column of a file, in the order of `write`."""
NUMBERS = ("value", "sigma", *POSITION, *DEGREES, "range_m", "time_s")
"""Columns of numbers."""
SAMPLES = "overpressure_record"
"""Quantity of a row that is a record of samples, a file named in column `record`."""
RECORD_QUANTITIES = (
    *("air_arrival_s", "peak_overpressure_pa"),
    *("positive_duration_s", "positive_impulse_pa_s"),
)
"""Quantities read from a record of samples, in the order of a pick's covariance."""
SYMMETRIC = 1e-9
"""Largest asymmetry of a correlation matrix: well above rounding of written digits, far
below any real difference between two entries."""
TEXTS = ("", ".csv", ".tsv", ".tab", ".txt", ".dat", ".log")
"""Suffixes of files that are read as text."""
WORKBOOKS = {".xlsx": "openpyxl", ".xlsm": "openpyxl", ".ods": "odf"}
"""Suffixes of spreadsheets, and the engines of pandas for them."""
PARQUET = (".parquet", ".pq")
FRAME = "data frame"
"""Source name of a log from a data frame."""


@dataclass(frozen=True)
class RecordCovariance:
    """The covariance of the errors of one record's quantities.

    A record's noise moves its peak, duration and impulse together. Rows of a log whose
    `record` is this one and whose quantity is listed here share these errors.

    Attributes:
        record: Name of the record, as in the log.
        quantities: Its readings, keys of `quantities.QUANTITIES`.
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
        # of the correlation, since variances differ by many orders of magnitude
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
        """Return the share of each variance that is independent of other quantities."""
        # the smallest eigenvalue of the correlation can be subtracted from the diagonal
        return float(np.linalg.eigvalsh(self.correlation)[0])

    def only(self, quantities: tuple[str, ...]) -> "RecordCovariance":
        """Return the covariance of some of the quantities, in the order given."""
        at = [self.quantities.index(quantity) for quantity in quantities]
        return RecordCovariance(self.record, quantities, self.matrix[np.ix_(at, at)])


@dataclass(frozen=True)
class Understood:
    """Something that was converted, skipped or supplied while a log was read.

    Each kind is a subclass, with its sentence in `report.understood`.
    """


@dataclass(frozen=True)
class Observations:
    """A tidy table: row i of every field belongs to measurement i.

    Attributes:
        sensor: Name of the sensor.
        quantity: A key of `quantities.QUANTITIES`, or `SAMPLES`.
        value: The measured value, in the unit at the end of the quantity's name.
        sigma: Its standard deviation, same unit; NaN for the law's scatter only.
        position: East, north, up of the sensor [m]; NaN where unknown.
        slant_range: Distance from the charge [m]; NaN where a position gives it.
        time: Clock time of the measurement [s]; NaN except for `quantities.TIMED`.
        path: Name of the path of the wave; "" for that of the sensor.
        shot: Name of the event; "" where the log has only one.
        clock: Name of the recorder; "" for the common clock.
        line: Line of each row in the file.
        source: The file, or "" for a log made in Python.
        comments: Comments without their #, as provenance.
        lower_bound: True for values that are lower bounds, as the peak of a clipped
            record; None if none is. Their sigma is that of a reading of the value.
        frame: Origin of positions on the Earth, if it is known.
        epoch: UTC of clock time zero, if it is known.
        record: The file of samples, or the record, of each row; "" for none, empty if
            all rows have none.
        understood: Conversions, omissions and additions of the reader.
        covariances: Covariances of the errors of each record's quantities; all other
            errors are independent.
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
        """Return the file and line of a row, or its number in a log made in Python."""
        source = self.source or "observations"
        if self.line:
            return f"{source}: {row_word(source)} {self.line[row]}"
        return f"{source}: row {row + 1}"

    def error_scale(self) -> Float[np.ndarray, " row"]:
        """Return each sigma in error units: its own if `ADDITIVE`, else relative."""
        additive = np.isin(self.quantity, ADDITIVE)
        # additive quantities, as angles, may be zero: no division by them
        value = np.where(additive, 1.0, np.abs(self.value))
        return self.sigma / value

    def bounds(self) -> Bool[np.ndarray, " row"]:
        """Return True for values that are lower bounds."""
        if self.lower_bound is None:
            return np.zeros(len(self), bool)
        return self.lower_bound

    def records(self) -> tuple[str, ...]:
        """Return the record of each row, "" for none."""
        return self.record or ("",) * len(self)

    def clocks(self) -> tuple[str, ...]:
        """Return the name of each row's clock: its recorder, else its sensor."""
        return tuple(c or s for c, s in zip(self.clock, self.sensor, strict=True))

    def groups(self) -> tuple[str, ...]:
        """Return the group of each row by path error: its path, else its sensor."""
        return tuple(p or s for p, s in zip(self.path, self.sensor, strict=True))


def observed(
    sensor: Sequence[str],
    quantity: Sequence[str],
    value: Sequence[float] | Float[np.ndarray, " row"],
    sigma: Sequence[float] | Float[np.ndarray, " row"],
    **others: Any,
) -> Observations:
    """Return a log made in Python; fields that are not given are unknown.

    Args:
        sensor: As in `Observations`, likewise all others.
        quantity: The measured quantities.
        value: The measured values.
        sigma: Its standard deviation.
        **others: Other fields.
    """
    rows = len(sensor)
    unknown, empty = np.full(rows, np.nan), ("",) * rows
    defaults = {
        "position": np.full((rows, 3), np.nan),
        "slant_range": unknown,
        "time": unknown,
        "path": empty,
        "shot": empty,
        "clock": empty,
    }
    return Observations(
        sensor=tuple(sensor),
        quantity=tuple(quantity),
        value=np.asarray(value, float),
        sigma=np.asarray(sigma, float),
        **(defaults | others),
    )


@dataclass(frozen=True)
class Dialect(Understood):
    """Properties of the format of a file that differ from ours.

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
        line: Of a number that shows it.
        text: That number as written.
    """

    line: int
    text: str


@dataclass(frozen=True)
class Renamed(Understood):
    """A column or quantity in our unit under another name.

    Attributes:
        theirs: As written.
        ours: Our name for it.
    """

    theirs: str
    ours: str


@dataclass(frozen=True)
class Converted(Understood):
    """A column or quantity in another unit than ours.

    Attributes:
        theirs: As written.
        ours: Our column or quantity.
        unit: Ending of a name in this unit: "psi_ms".
        factor: Factor applied to values.
        rows: Number of rows.
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
        rows: Number of rows.
    """

    theirs: str
    rows: int


@dataclass(frozen=True)
class ClockTimesTaken(Understood):
    """Clock times without a day or zone, or with one other than UTC.

    Attributes:
        date: The day used for times without one.
        undated: Their number.
        zone: The zone used for times without one.
        unzoned: Their number.
        moved: Number of times with an offset of their own, converted to UTC.
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
        lines: Their lines.
    """

    lines: tuple[int, ...]


@dataclass(frozen=True)
class HeightTaken(Understood):
    """Sensors without a height, set to up = 0."""


@dataclass(frozen=True)
class LongitudesWrapped(Understood):
    """Longitudes from 180 to 360 degrees east, which are west.

    Attributes:
        rows: Number of rows.
    """

    rows: int


@dataclass(frozen=True)
class ColumnsIgnored(Understood):
    """Columns of notes, which are ignored.

    Attributes:
        names: As written.
    """

    names: tuple[str, ...]


@dataclass(frozen=True)
class UnitsRow(Understood):
    """A row of units of the columns.

    Attributes:
        line: Its line.
    """

    line: int


@dataclass(frozen=True)
class MadeLong(Understood):
    """A table with a column for each quantity.

    Attributes:
        quantities: Names of those columns, as written.
        without_sigma: Those without errors, for the law's scatter only.
        shares: Those with errors in per cent of their values.
    """

    quantities: tuple[str, ...]
    without_sigma: tuple[str, ...]
    shares: tuple[str, ...] = ()


class Faults:
    """Faults of a source, which are gathered or raised.

    Args:
        gathered: Faults are appended here, and reading continues; None: the first is
            raised.
    """

    def __init__(self, gathered: list[InputError] | None = None):
        self.gathered = gathered

    def add(self, fault: InputError) -> None:
        """Report a fault that leaves the rest of the log readable.

        Raises:
            InputError: The fault, unless faults are gathered.
        """
        if self.gathered is None:
            raise fault
        self.gathered.append(fault)


def row_word(source: str) -> str:
    """Return the word for a row of a source: "line" of text, else "row"."""
    # a text editor counts lines, a spreadsheet rows
    suffix = PurePath(source).suffix.lower()
    sheets = suffix in WORKBOOKS or suffix in PARQUET or source == FRAME
    return "row" if sheets else "line"
