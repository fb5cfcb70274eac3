"""Rows of a log with the answer of a fit, and accepted values."""

from dataclasses import dataclass
from pathlib import PurePosixPath

import numpy as np

from jblast.inference.fitting.fit import Fit
from jblast.inference.fitting.summary import Summary
from jblast.inference.posterior.parameters import Estimate
from jblast.observations.rows import AT_LEAST
from jblast.quantities import ADDITIVE
from jblast.report.estimates import Accepted, outlier_rows, printed_estimate
from jblast.report.words import (
    finite,
    joined,
    parameter_words,
    printed_number,
    quantity_words,
    rounded,
    significant,
    unit_for,
)

MAX_ROWS = 200
"""Largest number of rows in a table of residuals: about four printed pages."""
MAX_NAMED = 5
"""Largest number of sensors with lower bounds that are named."""


@dataclass(frozen=True)
class Comparison:
    """An accepted value against the 90 % interval of the same parameter.

    Attributes:
        value: The accepted value with its unit.
        label: Source of the value.
        inside: Whether the interval contains it; None if there is no interval.
    """

    value: str
    label: str
    inside: bool | None

    @property
    def verdict(self) -> str:
        """Return "inside", "outside", or "no interval"."""
        if self.inside is None:
            return "no interval"
        return "inside" if self.inside else "outside"


def estimates_of(found: Summary) -> dict[str, Estimate]:
    """Return fitted and derived estimates in one table."""
    return {**found.estimates, **found.derived}


def compare(
    name: str, estimate: Estimate, accepted: Accepted | None
) -> Comparison | None:
    """Compare one estimate with its accepted value; None if there is none."""
    if accepted is None or name not in accepted:
        return None
    value, label = accepted[name]
    low, high = finite(estimate.q05), finite(estimate.q95)
    inside = None if low is None or high is None else bool(low <= value <= high)
    return Comparison(printed_number(name, value), label, inside)


@dataclass(frozen=True)
class EstimateRow:
    """An estimate as the terminal and the page show it.

    Attributes:
        name: Name of the parameter.
        value: Value, with the same value in another unit in brackets.
        interval: 90 % interval.
        accepted: The accepted value; "" if there is none.
        is_outside: Whether the interval does not contain the accepted value.
        is_derived: Whether the estimate is computed from a mass.
    """

    name: str
    value: str
    interval: str
    accepted: str
    is_outside: bool
    is_derived: bool


def estimate_rows(found: Summary, accepted: Accepted | None) -> list[EstimateRow]:
    """Return a row for each fitted parameter, then for each derived one."""
    rows = []
    for name, estimate in estimates_of(found).items():
        printed = printed_estimate(name, estimate)
        beside, shown = compare(name, estimate, accepted), ""
        if beside:
            shown = f"{beside.value}, {beside.label}: {beside.verdict}"
        rows.append(
            EstimateRow(
                parameter_words(name),
                printed.value_and_beside,
                printed.interval,
                shown,
                bool(beside and beside.inside is False),
                name in found.derived,
            )
        )
    return rows


def fitted_words(found: Summary) -> tuple[str, str]:
    """Return the number of recordings, and the names of the fitted parameters."""
    n, fitted = found.n_observations, joined(list(map(parameter_words, found.free)))
    return f"{n} recording{'s' * (n != 1)}", fitted or "nothing"


@dataclass(frozen=True)
class Row:
    """One row of the residual table, ready to print.

    For a lower bound `measured` begins with ">", and `residual` is "satisfied" if the
    law predicts at least that value.
    """

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
    """Return the log's file name without its folder, or "" for one made in memory."""
    # a path from Windows has backslashes, which POSIX takes for letters
    return PurePosixPath(fit.observations.source.replace("\\", "/")).name


def residual_rows(fit: Fit) -> list[Row]:
    """Return the log's rows in order; for a long log only the largest residuals."""
    rows = np.arange(len(fit.observations))
    if len(rows) > MAX_ROWS:
        # rows without a residual count as the largest: readers search for them
        worst = np.argsort(-np.abs(np.nan_to_num(fit.residual, nan=np.inf)))
        rows = np.sort(worst[:MAX_ROWS])
    suspected = outlier_rows(fit)
    return [_row(fit, int(i), int(i) in suspected) for i in rows]


def _row(fit: Fit, i: int, suspected: bool) -> Row:
    table = fit.observations
    quantity, value, sd = table.quantity[i], float(table.value[i]), float(fit.sd[i])
    predicted, residual = float(fit.predicted[i]), float(fit.residual[i])
    # errors of positive quantities are shares of the value
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
    shown_residual = f"{residual:+.2f}" if np.isfinite(residual) else "-"
    distance, is_bound = float(fit.distance[i]), bool(table.bounds()[i])
    # the residual of a lower bound is exactly 0 where the law predicts at least it
    is_satisfied = is_bound and residual == 0.0
    return Row(
        line=str(table.line[i]) if i < len(table.line) else str(i + 1),
        sensor=table.sensor[i],
        quantity=quantity_words(quantity),
        range=printed_number("_m", distance) if np.isfinite(distance) else "-",
        measured=(AT_LEAST if is_bound else "") + show(value),
        predicted=show(predicted),
        sd=shown_sd,
        residual="satisfied" if is_satisfied else shown_residual,
        suspected=suspected,
    )


def lower_bound_sentence(fit: Fit) -> str:
    """Return a sentence on the lower bounds and their agreement with the law, or ""."""
    bounds = fit.observations.bounds()
    if not bounds.any():
        return ""
    rows, n = np.flatnonzero(bounds), len(bounds)
    names = list(dict.fromkeys(fit.observations.sensor[row] for row in rows))
    more = [f"{len(names) - MAX_NAMED} more"] if len(names) > MAX_NAMED else []
    sensors = joined([*names[:MAX_NAMED], *more])
    missed = int(np.sum(fit.residual[rows] > 0))
    which = "it" if len(rows) == 1 else f"{missed or 'all'} of them"
    kept = f"predicts less than {which}" if missed else f"satisfies {which}"
    # a lower bound alone cannot exclude a large charge
    if len(rows) == n:
        return (
            f"All recordings are lower bounds ({sensors}): they exclude small charges "
            f"only. The law {kept}."
        )
    one = "is a lower bound" if len(rows) == 1 else "are lower bounds"
    return f"{len(rows)} of {n} recordings {one} ({sensors}); the law {kept}."
