"""The side file of a log: how the errors of each record's quantities go together.

Beside `LOG.csv` stands `LOG.covariance.csv`, a row a pair of quantities of a record, in
error units: seconds for times, ln (so relative) for the rest. It is read with the log.
"""

import csv
import math
import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from jblast.errors import InputError, nearest, read_text, shown
from jblast.files import write_text
from jblast.observations.record_covariance import RecordCovariance
from jblast.observations.records.csv_fields import quoted
from jblast.observations.table import Observations
from jblast.quantity_table import QUANTITIES

COLUMNS = ("record", "quantity", "with", "covariance")
COVARIANCES = "covariances"
"""Where a data frame has the same in `attrs`, a list of rows."""


def covariance_file(log: str | os.PathLike[str]) -> Path:
    """Return where the covariances of a log stand: `picks.covariance.csv`."""
    return Path(log).with_suffix(".covariance.csv")


def read_covariances(path: str | os.PathLike[str]) -> tuple[RecordCovariance, ...]:
    """Read a side file; each pair of quantities stands in it once, or twice alike.

    Raises:
        InputError: The file is not as described; the message says where and how.
    """
    text = read_text(path, "a CSV file of covariances")
    lines = [
        (number, line)
        for number, line in enumerate(text.split("\n"), start=1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    fields = [(n, [f.strip() for f in next(csv.reader([line]))]) for n, line in lines]
    header = fields[0][1] if fields else []
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
    """Return the covariances that `covariance_rows` gave rows of.

    Args:
        rows: A pair of quantities each.
        source: What they are called in messages.

    Raises:
        InputError: They are not as described; the message says where and how.
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
    """Return what the side file of a log holds: a row a pair of a record's quantities.

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
        for j, other in enumerate(of.quantities[: i + 1])
    ]


def write_covariances(log: str | os.PathLike[str], observations: Observations) -> None:
    """Write the side file of a log; take away that of a log which has none now."""
    path = covariance_file(log)
    if not observations.covariances:
        path.unlink(missing_ok=True)
        return
    lines = [",".join(COLUMNS)]
    for row in covariance_rows(observations):
        record = quoted(row["record"])
        value = repr(row["covariance"])
        lines.append(",".join((record, row["quantity"], row["with"], value)))
    write_text(path, "\n".join(lines) + "\n")


def _covariances(
    source: str, rows: Iterable[tuple[str, dict[str, str]]]
) -> tuple[RecordCovariance, ...]:
    """Put rows together, each told where it stands."""
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
    """Put the pairs of one record together."""
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
