"""The answer as the terminal shows it."""

import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path

from jblast.inference.design.summary import BoundSummary
from jblast.inference.fitting.findings import AsAsked
from jblast.inference.fitting.result import Fit
from jblast.inference.fitting.summary import Summary
from jblast.inference.importance.findings import RangeFollowed
from jblast.inference.posterior.estimate import Estimate
from jblast.report.estimates import printed_estimate
from jblast.report.fit.conclusion import accepted_not_fitted
from jblast.report.fit.findings import all_words, reason_words
from jblast.report.fit.goodness import goodness_numbers, goodness_sentence
from jblast.report.fit.headline import headline
from jblast.report.fit.identifiability import (
    ambiguity_sentence,
    cure_sentence,
    determined_lines,
    null_direction_sentence,
    outlier_lines,
    practically_unidentified,
)
from jblast.report.fit.laws import laws_used, validity_sentence
from jblast.report.fit.place.earth_words import earth_lines
from jblast.report.fit.reference_values import Accepted, compare
from jblast.report.fit.rows import log_name, lower_bound_sentence
from jblast.report.lines import WIDTH, hanging
from jblast.report.tables import GAP, aligned
from jblast.report.understood import understood_lines
from jblast.report.words import joined, parameter_words

HELD = {True: (86, 89), False: (85, 88)}
"""In 100 of the logs of `HELD_IN`, by whether draws are weighted: the number told worst
and best (`calibration/results/coverage_default.txt`)."""
HELD_IN = "400 simulated logs of seven microphones, four unknowns"


def summary(
    fit: Fit, accepted: Accepted | None = None, out: str | Path | None = None
) -> str:
    """Return the answer for the terminal.

    Args:
        fit: The fit.
        accepted: Published values by parameter name, each with where it comes from;
            printed beside the estimates with whether they lie inside.
        out: Where the figures were written, if they were.
    """
    found = fit.summary
    lines = [_title(fit), *_how_intervals_held(fit), ""]
    if doubts := headline(fit):  # above every line but the title
        said = (line for doubt in doubts for line in textwrap.wrap(doubt, WIDTH))
        lines[1:1] = ["", *said, ""]
    lines += _estimate_table(found, accepted)
    lines += section("", accepted_not_fitted(fit, accepted))
    lines += section("Where and when", earth_lines(fit))
    lines += ["", "Laws"]
    used = laws_used(fit)
    column = max((len(law.quantity) for law in used), default=0) + 2
    for law in used:
        text = "; ".join(part for part in (law.reason, law.scatter) if part)
        text = f"{law.law}: {text}" if text else law.law
        lines += hanging(law.quantity.ljust(column) + text, column)
    lines += hanging(validity_sentence(fit))
    lines += ["", "Goodness of fit", *hanging(goodness_numbers(found))]
    lines += hanging(goodness_sentence(found))
    if bounds := lower_bound_sentence(fit):
        lines += hanging(bounds)
    lines += section("Intervals", _intervals(fit))
    nothing = ["nothing: the recordings, or a prior, identify every fitted number"]
    untold = cannot_tell(found, found.estimates) or nothing
    lines += section("What the recordings cannot tell", untold)
    lines += section("What they do tell", determined_lines(found.determined))
    lines += section("Suspected outliers", outlier_lines(found.suspected_outliers))
    lines += section("How the log was read", understood_lines(found.understood))
    lines += section("Assumptions", all_words(found.assumptions))
    lines += section("Warnings", all_words(found.warnings))
    if out is not None:
        lines += ["", f"Report and figures: {out}"]
    return "\n".join(line.rstrip() for line in lines) + "\n"


def _how_intervals_held(fit: Fit) -> list[str]:
    """Say how an approximate posterior's intervals held in simulated logs.

    Those were fitted well, with weighted draws or as asked for: no other is like them.
    """
    if fit.summary.posterior != "laplace" or not fit.summary.converged:
        return []
    if isinstance(fit.posterior_reason, RangeFollowed):
        return ["90 % intervals by draws along the range of the charge"]
    how = "weighted by the posterior" if fit.weighted else "alone"
    said = f"90 % intervals by a normal approximation, {how}"
    if fit.exit_code == 0 and (
        fit.weighted or isinstance(fit.posterior_reason, AsAsked)
    ):
        least, most = HELD[fit.weighted]
        said += f": in {HELD_IN}, they held the truth in {least} to {most} of 100"
    return hanging(said, indent=0)


def _intervals(fit: Fit) -> list[str]:
    reason = reason_words(fit.posterior_reason)
    return [f"{fit.summary.posterior}: {reason}"] if reason else []


def _title(fit: Fit) -> str:
    n, free = fit.summary.n_observations, fit.summary.free
    of = f" of {log_name(fit)}" if log_name(fit) else ""
    fitted = joined([parameter_words(name) for name in free])
    recordings = "recording" if n == 1 else "recordings"
    title = f"Fit{of}: {n} {recordings}, {fitted or 'nothing'} fitted"
    return "\n".join(textwrap.wrap(title, WIDTH))


def _estimate_table(found: Summary, accepted: Accepted | None) -> list[str]:
    rows = [("Estimates", "value", "90 % interval", "accepted" if accepted else "")]
    for name, estimate in found.estimates.items():
        rows.append(_table_row(name, estimate, accepted))
    for name, estimate in found.derived.items():
        rows.append(_table_row(name, estimate, accepted))
    indent = max(len(row[0]) for row in rows) + GAP
    lines = []
    whole, left = aligned(rows), aligned([row[:3] for row in rows])
    for i, row in enumerate(rows):
        if found.derived and i == len(found.estimates) + 1:
            lines.append("Derived")
        if len(whole[i]) <= WIDTH:
            lines.append(whole[i])
        else:
            lines += [left[i], *hanging(f"accepted: {row[3]}", 2, indent=indent)]
    return lines


def _table_row(
    name: str, estimate: Estimate, accepted: Accepted | None
) -> tuple[str, str, str, str]:
    printed = printed_estimate(name, estimate)
    comparison = compare(name, estimate, accepted)
    beside = (
        f"{comparison.value}, {comparison.label}: {comparison.verdict}"
        if comparison
        else ""
    )
    words = f"  {parameter_words(name)}"
    return words, printed.value_and_beside, printed.interval, beside


def cannot_tell(
    found: Summary | BoundSummary, estimates: Mapping[str, Estimate]
) -> list[str]:
    """Return a line for each number, direction or second solution left open."""
    lines = [f"{parameter_words(n)}: not identified" for n in found.unidentified]
    for name in practically_unidentified(estimates):
        log_sd = estimates[name].log_sd
        lines.append(
            f"{parameter_words(name)}: practically unidentified (sd of ln {log_sd:.2f})"
        )
    for direction in found.null_directions:
        lines += [null_direction_sentence(direction), cure_sentence(direction)]
    for other in found.ambiguities:
        lines += [ambiguity_sentence(other), cure_sentence(other)]
    return [line for line in lines if line]


def section(title: str, entries: Sequence[str]) -> list[str]:
    """Return a titled list of entries, nothing if there are none."""
    if not entries:
        return []
    wrapped = [line for entry in entries for line in hanging(entry, 2)]
    return ["", title, *wrapped] if title else wrapped
