"""A log as a table of measurements, one a row, in SI units.

Positions are east, north and up [m] in a local frame, clock times are seconds from an
epoch. A missing number is NaN and a missing name is "". Errors of different rows are
independent, except those of one pressure record, whose covariance is stored per record
(`RecordCovariance`, positive definite, relative for quantities whose errors are
relative). Notes list what a reader converted, skipped or supplied.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields, replace
from datetime import datetime
from itertools import chain
from pathlib import PurePath
from typing import Any

import numpy as np

from jblast.errors import InputError, shown
from jblast.observations.places import Frame
from jblast.quantities import ADDITIVE
from jblast.results import Note
from jblast.types import Bool, Float, Int

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
WORKBOOK, PARQUET = "spreadsheet", "parquet"
FORMATS = {
    ".xlsx": ("Excel workbook", "openpyxl", WORKBOOK),
    ".xlsm": ("Excel workbook", "openpyxl", WORKBOOK),
    ".ods": ("OpenDocument spreadsheet", "odf", WORKBOOK),
    ".parquet": ("Parquet file", "pyarrow", PARQUET),
    ".pq": ("Parquet file", "pyarrow", PARQUET),
}
"""By suffix the name of a format, the package that reads it, and the extra with it."""
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
        count, of = len(self.quantities), self.matrix
        where = f"the covariance of record {shown(self.record)}"
        if len(set(self.quantities)) < count or of.shape != (count, count):
            raise ValueError(
                f"{where}: expected each quantity once, and a row and a column for it, "
                f"got {', '.join(self.quantities)} and shape {of.shape}"
            )
        # of the correlation, since variances differ by many orders of magnitude
        sound = np.isfinite(of).all() and (np.diag(of) > 0).all()
        skew = np.abs(self.correlation - self.correlation.T).max() if sound else np.nan
        if not (skew <= SYMMETRIC and self.own_share > 0):
            raise ValueError(
                f"{where}: expected it symmetric and positive definite, got "
                f"{of.tolist()}"
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
    understood: tuple[Note, ...] = ()
    covariances: tuple[RecordCovariance, ...] = ()

    def __len__(self) -> int:
        return len(self.value)

    def where(self, row: int) -> str:
        """Return the file and line of a row, or its number in a log made in Python."""
        source = self.source or "observations"
        # lines of several files have no meaning together
        word = row_word(source) if self.line else "row"
        return f"{source}: {word} {self.line_of(row)}"

    def line_of(self, row: int) -> int:
        """Return the line of a row, or its number in a log made in Python."""
        return self.line[row] if self.line else row + 1

    def fault(self, row: int, message: str, column: str = "") -> InputError:
        """Return an error in a row, perhaps in one of its columns."""
        of = f", column {column}" if column else ""
        text = f"{self.where(row)}{of}: {message}"
        return InputError(text, row=int(row), line=self.line_of(row))

    def error_scale(self) -> Float[np.ndarray, " row"]:
        """Return each sigma in error units: its own if `ADDITIVE`, else relative."""
        additive = np.isin(self.quantity, ADDITIVE)
        # additive quantities, as angles, may be zero: no division by them
        value = np.where(additive, 1.0, np.abs(self.value))
        return self.sigma / value

    def bounds(self) -> Bool[np.ndarray, " row"]:
        """Return True for values that are lower bounds."""
        return (
            np.zeros(len(self), bool) if self.lower_bound is None else self.lower_bound
        )

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
    defaults: dict[str, Any] = {"position": np.full((rows, 3), np.nan)}
    defaults |= dict.fromkeys(("slant_range", "time"), np.full(rows, np.nan))
    defaults |= dict.fromkeys(("path", "shot", "clock"), ("",) * rows)
    return Observations(
        sensor=tuple(sensor),
        quantity=tuple(quantity),
        value=np.asarray(value, float),
        sigma=np.asarray(sigma, float),
        **(defaults | others),
    )


def rows_by(
    keys: Iterable[Any], among: Bool[np.ndarray, " row"] | None = None
) -> dict[Any, list[int]]:
    """Return the rows of each key, in order of appearance.

    Args:
        keys: The key of each row.
        among: True for the rows that count; all by default.
    """
    found: dict[Any, list[int]] = {}
    for row, key in enumerate(keys):
        if among is None or among[row]:
            found.setdefault(key, []).append(row)
    return found


def some_rows(observations: Observations, rows: Int[np.ndarray, " _"]) -> Observations:
    """Return a log of some of the rows, by number from zero."""
    columns = {name: getattr(observations, name) for name in PER_ROW}
    picked: dict[str, Any] = {
        name: of[rows] if isinstance(of, np.ndarray) else tuple(of[row] for row in rows)
        for name, of in columns.items()
        # optional columns may be absent
        if of is not None and len(of) == len(observations)
    }
    return replace(observations, **picked)


OF_ALL = ("source", "comments", "frame", "epoch", "understood", "covariances")
"""Fields that belong to a log as a whole."""
PER_ROW = tuple(f.name for f in fields(Observations) if f.name not in OF_ALL)
"""Fields of a log that have one entry a row."""


def row_word(source: str) -> str:
    """Return the word for a row of a source: "line" of text, else "row"."""
    # a text editor counts lines, a spreadsheet rows
    is_sheet = PurePath(source).suffix.lower() in FORMATS
    return "row" if is_sheet or source == FRAME else "line"


def plain_text(text: str) -> str:
    """Return a text that is one line.

    Raises:
        ValueError: It has several lines, or outer blanks.
    """
    # control characters would end the line or be removed when it is read
    unreadable = any(c != "\t" and (ord(c) < 32 or ord(c) == 127) for c in text)
    if unreadable or text != text.strip():
        raise ValueError(
            "a name or comment must be one line without control characters or outer "
            f"spaces, got {text!r}"
        )
    return text


def quoted(name: str) -> str:
    """Return a name as CSV; a leading # would otherwise make its row a comment.

    Raises:
        ValueError: It has several lines, or outer blanks.
    """
    name = plain_text(name)
    # quotes within a quoted field are doubled (RFC 4180)
    if any(c in name for c in ',"') or name.startswith("#"):
        return '"' + name.replace('"', '""') + '"'
    return name


def stacked(logs: Sequence[Observations]) -> dict[str, Any]:
    """Return the fields that have one entry a row, of logs one after another."""
    # optional columns are filled, since another part may have them
    filled = [replace(of, lower_bound=of.bounds(), record=of.records()) for of in logs]
    parts = {name: [getattr(log, name) for log in filled] for name in PER_ROW}
    return {
        name: np.concatenate(of) if isinstance(of[0], np.ndarray) else tuple(chain(*of))
        for name, of in parts.items()
    }
