"""The log row by row: what was measured, what the law says, who is suspected."""

from dataclasses import dataclass
from pathlib import PurePosixPath

import numpy as np

from jblast.inference.fitting.result import Fit
from jblast.quantities import ADDITIVE
from jblast.report.numbers import printed_number, rounded, significant, unit_for
from jblast.report.words import quantity_words

MOST_ROWS = 200
"""A table of residuals has at most so many rows."""


@dataclass(frozen=True)
class Row:
    """One row of the residual table, ready to print."""

    line: str
    sensor: str
    quantity: str
    range: str
    measured: str
    predicted: str
    sd: str
    residual: str
    suspected: bool


def log_name(fit: Fit) -> str:
    """Return the log's file name without its folder, or "" for one made here."""
    return PurePosixPath(fit.observations.source.replace("\\", "/")).name


def outlier_rows(fit: Fit) -> tuple[int, ...]:
    """Return the rows that `suspected_outliers` names.

    A sensor may give a quantity twice; then the row nearest to the named residual.
    """
    table, found = fit.observations, []
    for outlier in fit.summary.suspected_outliers:
        rows = [
            i
            for i in range(len(table))
            if (table.sensor[i], table.quantity[i])
            == (outlier.sensor, outlier.quantity)
        ]
        if rows:
            gap = [abs(abs(fit.residual[i]) - abs(outlier.sds)) for i in rows]
            found.append(rows[int(np.argmin(gap))])
    return tuple(dict.fromkeys(found))


def residual_rows(fit: Fit) -> list[Row]:
    """Return the log's rows in order; of a long log the largest residuals alone."""
    rows = np.arange(len(fit.observations))
    if len(rows) > MOST_ROWS:
        worst = np.argsort(-np.abs(np.nan_to_num(fit.residual, nan=np.inf)))
        rows = np.sort(worst[:MOST_ROWS])
    suspected = outlier_rows(fit)
    return [_row(fit, int(i), int(i) in suspected) for i in rows]


def _row(fit: Fit, i: int, suspected: bool) -> Row:
    table = fit.observations
    quantity, value, sd = table.quantity[i], float(table.value[i]), float(fit.sd[i])
    predicted, residual = float(fit.predicted[i]), float(fit.residual[i])
    in_unit = sd if quantity in ADDITIVE else abs(value) * sd
    unit = unit_for(quantity, value, predicted if np.isfinite(predicted) else None)

    def show(number: float) -> str:
        if not np.isfinite(number):
            return "-"
        if not (np.isfinite(in_unit) and in_unit > 0.0):
            return f"{significant(number / unit.size, 4)} {unit.symbol}"
        return f"{rounded(number / unit.size, in_unit / unit.size)} {unit.symbol}"

    if not np.isfinite(sd):
        shown_sd = "-"
    elif quantity in ADDITIVE:
        shown_sd = printed_number(quantity, sd, 2)
    else:
        shown_sd = f"{significant(100.0 * sd)} %"
    distance = float(fit.distance[i])
    return Row(
        line=str(table.line[i]) if i < len(table.line) else str(i + 1),
        sensor=table.sensor[i],
        quantity=quantity_words(quantity),
        range=printed_number("_m", distance) if np.isfinite(distance) else "-",
        measured=show(value),
        predicted=show(predicted),
        sd=shown_sd,
        residual=f"{residual:+.2f}" if np.isfinite(residual) else "-",
        suspected=suspected,
    )
