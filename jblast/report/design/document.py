"""A bound as `jblast bound --json` prints it, key by key of the contract."""

from dataclasses import asdict
from typing import Any

from jblast.inference.design.cramer_rao import Bound
from jblast.inference.design.summary import AddedDatum, Sensitivity
from jblast.json_values import plain
from jblast.report.choice.reason import law_reasons
from jblast.report.fit.document import (
    ambiguity_entries,
    determined_entries,
    null_direction_entries,
)
from jblast.report.fit.findings import all_words


def bound_document(bound: Bound) -> dict[str, Any]:
    """Return what `jblast bound --json` prints, null for what is no finite number."""
    found = bound.summary
    return plain(
        {
            "schema": 1,
            "at": found.at,
            "law": found.law,
            "law_reason": law_reasons(found.law_reason),
            "law_valid": found.law_valid,
            "parameters": {n: asdict(spread) for n, spread in found.parameters.items()},
            "free": found.free,
            "identifiable": found.identifiable,
            "null_directions": null_direction_entries(found.null_directions),
            "ambiguities": ambiguity_entries(found.ambiguities),
            "determined": determined_entries(found.determined),
            "noise": found.noise,
            "n_observations": found.n_observations,
            "help": [_added(datum) for datum in found.help],
            "leans_on": [_sensitivity(entry) for entry in found.leans_on],
            "mass_exponents": found.mass_exponents,
            "warnings": all_words(found.warnings),
        }
    )


def where(datum: AddedDatum) -> str:
    """Say where a datum would be recorded."""
    return f"at sensor {datum.sensor}" if datum.sensor else "off the sensors' line"


def _added(datum: AddedDatum) -> dict[str, Any]:
    return {
        "quantity": datum.quantity,
        "where": where(datum),
        "position_m": datum.position,
        "charge": datum.charge or None,
        "sigma": datum.sigma,
        "sigma_from": "default" if datum.is_default else "layout",
        "law": datum.law,
        "law_valid": datum.law_valid,
        "parameter": datum.parameter,
        **asdict(datum.left),
    }


def _sensitivity(entry: Sensitivity) -> dict[str, Any]:
    without = entry.without_prior
    return {
        "parameter": entry.parameter,
        "on": entry.on,
        "if_known": asdict(entry.if_known),
        "without_prior": None if without is None else asdict(without),
    }
