"""The tables of a report on a study."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from jblast.report.study.page.columns import StudyColumns
from jblast.report.study.page.shares import LaneShares
from jblast.report.study.page.summaries import LaneSummary

MOST_ROWS = 200
"""Rows of a table on the page; the document has all."""


@dataclass(frozen=True)
class Table:
    """A table.

    Attributes:
        head: Titles of the columns.
        rows: Cells.
        numbers: Columns that end below one another.
    """

    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    numbers: Sequence[int] = ()


def printed(value: float, digits: int = 4) -> str:
    """Return a number, a dash where there is none."""
    return "-" if math.isnan(value) else f"{value:.{digits}g}"


def printed_share(share: float, digits: int = 3) -> str:
    """Print a share; one that is nearly one by the digits of what it lacks."""
    lacks = 1.0 - float(share)
    if 0.0 < lacks < 0.01:
        digits = max(digits, 2 + math.ceil(-math.log10(lacks)))
    return printed(share, digits)


def number_table(
    summaries: Sequence[LaneSummary], axes: Sequence[str] = ()
) -> Table | None:
    """Return the table of numbers; None where there are none."""
    head = (
        *("Outcome", *axes, "Unit", "Mean", "± s.e.", "5 %", "Median", "95 %"),
        *("Samples", "Infinite", "Failed"),
    )
    rows = [
        (
            one.lane.title,
            *one.cell,
            one.lane.units if one.lane.units != "1" else "",
            *(
                printed(one.found[name], 2 if name == "standard_error" else 4)
                for name in ("mean", "standard_error", "q05", "q50", "q95")
            ),
            *(f"{one.found[name]:,}" for name in ("count", "infinite", "lost")),
        )
        for one in summaries
        if one.lane.kind == "number"
    ]
    first = 2 + len(axes)
    return Table(head, rows[:MOST_ROWS], range(first, len(head))) if rows else None


def share_table(
    summaries: Sequence[LaneSummary], axes: Sequence[str] = ()
) -> Table | None:
    """Return the table of shares; None where there are none."""
    head = ("Outcome", *axes, "Share", "90 % interval", "Yes", "Samples", "Failed")
    rows = [
        (
            one.lane.title,
            *one.cell,
            printed_share(one.found["share"], 4),
            f"{printed_share(one.found['low'])} to {printed_share(one.found['high'])}",
            *(f"{one.found[name]:,}" for name in ("yes", "count", "lost")),
        )
        for one in summaries
        if one.lane.kind == "yes_no"
    ]
    first = 1 + len(axes)
    return Table(head, rows[:MOST_ROWS], range(first, len(head))) if rows else None


def sensitivity_table(shares: Sequence[LaneShares]) -> Table | None:
    """Return indices and elasticities side by side; None where there are none."""
    rows = []
    for one in shares:
        of = one.indices
        for n, name in enumerate(of.names):
            first, total = of.first_interval[:, n], of.total_interval[:, n]
            rows.append(
                (
                    one.lane.title,
                    name,
                    f"{of.first[n]:.2f} ({first[0]:.2f} to {first[1]:.2f})",
                    f"{of.total[n]:.2f} ({total[0]:.2f} to {total[1]:.2f})",
                    printed(one.elasticity[name], 3),
                    one.reasons.get(name, ""),
                )
            )
    head = (
        "Outcome",
        "Number",
        "Alone",
        "With others",
        "Elasticity",
        "They differ as it",
    )
    return Table(head, rows[:MOST_ROWS], (2, 3, 4)) if rows else None


def text_lines(columns: StudyColumns, overall: Sequence[LaneSummary]) -> list[str]:
    """Return what a terminal is told: a line for each outcome."""
    width = max((len(one.lane.title) for one in overall), default=0)
    said = []
    for one in overall:
        found, name = one.found, one.lane.title.ljust(width)
        if one.lane.kind == "yes_no":
            said.append(
                f"{name}  {printed_share(found['share'], 4)}, 90 % interval "
                f"{printed_share(found['low'])} to {printed_share(found['high'])}"
            )
        else:
            unit = "" if one.lane.units == "1" else f" {one.lane.units}"
            said.append(
                f"{name}  mean {printed(found['mean'])} ± "
                f"{printed(found['standard_error'], 2)}{unit}, 90 % of samples "
                f"{printed(found['q05'])} to {printed(found['q95'])}"
            )
        if found["lost"]:
            said[-1] += f"; {found['lost']:,} failed"
    return [*columns.notes, *said]
