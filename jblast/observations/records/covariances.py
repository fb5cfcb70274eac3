"""The covariances of a log: those of its side file, and the rows that they are of."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from jaxtyping import Int

from jblast.errors import InputError, shown
from jblast.observations.faults import Faults
from jblast.observations.record_covariance import RecordCovariance
from jblast.observations.records.side_file import (
    covariance_file,
    covariances_of,
    read_covariances,
)
from jblast.observations.table import Observations
from jblast.quantities import ADDITIVE

AGREES = 0.01
"""A sigma of the log is that of its covariance to this share: a log may be rounded."""


def with_covariances(
    observations: Observations,
    faults: Faults,
    rows: Sequence[Mapping[str, Any]] | None = None,
) -> Observations:
    """Return a log with the covariances of its side file, if there is one.

    Args:
        observations: A log as read.
        faults: Told where the side file is not as described, or disagrees with the log,
            which is then returned as it was.
        rows: What `covariance_rows` gave, in place of a side file.
    """
    path = covariance_file(observations.source)
    where = str(path) if rows is None else f"{observations.source}: covariances"
    there = path.is_file() if rows is None else bool(rows)
    if not len(observations) or not there:
        return observations
    try:
        if not any(observations.record):
            raise InputError(
                f"{observations.source}: expected a column record, since {where} tells "
                "of the errors that rows of one record share; got none"
            )
        found = read_covariances(path) if rows is None else covariances_of(rows, where)
        both = replace(observations, covariances=found)
        list(rows_with_covariance(both))
    except InputError as fault:
        faults.tell(fault)
        return observations
    return both


def rows_with_covariance(
    observations: Observations,
) -> Iterator[tuple[Int[np.ndarray, " quantity"], RecordCovariance]]:
    """Give the rows of each record that share errors, and the covariance of these.

    Rows of a record that the log has no longer are left out.

    Raises:
        InputError: A sigma disagrees with its covariance, or a quantity of a record
            stands in two rows.
    """
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
            yield np.array(rows), covariance.only(tuple(present))


def _refuse_other_sigma(
    observations: Observations, row: int, scale: float, sd: float
) -> None:
    """Refuse a row whose sigma is not that of its covariance."""
    if abs(scale - sd) <= AGREES * sd:
        return
    quantity = observations.quantity[row]
    unit = 1.0 if quantity in ADDITIVE else abs(float(observations.value[row]))
    got = "nothing" if math.isnan(scale) else f"{scale * unit:.6g}"
    raise InputError(
        f"{observations.where(row)}, column sigma: expected {sd * unit:.6g}, as the "
        f"covariance of record {shown(observations.record[row])} says of {quantity}; "
        f"got {got}: correct one, or leave the record out there"
    )
