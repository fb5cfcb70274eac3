"""Many answers as one table: for a terminal, and as CSV."""

import textwrap
from collections.abc import Mapping
from typing import Any

from jblast.errors import InputError
from jblast.inference.fitting.result import Fit
from jblast.report.fit.goodness import goodness_p
from jblast.report.numbers import finite, printed_estimate, significant
from jblast.report.tables import aligned, comma_separated
from jblast.report.words import parameter_words

WIDTH = 96
NUMBERS = ("value", "sd", "log_sd", "q05", "q50", "q95")
OF_LOG = ("converged", "identifiable", "law_valid", "chi2", "dof", "n_observations")
COLUMNS: tuple[str, ...] = ("log", "parameter", *NUMBERS, *OF_LOG, "error")


def answers_text(answers: Mapping[str, Fit | InputError]) -> str:
    """Return one line a log: what was found of each number, and what is doubtful."""
    fits = {name: fit for name, fit in answers.items() if isinstance(fit, Fit)}
    names = list(dict.fromkeys(p for fit in fits.values() for p in estimates(fit)))
    rows = [("log", *map(parameter_words, names), "chi2 (chance)", "")]
    for name, fit in fits.items():
        found = estimates(fit)
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
        of_log = {k: fit.answer[k] for k in OF_LOG}
        for parameter, estimate in estimates(fit).items():
            numbers = {k: estimate[k] for k in NUMBERS}
            rows.append({"log": name, "parameter": parameter} | numbers | of_log)
    return comma_separated([COLUMNS, *([row.get(c) for c in COLUMNS] for row in rows)])


def answers_document(answers: Mapping[str, Fit | InputError]) -> dict[str, Any]:
    """Return what `--json` prints: by log its answer, or its error."""
    return {
        "schema": 1,
        "logs": {
            name: {"error": str(fit)} if isinstance(fit, InputError) else fit.answer
            for name, fit in answers.items()
        },
    }


def estimates(fit: Fit) -> Mapping[str, Mapping[str, Any]]:
    """Return what an answer says of every free number."""
    return fit.answer["estimates"]


def _cell(name: str, estimate: Mapping[str, Any]) -> str:
    if finite(estimate["value"]) is None:
        return "not identified"
    printed = printed_estimate(name, estimate)
    return f"{printed.value} [{printed.interval}]"


def _goodness(fit: Fit) -> str:
    p = goodness_p(fit.answer)
    chance = "-" if p is None else significant(p)
    return f"{fit.answer['chi2']:.3g}/{fit.answer['dof']} ({chance})"


def _doubts(fit: Fit) -> str:
    answer = fit.answer
    doubts = [
        word
        for word, doubtful in (
            ("not converged", not answer["converged"]),
            ("not identifiable", not answer["identifiable"]),
            ("poor fit", fit.is_poor),
            ("no row within its law", fit.is_outside),
            ("outside its law", not answer["law_valid"] and not fit.is_outside),
            *(
                (f"without {entry['name']} it fits", True)
                for entry in answer["explained_by"]
            ),
            ("outliers", bool(answer["suspected_outliers"])),
        )
        if doubtful
    ]
    return ", ".join(doubts)
