"""Many answers as one table: for a terminal, and as CSV."""

import math
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from jblast.errors import InputError
from jblast.inference.fitting.findings import ExchangedSensors, WrongSensor
from jblast.inference.fitting.result import Fit
from jblast.inference.posterior.estimate import Estimate
from jblast.report.estimates import printed_estimate
from jblast.report.fit.document import fit_document, picks_entry, provenance_entry
from jblast.report.fit.goodness import goodness_p
from jblast.report.lines import WIDTH
from jblast.report.numbers import significant
from jblast.report.provenance import Provenance
from jblast.report.tables import aligned, comma_separated
from jblast.report.words import parameter_words

NUMBERS = ("value", "sd", "log_sd", "q05", "q50", "q95", "identified")
OF_LOG = ("converged", "identifiable", "law_valid", "chi2", "dof", "n_observations")
COLUMNS: tuple[str, ...] = ("log", "parameter", *NUMBERS, *OF_LOG, "error")


def answers_text(answers: Mapping[str, Fit | InputError]) -> str:
    """Return one line a log: what was found of each number, and what is doubtful."""
    fits = {name: fit for name, fit in answers.items() if isinstance(fit, Fit)}
    names = list(dict.fromkeys(p for fit in fits.values() for p in fit.summary.free))
    rows = [("log", *map(parameter_words, names), "chi2 (chance)", "")]
    for name, fit in fits.items():
        found = fit.summary.estimates
        cells = [_cell(p, found[p]) if p in found else "-" for p in names]
        rows.append((name, *cells, _goodness(fit), _doubts(fit)))
    failed = [
        line
        for name, error in answers.items()
        if isinstance(error, InputError)
        for line in textwrap.wrap(f"{name}: {error}", WIDTH, subsequent_indent="  ")
    ]
    of = f"{len(fits)} of {len(answers)} logs fitted; 90 % intervals in brackets"
    parts = [of, "", *(aligned(rows) if fits else [])]
    return "\n".join([*parts, *(["", "Not fitted", *failed] if failed else [])]) + "\n"


def answers_csv(answers: Mapping[str, Fit | InputError]) -> str:
    """Return a tidy table: one row a log and parameter, one for a log that failed."""
    rows: list[dict[str, Any]] = []
    for name, fit in answers.items():
        if isinstance(fit, InputError):
            rows.append({"log": name, "error": str(fit)})
            continue
        of_log = {k: getattr(fit.summary, k) for k in OF_LOG}
        for parameter, estimate in fit.summary.estimates.items():
            numbers = _numbers(estimate)
            rows.append({"log": name, "parameter": parameter} | numbers | of_log)
    return comma_separated([COLUMNS, *([row.get(c) for c in COLUMNS] for row in rows)])


def answers_document(
    answers: Mapping[str, Fit | InputError],
    made: Mapping[str, Provenance] | None = None,
    picks: Sequence[Any] | None = None,
) -> dict[str, Any]:
    """Return what `--json` prints: by log its answer, or its error.

    Args:
        answers: By log.
        made: What each was made of, for a file: the same run prints the same.
        picks: What the logs were picked from, if they were, as `jblast pick` prints
            it.
    """
    logs = {
        name: {"error": str(fit)} if isinstance(fit, InputError) else fit_document(fit)
        for name, fit in answers.items()
    }
    for name, of in (made or {}).items():
        logs[name] |= provenance_entry(of)
    return {"schema": 1, "logs": logs, **picks_entry(picks)}


def _numbers(estimate: Estimate) -> dict[str, float]:
    """Return the entries of an estimate that are known."""
    return {k: x for k, x in asdict(estimate).items() if not math.isnan(x)}


def _cell(name: str, estimate: Estimate) -> str:
    printed = printed_estimate(name, estimate)
    if printed.interval == "-" and not estimate.identified:
        return printed.value
    return f"{printed.value} [{printed.interval}]"


def _goodness(fit: Fit) -> str:
    p = goodness_p(fit.summary)
    chance = "-" if p is None else significant(p)
    return f"{fit.summary.chi2:.3g}/{fit.summary.dof} ({chance})"


def _doubts(fit: Fit) -> str:
    found = fit.summary
    doubts = [
        word
        for word, doubtful in (
            ("not converged", not found.converged),
            ("not identifiable", not found.identifiable),
            ("nothing identified", found.identifiable and found.identifies_nothing),
            ("poor fit", fit.is_poor),
            ("no row within its law", found.law_valid_rows == 0),
            ("rests on rows outside their law", bool(found.extrapolated)),
            ("outside its law", not found.law_valid and not fit.is_outside),
            *((_fits(wrong), True) for wrong in found.explained_by),
            ("outliers", bool(found.suspected_outliers)),
        )
        if doubtful
    ]
    return ", ".join(doubts)


def _fits(wrong: WrongSensor) -> str:
    if isinstance(wrong, ExchangedSensors):
        return f"with {wrong.name} and {wrong.other} exchanged it fits"
    return f"without {wrong.name} it fits"
