"""Which one more datum would help, as the terminal shows it."""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from jblast.inference.design.summary import AddedDatum
from jblast.inference.posterior.estimate import Spread
from jblast.quantities import ADDITIVE
from jblast.report.design.document import where
from jblast.report.lines import hanging
from jblast.report.numbers import finite, printed_number, significant
from jblast.report.tables import aligned
from jblast.report.words import joined, parameter_words, quantity_words

MOST_HELP = 6
LITTLE = 0.99
"""A datum that leaves more of the sd than this is no help."""
NOT = "not identified"
PER_CENT = 1.0
"""A larger sd of ln is printed as a factor."""


def shown_sd(name: str, spread: Spread) -> str:
    """Return an sd: of what is positive in per cent, or a factor where it is wide."""
    log_sd, sd = finite(spread.log_sd), finite(spread.sd)
    if log_sd is None:
        return NOT if sd is None else printed_number(name, sd, 2)
    if log_sd > PER_CENT:
        with np.errstate(over="ignore"):
            return f"a factor of {significant(float(np.exp(min(log_sd, 700.0))))}"
    return f"{significant(100 * log_sd)} %"


def data_lines(
    data: Sequence[AddedDatum], parameters: Mapping[str, Spread]
) -> list[str]:
    """Say what the best datum of each quantity leaves, those first that help most.

    Args:
        data: What could be added.
        parameters: How far each number may be off without it.
    """
    if not data:
        return []
    best: dict[str, AddedDatum] = {}
    for datum in data:
        best.setdefault(datum.quantity, datum)
    target = data[0].parameter
    now = parameters[target]
    rows, idle = [], []
    for datum in sorted(best.values(), key=lambda datum: _width(datum.left))[
        :MOST_HELP
    ]:
        if _helps(datum.left, now):
            rows.append(_row(datum))
        else:
            idle.append(quantity_words(datum.quantity))
    title = f"One more datum: sd of the {parameter_words(target)}"
    lines = ["", f"{title}, now {shown_sd(target, now)}"]
    for row in aligned(rows):
        lines += hanging(row)
    if idle:
        alone = "No one of these tells it" if not now.is_known else "No help"
        lines += hanging(f"{alone}: {joined(idle)}.")
    return lines


def _helps(left: Spread, now: Spread) -> bool:
    before = now.sd if math.isnan(left.log_sd) else now.log_sd
    return _width(left) < (LITTLE * before if math.isfinite(before) else math.inf)


def _width(left: Spread) -> float:
    """Return the sd that a datum leaves; infinite if nothing is known then."""
    return left.width if math.isfinite(left.width) else math.inf


def _row(datum: AddedDatum) -> tuple[str, str, str]:
    quantity = datum.quantity
    error = (
        printed_number(quantity, datum.sigma, 2)
        if quantity in ADDITIVE
        else f"{100 * datum.sigma:.2g} %"
    )
    whose = "our guess" if datum.is_default else "as planned"
    place = where(datum)
    if datum.position is not None and not datum.sensor:
        east, north, _ = datum.position
        place = f"at east {east:.4g}, north {north:.4g} m"
    of = f" of {datum.charge}" if datum.charge else ""
    mark = "" if datum.law_valid else "; law out of range"
    return (
        f"{quantity_words(quantity)}{of} {place}",
        shown_sd(datum.parameter, datum.left),
        f"(read to {error}, {whose}{mark})",
    )
