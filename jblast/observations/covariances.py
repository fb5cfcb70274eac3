"""Covariances of the errors of one record's readings, and the file that contains them.

`LOG.covariance.csv`, next to `LOG.csv`, has one row for each pair of quantities
of a record, in error units: seconds for times, the natural logarithm (so relative) for
other quantities. It is read with the log. Each sigma of the log must agree with its
covariance within 1 %, which allows for rounded digits, and a matrix must be positive
definite; otherwise the file is refused.
"""

import os
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from jaxtyping import Int

from jblast.errors import InputError, read_bytes, shown
from jblast.files import write_text
from jblast.observations.names import read_header
from jblast.observations.rules import Rows, Rule
from jblast.observations.table import Observations, RecordCovariance, quoted, rows_by
from jblast.observations.text_table import text_table
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
    log, scale = observations, observations.error_scale()
    rows_of = rows_by(zip(log.records(), log.quantity, strict=True))
    for covariance in log.covariances:
        record, present = covariance.record, {}
        for quantity, sd in zip(covariance.quantities, covariance.sd, strict=True):
            at = rows_of.get((record, quantity), [])
            if len(at) > 1:
                raise log.fault(
                    at[1],
                    f"{quantity} of record {shown(record)}: expected one row, since "
                    f"its errors are shared with others of the record; got {len(at)}",
                )
            for row in at:
                present[quantity] = row
                # false for NaN, so that a missing sigma is refused, too
                if abs(scale[row] - sd) <= SIGMA_TOLERANCE * sd:
                    continue
                unit = 1.0 if quantity in ADDITIVE else abs(log.value[row])
                missing, got = np.isnan(scale[row]), f"{scale[row] * unit:.6g}"
                raise log.fault(
                    row,
                    f"expected {sd * unit:.6g}, as the covariance of {quantity} in "
                    f"record {shown(record)}; got {'nothing' if missing else got}: "
                    "correct one, or remove the record from the covariances",
                    "sigma",
                )
        if present:
            # a marginal of a normal distribution is that part of its matrix
            yield np.array([*present.values()]), covariance.only(tuple(present))


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
    header = read_header(table, COLUMNS)
    if missing := [name for name in COLUMNS if name not in header]:
        raise InputError(
            f"{table.at(table.header_line)}: expected {expected}, got no column "
            f"{', '.join(missing)}"
        )
    rows = Rows(table, header)
    records, *pair = (rows.text(name) for name in COLUMNS[:3])
    values = rows.number("covariance").tolist()
    known = f"one of {', '.join(QUANTITIES)}"
    rows.refuse(
        [
            Rule("record", ~rows.given("record"), "a name"),
            Rule("covariance", ~rows.given("covariance"), "a number"),
            *(
                Rule(c, ~np.isin(rows.text(c), [*QUANTITIES]), known)
                for c in COLUMNS[1:3]
            ),
        ]
    )
    if rows.faults:
        raise rows.faults[0]
    found: dict[str, dict[tuple[str, str], float]] = {}
    for line, record, one, other, value in zip(
        table.lines, records, *pair, values, strict=True
    ):
        pairs = found.setdefault(record, {})
        # a pair may be written in either order, or in both with equal values
        for key in ((one, other), (other, one)):
            if pairs.setdefault(key, value) != value:
                raise InputError(
                    f"{table.at(line)}: expected one covariance of {one} with {other}, "
                    f"got {pairs[key]:g} and {value:g}"
                )
    covariances = []
    for record, pairs in found.items():
        names = tuple(dict.fromkeys(one for one, _ in pairs))
        try:
            matrix = np.array([[pairs[one, other] for other in names] for one in names])
            covariances.append(RecordCovariance(record, names, matrix))
        except KeyError as missing:
            raise InputError(
                f"{path}: record {shown(record)}: expected a covariance of "
                f"{' with '.join(missing.args[0])}, got none"
            ) from None
        except ValueError as error:
            raise InputError(f"{path}: {error}") from None
    return tuple(covariances)


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
