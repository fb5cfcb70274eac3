"""The answer as `jblast fit --json` prints it, key by key of the contract."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from jblast.inference.fitting.findings import (
    ExchangedSensors,
    WrongClock,
    WrongSensor,
)
from jblast.inference.fitting.place.on_earth import on_earth
from jblast.inference.fitting.result import Fit
from jblast.inference.identifiability.findings import (
    EstimableCombination,
    NullDirection,
    OtherMode,
)
from jblast.inference.posterior.estimate import Estimate
from jblast.json_values import plain
from jblast.report.choice.reason import law_reasons
from jblast.report.fit.cures import cure_words, datum_words, reason_words
from jblast.report.fit.findings import all_words
from jblast.report.provenance import Provenance
from jblast.report.understood import understood_lines


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


NEAR_ALONE = "near the answer only: the invariance is curved"
"""Beside a combination that is identified at the answer, and no more elsewhere."""


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
