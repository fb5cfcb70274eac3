"""Which one more datum would help, as the terminal shows it."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from jblast.quantities import ADDITIVE
from jblast.report.fit.terminal import hanging
from jblast.report.numbers import finite, printed_number, significant
from jblast.report.tables import aligned
from jblast.report.words import joined, parameter_words, quantity_words

MOST_HELP = 6
LITTLE = 0.99
"""A datum that leaves more of the sd than this is no help."""
NOT = "not identified"
PER_CENT = 1.0
"""A larger sd of ln is printed as a factor."""


def shown_sd(name: str, spread: Mapping[str, Any]) -> str:
    """Return an sd: of what is positive in per cent, or a factor where it is wide."""
    log_sd, sd = finite(spread["log_sd"]), finite(spread["sd"])
    if log_sd is None:
        return NOT if sd is None else printed_number(name, sd, 2)
    if log_sd > PER_CENT:
        with np.errstate(over="ignore"):
            return f"a factor of {significant(float(np.exp(min(log_sd, 700.0))))}"
    return f"{significant(100 * log_sd)} %"


def data_lines(answer: Mapping[str, Any]) -> list[str]:
    """Say what the best datum of each quantity leaves, those first that help most."""
    if not answer["help"]:
        return []
    best: dict[str, Mapping[str, Any]] = {}
    for entry in answer["help"]:
        best.setdefault(entry["quantity"], entry)
    target = answer["help"][0]["parameter"]
    now = answer["parameters"][target]
    rows, idle = [], []
    for quantity, entry in sorted(best.items(), key=lambda of: _left(of[1]))[
        :MOST_HELP
    ]:
        if _helps(entry, now):
            rows.append(_row(quantity, entry))
        else:
            idle.append(quantity_words(quantity))
    title = f"One more datum: sd of the {parameter_words(target)}"
    lines = ["", f"{title}, now {shown_sd(target, now)}"]
    for row in aligned(rows):
        lines += hanging(row)
    if idle:
        alone = "No one of these tells it" if now["sd"] is None else "No help"
        lines += hanging(f"{alone}: {joined(idle)}.")
    return lines


def _helps(entry: Mapping[str, Any], now: Mapping[str, float | None]) -> bool:
    key = "sd" if entry["log_sd"] is None else "log_sd"
    before = finite(now[key])
    return _left(entry) < (math.inf if before is None else LITTLE * before)


def _left(entry: Mapping[str, Any]) -> float:
    """Return the sd that a datum leaves; infinite if nothing is told then."""
    left = finite(entry["sd"] if entry["log_sd"] is None else entry["log_sd"])
    return math.inf if left is None else left


def _row(quantity: str, entry: Mapping[str, Any]) -> tuple[str, str, str]:
    error = (
        printed_number(quantity, entry["sigma"], 2)
        if quantity in ADDITIVE
        else f"{100 * entry['sigma']:.2g} %"
    )
    whose = "as planned" if entry["sigma_from"] == "layout" else "our guess"
    place = entry["where"]
    if entry["position_m"] is not None and not place.startswith("at sensor"):
        east, north, _ = entry["position_m"]
        place = f"at east {east:.4g}, north {north:.4g} m"
    of = f" of {entry['charge']}" if entry["charge"] else ""
    mark = "" if entry["law_valid"] else "; law out of range"
    return (
        f"{quantity_words(quantity)}{of} {place}",
        shown_sd(entry["parameter"], entry),
        f"(read to {error}, {whose}{mark})",
    )
