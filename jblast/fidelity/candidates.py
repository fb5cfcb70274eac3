"""Every method that gives a quantity, and how well it does over some places."""

import math
from collections.abc import Sequence

import numpy as np

from jblast.fidelity import error_tables, solver
from jblast.fidelity.choice import Candidate
from jblast.fidelity.conditions import Conditions
from jblast.fidelity.errors import is_covered, reference_uncertainty, relative_errors
from jblast.fidelity.reference import REFERENCES, covers, is_reference
from jblast.registry import Law, law_for, names_for

ON_THE_GROUND = 0.05
"""Scaled height or depth of burst up to which a method that knows of neither will do
beside a reference that does [m/kg^(1/3)]."""


def worst_reference_uncertainty(
    quantity: str, conditions: Sequence[Conditions]
) -> float:
    """Return how far the reference may be off; infinite where there is none."""
    if quantity not in REFERENCES:
        exact = all(law_for(quantity, name).is_exact() for name in names_for(quantity))
        return 0.0 if exact else math.inf
    if not all(is_covered(quantity, each).all() for each in conditions):
        return math.inf
    return max(
        float(reference_uncertainty(quantity, each).max()) for each in conditions
    )


def candidates_for(
    quantity: str, conditions: Sequence[Conditions], uncertainty: float
) -> list[Candidate]:
    """Return every method that gives the quantity."""
    if quantity in REFERENCES:
        of_paths = [relative_errors(quantity, each) for each in conditions]
        errors = {
            method: np.concatenate([each[method] for each in of_paths])
            for method in of_paths[0]
        }
    else:
        errors = {name: np.full(1, uncertainty) for name in names_for(quantity)}
    blind = blind_to_height(quantity, conditions)
    costs = error_tables.costs()
    found = []
    for method, error in errors.items():
        worst = math.inf if method in blind else float(error.max())
        found.append(
            Candidate(
                method=method,
                error=worst,
                predicted_error=max(worst, uncertainty),
                cost_s=costs.get((quantity, method), math.nan),
                valid=all(np.all(each.holds[method]) for each in conditions),
                is_reference=all(
                    is_reference(quantity, method, np.asarray(each.z))
                    for each in conditions
                ),
            )
        )
    return found


def blind_to_height(quantity: str, conditions: Sequence[Conditions]) -> set[str]:
    """Return the methods that do not know how high or deep the charge is.

    None where it stands on the ground, or where the reference does not know either.
    """
    for each in conditions:
        z = np.asarray(each.z)
        branches = REFERENCES.get(quantity, ())
        laws = [law_for(quantity, p.law) for p in branches if covers(p, z).any()]
        lifted = np.abs(each.scaled_height).max() > ON_THE_GROUND
        if lifted and any(map(_knows_height, laws)):
            return {
                method
                for method in each.holds
                if method == solver.METHOD
                or not _knows_height(law_for(quantity, method))
            }
    return set()


def _knows_height(law: Law) -> bool:
    return "height_of_burst" in law.arguments()
