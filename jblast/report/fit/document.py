"""The answer of a fit as JSON, and what the log does not identify."""

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from typing import Any

from jblast.inference.fitting.findings import (
    ExchangedSensors,
    SuspectedOutlier,
    WrongClock,
    WrongSensor,
)
from jblast.inference.fitting.fit import Fit
from jblast.inference.fitting.place import on_earth
from jblast.inference.identifiability import (
    EstimableCombination,
    NullDirection,
    OtherMode,
)
from jblast.inference.posterior.parameters import Estimate
from jblast.json_values import plain
from jblast.report.choice import law_reasons
from jblast.report.fit.findings import (
    all_words,
    cure_words,
    datum_words,
    other_mode_words as reason_words,
)
from jblast.report.provenance import Provenance
from jblast.report.understood import understood_lines
from jblast.report.words import (
    capitalised,
    finite,
    joined,
    parameter_words,
    printed_number,
    quantity_words,
    rounded,
    significant,
)
from jblast.scene import parameter_named

UNIDENTIFIED_LOG_SD = 0.5
"""A positive parameter with a larger sd in ln is called practically unidentified."""
NEAR_ALONE = "near the answer only: the invariance is curved"
"""Beside a combination that is identified at the answer, and no more elsewhere."""


def practically_unidentified(estimates: Mapping[str, Estimate]) -> list[str]:
    """Return the parameters that have a value, but one nobody should rely on."""
    return [
        name
        for name, estimate in estimates.items()
        if estimate.identified
        and (finite(estimate.log_sd) or 0.0) > UNIDENTIFIED_LOG_SD
    ]


def null_direction_sentence(direction: NullDirection) -> str:
    """Say which changes together leave every recording as it is."""
    steps = {n: float(step) for n, step in direction.parameters.items() if step}
    names = [parameter_words(name) for name in steps]
    if len(steps) == 1:
        return f"The recordings do not depend on the {names[0]}."
    # what is fitted in ln sets the pace: it doubles; else the widest moves by one unit
    space = direction.space
    in_ln = [abs(step) for name, step in steps.items() if _in_ln(name, space)]
    pace = max(in_ln, default=max(abs(step) for step in steps.values()))
    moved = math.log(2.0) if in_ln else 1.0
    changes = [
        f"{parameter_words(name)} times {significant(2.0 ** (step / pace), 3)}"
        if _in_ln(name, space)
        else f"{parameter_words(name)} by {_signed(name, moved * step / pace)}"
        for name, step in steps.items()
    ]
    return (
        f"The recordings cannot tell the {joined(names)} apart: {joined(changes)} "
        "together change no recording."
    )


def _in_ln(name: str, space: str) -> bool:
    return space != "linear" and parameter_named(name).positive


def _signed(name: str, step: float) -> str:
    return ("+" if step > 0 else "") + printed_number(name, step, 3)


def ambiguity_sentence(other: OtherMode) -> str:
    """Say where the other solution lies, and why there is one."""
    values = joined(
        [
            f"{parameter_words(name)} {printed_number(name, value)}"
            for name, value in other.parameters.items()
            if finite(value) is not None
        ]
    )
    reason = capitalised(reason_words(other))
    return f"Another solution fits nearly as well: {values}. {reason}."


def cure_sentence(entry: NullDirection | OtherMode) -> str:
    """Return what would cure a null direction or an ambiguity."""
    is_null = isinstance(entry, NullDirection)
    cure = cure_words(entry.cure) if is_null else datum_words(entry.cure)
    return f"Cure: {cure}."


def determined_lines(determined: Sequence[EstimableCombination]) -> list[str]:
    """Return one line for each combination that the recordings do determine."""
    lines = []
    for entry in determined:
        value, sd = finite(entry.value), finite(entry.sd)
        if value is None:
            lines.append(entry.combination)
        elif not sd:
            lines.append(f"{entry.combination} = {significant(value, 4)}")
        else:
            shown = f"{rounded(value, sd)} ± {rounded(sd, sd)}"
            note = f" ({NEAR_ALONE})" if entry.is_local else ""
            lines.append(f"{entry.combination} = {shown}{note}")
    return lines


def outlier_lines(outliers: Iterable[SuspectedOutlier]) -> list[str]:
    """Return one line for each suspected outlier."""
    return [
        f"{o.sensor}, {quantity_words(o.quantity)}: {o.sds:+.1f} sd" for o in outliers
    ]


def fit_document(fit: Fit) -> dict[str, Any]:
    """Return what `jblast fit --json` prints, null for what is not a finite number."""
    found = fit.summary
    return plain(
        {
            "schema": 1,
            "law": found.law,
            "law_reason": law_reasons(found.law_reason),
            "law_valid": found.law_valid,
            "law_valid_rows": found.law_valid_rows,
            "estimates": estimate_entries(found.estimates),
            "derived": estimate_entries(found.derived),
            "free": found.free,
            "identifiable": found.identifiable,
            "null_directions": null_direction_entries(found.null_directions),
            "ambiguities": ambiguity_entries(found.ambiguities),
            "determined": determined_entries(found.determined),
            "posterior": found.posterior,
            "converged": found.converged,
            "chi2": found.chi2,
            "dof": found.dof,
            "n_observations": found.n_observations,
            "n_lower_bounds": found.n_lower_bounds,
            "suspected_outliers": [asdict(o) for o in found.suspected_outliers],
            "explained_by": [_explanation(wrong) for wrong in found.explained_by],
            "warnings": all_words(found.warnings),
            "assumptions": all_words(found.assumptions),
            "extrapolated": list(found.extrapolated),
            "understood": understood_lines(found.understood),
            **asdict(on_earth(fit)),
        }
    )


def answer_json(fit: Fit, made: Provenance, picks: Sequence[Any] | None = None) -> str:
    """Return the answer, and what it was made of, as the text of `fit.json`.

    What is printed has no provenance, so that the same run prints the same.

    Args:
        fit: The fit.
        made: What it was made of.
        picks: What the log was picked from, if it was, as `jblast pick` prints it.
    """
    document = fit_document(fit) | picks_entry(picks) | provenance_entry(made)
    return json.dumps(document, indent=2, allow_nan=False, ensure_ascii=False) + "\n"


def picks_entry(picks: Sequence[Any] | None) -> dict[str, Any]:
    """Return the key `picks` of an answer; nothing where no record was picked."""
    return {} if picks is None else {"picks": picks}


def provenance_entry(made: Provenance) -> dict[str, Any]:
    """Return the key `provenance` of an answer."""
    return {"provenance": plain(asdict(made))}


def estimate_entries(estimates: Mapping[str, Estimate]) -> dict[str, Any]:
    """Return an entry for each number by name."""
    return {name: asdict(estimate) for name, estimate in estimates.items()}


def null_direction_entries(found: Sequence[NullDirection]) -> list[dict[str, Any]]:
    """Return an entry for each direction in which no datum moves."""
    return [
        {"parameters": of.parameters, "space": of.space, "cure": cure_words(of.cure)}
        for of in found
    ]


def ambiguity_entries(found: Sequence[OtherMode]) -> list[dict[str, Any]]:
    """Return an entry for each other optimum."""
    return [
        {
            "parameters": of.parameters,
            "reason": reason_words(of),
            "cure": datum_words(of.cure),
        }
        for of in found
    ]


def determined_entries(found: Sequence[EstimableCombination]) -> list[dict[str, Any]]:
    """Return an entry for each combination that is identified."""
    return [
        {"combination": of.combination, "value": of.value, "sd": of.sd}
        | ({"note": NEAR_ALONE} if of.is_local else {})
        for of in found
    ]


def _explanation(wrong: WrongSensor) -> dict[str, Any]:
    """Return the entry of what explains a log that does not fit."""
    clock = {}
    if isinstance(wrong, WrongClock):
        clock = {
            "offset_s": wrong.offset_s,
            "offset_sd": wrong.offset_sd,
            "parameter": wrong.parameter,
        }
    exchanged = isinstance(wrong, ExchangedSensors)
    return {
        "kind": "exchange" if exchanged else "clock" if clock else "sensor",
        "name": wrong.name,
        **({"other": wrong.other} if exchanged else {}),
        **clock,
        "chi2": wrong.chi2,
        "dof": wrong.dof,
        "p_value": wrong.p_value,
        "law_valid_rows": wrong.law_valid_rows,
        "estimates": estimate_entries(wrong.estimates),
    }
