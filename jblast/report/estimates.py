"""Estimates in print: value and 90 % interval, to the digits that are significant."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import PurePosixPath
from typing import TYPE_CHECKING

import numpy as np

from jblast.constants import TNT_SPECIFIC_ENERGY
from jblast.inference.posterior.parameters import Estimate
from jblast.parameters import CHARGE_POSITION
from jblast.report.numbers import (
    Unit,
    finite,
    joined,
    parameter_words,
    printed_number,
    rounded,
    scientific,
    significant,
    split_name,
    unit_for,
)

if TYPE_CHECKING:
    from jblast.inference.fitting.fit import Fit

Accepted = Mapping[str, tuple[float | int, str]]
"""Parameter name -> (accepted value in SI, its source)."""
METRE = Unit("m", 1.0)
FAR = 1e4
"""Coordinates from this size on are those of a map, and printed in full [m]."""
WIDE_LOG_SD = 0.3
"""Standard deviation of ln above which numbers have two significant digits: the 90 %
interval then spans a factor of three, and an absolute error means little."""


@dataclass(frozen=True)
class Printed:
    """An estimate as text, ready for a table.

    Attributes:
        value: Value with its unit, "not identified" if there is none.
        interval: The 90 % interval with its unit, "-" if there is none.
        beside: The same value in another common unit, or "".
    """

    value: str
    interval: str
    beside: str

    @property
    def value_and_beside(self) -> str:
        """Return the value, with the other unit in brackets."""
        return f"{self.value} ({self.beside})" if self.beside else self.value


def printed_estimate(name: str, estimate: Estimate) -> Printed:
    """Return one entry of an answer's `estimates` or `derived` as text.

    Value and interval are printed to two digits of the standard deviation. For a
    parameter with an uncertainty of a factor each number has two significant digits.
    """
    numbers = estimate.value, estimate.sd, estimate.q05, estimate.q95
    value, sd, low, high = map(finite, numbers)
    log_sd = finite(estimate.log_sd)
    ends, by_factors = (low, high), False
    if value is not None:
        ends = (value,)
    elif low is not None and high is not None and low > 0.0:
        # an interval without a value is printed in the unit of its geometric mean
        # roots first: the product of the two ends can overflow
        ends, by_factors = (math.sqrt(low) * math.sqrt(high),), True
    elif (one := high if low is None else low) is not None:
        ends = (one,)
    unit = METRE if name.partition(".")[0] in CHARGE_POSITION else unit_for(name, *ends)
    if sd is None and low is not None and high is not None:
        sd = (high - low) / 3.29  # the 90 % interval of a normal: 2 * 1.645 sd

    def show(number: float) -> str:
        if by_factors or (log_sd is not None and log_sd > WIDE_LOG_SD) or not sd:
            return significant(number / unit.size, 2 if sd else 4)
        return rounded(number / unit.size, sd / unit.size)

    bare = f" {unit.symbol}" if unit.symbol else ""
    interval = "-"
    if low is not None and high is not None:
        interval = f"{show(low)} to {show(high)}{bare}"
    elif high is not None:
        interval = f"at most {significant(high / unit.size, 2)}{bare}"
    elif low is not None:
        interval = f"at least {significant(low / unit.size, 2)}{bare}"
    return Printed(
        value="not identified" if value is None else show(value) + bare,
        interval=interval,
        beside="" if value is None else _beside(name, value),
    )


def printed_value(name: str, value: float) -> str:
    """Return a value of a parameter whose uncertainty is not printed with it."""
    if name.partition(".")[0] in CHARGE_POSITION and abs(value) >= FAR:
        return f"{value:.0f} m"
    return printed_number(name, value)


def _beside(name: str, value: float) -> str:
    suffix = split_name(name)[1]
    # this mass is printed in kt, but scenes and other reports have kilograms
    if suffix == "_kg" and value >= 1e6:
        return f"{scientific(value, 2)} kg"
    if suffix == "_j" and value >= 1e6 * TNT_SPECIFIC_ENERGY:
        return f"{significant(value / TNT_SPECIFIC_ENERGY / 1e6, 3)} kt of TNT"
    return ""


def outlier_rows(fit: "Fit") -> tuple[int, ...]:
    """Return the rows of the suspected outliers.

    Of several rows with one sensor and quantity the one with the nearest residual is
    taken.
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


def log_name(fit: "Fit") -> str:
    """Return the log's file name without its folder, or "" for one made in memory."""
    # a path from Windows has backslashes, which POSIX takes for letters
    return PurePosixPath(fit.observations.source.replace("\\", "/")).name


def drawn_parameters(fit: "Fit") -> list[str]:
    """Return the parameters whose draws can be plotted: finite, not all equal."""
    return [
        name
        for name in fit.summary.free
        if name in fit.draws
        and fit.summary.estimates[name].identified
        and len(fit.draws[name]) > 1
        and bool(np.all(np.isfinite(fit.draws[name])))
        and np.ptp(fit.draws[name]) > 0.0
    ]


def absent_note(fit: "Fit") -> str:
    """Return a sentence on free parameters missing from the corner plot, or ""."""
    drawn = drawn_parameters(fit)
    absent = [parameter_words(n) for n in fit.summary.free if n not in drawn]
    return f"Not shown, as not identified: {joined(absent)}." if absent else ""
