"""Covariances of the errors of one record's readings, and the file that contains them.

`LOG.covariance.csv`, next to `LOG.csv`, has one row for each pair of quantities
of a record, in error units: seconds for times, the natural logarithm (so relative) for
other quantities. It is read with the log. Each sigma of the log must agree with its
covariance within 1 %, which allows for rounded digits, and a matrix must be positive
definite; otherwise the file is refused.
"""

import csv
import math
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Int

from jblast.errors import InputError, nearest, read_text, shown
from jblast.files import write_text
from jblast.observations.table import Faults, Observations, RecordCovariance
from jblast.quantities import ADDITIVE, QUANTITIES

SIGMA_TOLERANCE = 0.01
"""Relative tolerance between a sigma of the log and its covariance: sigmas are written
with three digits or more, and a difference of 1 % changes no interval visibly."""
COLUMNS = ("record", "quantity", "with", "covariance")
COVARIANCES = "covariances"
"""Key of the same rows in the `attrs` of a data frame."""


def with_covariances(
    observations: Observations,
    faults: Faults,
    rows: Sequence[Mapping[str, Any]] | None = None,
) -> Observations:
    """Return a log with the covariances of its side file, if there is one.

    Args:
        observations: A log as read.
        faults: Collects faults of the side file, and disagreements with the log, which
            is then returned unchanged.
        rows: Result of `covariance_rows`, in place of a side file.
    """
    path = covariance_file(observations.source)
    where = str(path) if rows is None else f"{observations.source}: covariances"
    # the side file is optional, and a data frame has rows in its attributes instead
    there = path.is_file() if rows is None else bool(rows)
    if not len(observations) or not there:
        return observations
    try:
        if not any(observations.record):
            raise InputError(
                f"{observations.source}: expected a column record, since {where} has "
                "the covariances of records; got none"
            )
        found = read_covariances(path) if rows is None else covariances_of(rows, where)
        both = replace(observations, covariances=found)
        # the generator checks each record against the log, so it is exhausted here
        list(rows_with_covariance(both))
    except InputError as fault:
        faults.add(fault)
        return observations
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
                raise InputError(
                    f"{observations.where(at[1])}: {quantity} of record "
                    f"{shown(covariance.record)}: expected one row, since its errors "
                    f"are shared with others of the record; got {len(at)}"
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
    raise InputError(
        f"{observations.where(row)}, column sigma: expected {sd * unit:.6g}, as the "
        f"covariance of {quantity} in record {shown(observations.record[row])}; "
        f"got {got}: correct one, or remove the record from the covariances"
    )


def covariance_file(log: str | os.PathLike[str]) -> Path:
    """Return the path of a log's covariances: `picks.covariance.csv`."""
    return Path(log).with_suffix(".covariance.csv")


def read_covariances(path: str | os.PathLike[str]) -> tuple[RecordCovariance, ...]:
    """Read a side file; each pair of quantities is in it once, or twice identically.

    Raises:
        InputError: The file is not as described; the message has the place and fault.
    """
    text = read_text(path, "a CSV file of covariances")
    lines = [
        (number, line)
        for number, line in enumerate(text.split("\n"), start=1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    fields = [(n, [f.strip() for f in next(csv.reader([line]))]) for n, line in lines]
    header = fields[0][1] if fields else []
    # columns may be in any order, as in a log
    if sorted(header) != sorted(COLUMNS):
        raise InputError(
            f"{path}: line {fields[0][0] if fields else 1}: expected a header "
            f"{','.join(COLUMNS)}, got {shown(','.join(header)) if header else 'none'}"
        )
    rows = []
    for number, entries in fields[1:]:
        where = f"{path}: line {number}"
        if len(entries) != len(COLUMNS):
            raise InputError(f"{where}: expected 4 fields, got {len(entries)}")
        rows.append((where, dict(zip(header, entries, strict=True))))
    return _covariances(str(path), rows)


def covariances_of(
    rows: Sequence[Mapping[str, Any]], source: str
) -> tuple[RecordCovariance, ...]:
    """Return the covariances of rows as from `covariance_rows`.

    Args:
        rows: Rows of one pair of quantities each.
        source: Their name in messages.

    Raises:
        InputError: They are not as described; the message has the place and fault.
    """
    named = []
    for number, row in enumerate(rows, start=1):
        where = f"{source}: row {number}"
        if sorted(row) != sorted(COLUMNS):
            raise InputError(
                f"{where}: expected {', '.join(COLUMNS)}, got {', '.join(row)}"
            )
        named.append((where, {name: str(row[name]) for name in COLUMNS}))
    return _covariances(source, named)


def covariance_rows(observations: Observations) -> list[dict[str, Any]]:
    """Return the rows of a side file, one for each pair of a record's quantities.

    Its keys are `COLUMNS`.
    """
    return [
        dict(
            zip(
                COLUMNS,
                (of.record, quantity, other, float(of.matrix[i, j])),
                strict=True,
            )
        )
        for of in observations.covariances
        for i, quantity in enumerate(of.quantities)
        # the lower triangle is enough: the matrix is symmetric
        for j, other in enumerate(of.quantities[: i + 1])
    ]


def write_covariances(log: str | os.PathLike[str], observations: Observations) -> None:
    """Write the side file of a log, or remove it if the log has no covariances."""
    path = covariance_file(log)
    if not observations.covariances:
        # an old side file would be read with the new log
        path.unlink(missing_ok=True)
        return
    lines = [",".join(COLUMNS)]
    for row in covariance_rows(observations):
        record = quoted(row["record"])
        # repr is the shortest text that reads back as the same number
        value = repr(row["covariance"])
        lines.append(",".join((record, row["quantity"], row["with"], value)))
    write_text(path, "\n".join(lines) + "\n")


def _covariances(
    source: str, rows: Iterable[tuple[str, dict[str, str]]]
) -> tuple[RecordCovariance, ...]:
    """Combine rows, each with its place for messages, into matrices."""
    found: dict[str, dict[tuple[str, str], float]] = {}
    for where, row in rows:
        pair = _pair(where, row)
        value = _number(where, row["covariance"])
        pairs = found.setdefault(row["record"], {})
        if pairs.setdefault(pair, value) != value:
            raise InputError(
                f"{where}: expected one covariance of {pair[0]} with {pair[1]}, "
                f"got {pairs[pair]:g} and {value:g}"
            )
        # a pair may be written in either order, or in both with equal values
        pairs[pair[1], pair[0]] = value
    return tuple(_matrix(source, name, pairs) for name, pairs in found.items())


def _pair(where: str, row: dict[str, str]) -> tuple[str, str]:
    """Return two quantities, and refuse a row without a record."""
    if not row["record"]:
        raise InputError(f"{where}, column record: expected a name, got nothing")
    for column in ("quantity", "with"):
        name = row[column]
        if name not in QUANTITIES:
            raise InputError(
                f"{where}, column {column}: unknown quantity {shown(name)}"
                f"{nearest(name, QUANTITIES)}"
            )
    return row["quantity"], row["with"]


def _number(where: str, text: str) -> float:
    """Return a finite number."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        got = shown(text) if text else "nothing"
        raise InputError(f"{where}, column covariance: expected a number, got {got}")
    return value


def _matrix(
    path: str, record: str, pairs: dict[tuple[str, str], float]
) -> RecordCovariance:
    """Combine the pairs of one record into a matrix."""
    names = tuple(dict.fromkeys(name for pair in pairs for name in pair))
    for one in names:
        for other in names:
            if (one, other) not in pairs:
                raise InputError(
                    f"{path}: record {shown(record)}: expected a covariance of {one} "
                    f"with {other}, got none"
                )
    matrix = np.array([[pairs[one, other] for other in names] for one in names])
    try:
        return RecordCovariance(record, names, matrix)
    except ValueError as error:
        raise InputError(f"{path}: {error}") from None


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
