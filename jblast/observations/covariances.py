"""Covariances of the errors of one record's readings, and the file that contains them.

`LOG.covariance.csv`, next to `LOG.csv`, has one row for each pair of quantities
of a record, in error units: seconds for times, the natural logarithm (so relative) for
other quantities. It is read with the log. Each sigma of the log must agree with its
covariance within 1 %, which allows for rounded digits, and a matrix must be positive
definite; otherwise the file is refused.
"""

import math
import os
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from jaxtyping import Int

from jblast.errors import InputError, nearest, read_bytes, shown
from jblast.files import write_text
from jblast.observations.table import Observations, RecordCovariance, quoted
from jblast.observations.text_table import Table, number_of, text_table
from jblast.quantities import ADDITIVE, QUANTITIES

SIGMA_TOLERANCE = 0.01
"""Relative tolerance between a sigma of the log and its covariance: sigmas are written
with three digits or more, and a difference of 1 % changes no interval visibly."""
COLUMNS = ("record", "quantity", "with", "covariance")


def with_covariances(observations: Observations) -> Observations:
    """Return a log with the covariances of its side file, if there is one.

    Raises:
        InputError: The side file is faulty, or disagrees with the log.
    """
    path = covariance_file(observations.source)
    if not len(observations) or not path.is_file():
        return observations
    if not any(observations.record):
        raise InputError(
            f"{observations.source}: expected a column record, since {path} has the "
            "covariances of records; got none"
        )
    both = replace(observations, covariances=read_covariances(path))
    # the generator checks each record against the log, so it is exhausted here
    list(rows_with_covariance(both))
    return both


def rows_with_covariance(
    observations: Observations,
) -> Iterator[tuple[Int[np.ndarray, " quantity"], RecordCovariance]]:
    """Yield the rows of each record with correlated errors, and their covariance.

    Quantities without a row in the log are left out.

    Raises:
        InputError: A sigma disagrees with its covariance, or a quantity of a record
            has two rows.
    """
    # an index by record and quantity: a search per pair would be quadratic
    rows_of: dict[tuple[str, str], list[int]] = {}
    keys = zip(observations.records(), observations.quantity, strict=True)
    for row, key in enumerate(keys):
        rows_of.setdefault(key, []).append(row)
    scale = observations.error_scale()
    for covariance in observations.covariances:
        rows, present = [], []
        for quantity, sd in zip(covariance.quantities, covariance.sd, strict=True):
            at = rows_of.get((covariance.record, quantity), [])
            if len(at) > 1:
                raise observations.fault(
                    at[1],
                    f"{quantity} of record {shown(covariance.record)}: expected one "
                    "row, since its errors are shared with others of the record; got "
                    f"{len(at)}",
                )
            for row in at:
                _refuse_other_sigma(observations, row, float(scale[row]), float(sd))
                rows.append(row)
                present.append(quantity)
        if rows:
            # a marginal of a normal distribution is that part of its matrix
            yield np.array(rows), covariance.only(tuple(present))


def _refuse_other_sigma(
    observations: Observations, row: int, scale: float, sd: float
) -> None:
    """Refuse a row whose sigma is not that of its covariance."""
    if abs(scale - sd) <= SIGMA_TOLERANCE * sd:
        return
    quantity = observations.quantity[row]
    unit = 1.0 if quantity in ADDITIVE else abs(float(observations.value[row]))
    got = "nothing" if math.isnan(scale) else f"{scale * unit:.6g}"
    raise observations.fault(
        row,
        f"expected {sd * unit:.6g}, as the covariance of {quantity} in record "
        f"{shown(observations.record[row])}; got {got}: correct one, or remove the "
        "record from the covariances",
        "sigma",
    )


def covariance_file(log: str | os.PathLike[str]) -> Path:
    """Return the path of a log's covariances: `picks.covariance.csv`."""
    return Path(log).with_suffix(".covariance.csv")


def read_covariances(path: str | os.PathLike[str]) -> tuple[RecordCovariance, ...]:
    """Read a side file; each pair of quantities is in it once, or twice identically.

    Raises:
        InputError: The file is not as described; the message has the place and fault.
    """
    expected = f"a header {','.join(COLUMNS)}"
    table = text_table(read_bytes(path, expected), str(path), expected=expected)
    if sorted(table.header) != sorted(COLUMNS):
        raise InputError(
            f"{table.at(table.header_line)}: expected {expected}, got "
            f"{shown(','.join(table.header))}"
        )
    if table.faults:
        raise table.faults[0]
    found: dict[str, dict[tuple[str, str], float]] = {}
    columns = [table.columns[table.header.index(name)] for name in COLUMNS]
    for line, record, *pair, text in zip(table.lines, *columns, strict=True):
        one, other = _checked(table, line, record, *pair)
        value = number_of(text)
        if not math.isfinite(value):
            got = shown(text) if text else "nothing"
            raise InputError(
                f"{table.at(line, COLUMNS[3])}: expected a number, got {got}"
            )
        pairs = found.setdefault(record, {})
        if pairs.setdefault((one, other), value) != value:
            raise InputError(
                f"{table.at(line)}: expected one covariance of {one} with {other}, "
                f"got {pairs[one, other]:g} and {value:g}"
            )
        # a pair may be written in either order, or in both with equal values
        pairs[other, one] = value
    return tuple(_matrix(str(path), name, pairs) for name, pairs in found.items())


def _checked(
    table: Table, line: int, record: str, one: str, other: str
) -> tuple[str, str]:
    """Return two quantities, and refuse a row without a record.

    Raises:
        InputError: A quantity is unknown, or there is no record.
    """
    if not record:
        raise InputError(f"{table.at(line, 'record')}: expected a name, got nothing")
    for column, name in (("quantity", one), ("with", other)):
        if name not in QUANTITIES:
            raise InputError(
                f"{table.at(line, column)}: unknown quantity {shown(name)}"
                f"{nearest(name, QUANTITIES)}"
            )
    return one, other


def _matrix(
    path: str, record: str, pairs: dict[tuple[str, str], float]
) -> RecordCovariance:
    """Combine the pairs of one record into a matrix."""
    names = tuple(dict.fromkeys(name for pair in pairs for name in pair))
    missing = [(a, b) for a in names for b in names if (a, b) not in pairs]
    if missing:
        one, other = missing[0]
        raise InputError(
            f"{path}: record {shown(record)}: expected a covariance of {one} with "
            f"{other}, got none"
        )
    matrix = np.array([[pairs[one, other] for other in names] for one in names])
    try:
        return RecordCovariance(record, names, matrix)
    except ValueError as error:
        raise InputError(f"{path}: {error}") from None


def write_covariances(log: str | os.PathLike[str], observations: Observations) -> None:
    """Write the side file of a log, or remove it if the log has no covariances."""
    path = covariance_file(log)
    if not observations.covariances:
        # an old side file would be read with the new log
        path.unlink(missing_ok=True)
        return
    lines = [
        # repr is the shortest text that reads back as the same number
        ",".join((quoted(of.record), quantity, other, repr(float(of.matrix[i, j]))))
        for of in observations.covariances
        for i, quantity in enumerate(of.quantities)
        # the lower triangle is enough: the matrix is symmetric
        for j, other in enumerate(of.quantities[: i + 1])
    ]
    write_text(path, "\n".join((",".join(COLUMNS), *lines)) + "\n")
