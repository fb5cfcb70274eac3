"""What was measured: one row a measurement."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from importlib import import_module
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from jblast.errors import InputError
from jblast.observations.formats import row_word
from jblast.observations.places.frame import Frame
from jblast.observations.record_covariance import RecordCovariance
from jblast.observations.understood import Understood
from jblast.quantities import ADDITIVE, CLOCK_TIMES as CLOCK_TIMES, TIMES as TIMES
from jblast.quantity_table import QUANTITIES as QUANTITIES

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

    @classmethod
    def from_pandas(
        cls,
        frame: Any,
        *,
        strict: bool = False,
        wide: bool = False,
        faults: list[InputError] | None = None,
        date: str | None = None,
        zone: str | None = None,
    ) -> "Observations":
        """Return the log that a data frame holds, read as a file of it would be.

        Args:
            frame: A `pandas.DataFrame`; levels of its index that have names are
                columns. A column `lower_bound` says which values are no less.
            strict: As `read` takes it, and so all below.
            wide: Whether each quantity has a column of its own.
            faults: Every fault is appended here.
            date: The day of times without one.
            zone: The zone of times without one.

        Raises:
            InputError: It is no log.
        """
        options = {"strict": strict, "wide": wide, "date": date, "zone": zone}
        return _exchange().from_pandas(frame, faults=faults, **options)

    def to_pandas(self) -> Any:
        """Return the log as a `pandas.DataFrame`, columns as `write` writes them.

        Lower bounds are told by a column `lower_bound`; comments, the source, the units
        of columns and `covariances`, the rows of the side file that `write` writes
        (`pandas.DataFrame(frame.attrs["covariances"])`), stand in `attrs`.
        `from_pandas` takes it.
        """
        return _exchange().to_pandas(self)

    def to_xarray(self) -> Any:
        """Return the log as an `xarray.Dataset` along `row`.

        Each quantity is a variable, NaN where a row is of another one, with
        `sigma_QUANTITY` beside it; who measured and where are coordinates; `units` and
        `long_name` are attributes.
        """
        return _exchange().to_xarray(self)

    def groups(self) -> tuple[str, ...]:
        """Return what the records of a row share: its path, else its sensor."""
        return tuple(p or s for p, s in zip(self.path, self.sensor, strict=True))


def _exchange() -> Any:
    """Import the reader and the writer, which make what stands here, when asked."""
    return import_module("jblast.observations.exchange")


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
